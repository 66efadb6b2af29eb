import functools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import ContactState
from holdfast.detection import fingertip_force
from holdfast_lab.randomized import simulation
from holdfast_lab.randomized.drawing import (
    MEASURED,
    SENSOR_KINDS,
    draw_object,
    draw_sensor,
    with_measured,
)
from holdfast_lab.randomized.scenario import EVENT_KINDS, draw_events
from holdfast_lab.randomized.simulation import (
    RandomHold,
    kept_in_gaps,
    last_updates,
    simulate_random,
)

pytestmark = pytest.mark.slow

RATE = 150.0


@functools.cache
def plain_hand(number):
    return simulate_random(RandomHold(number, seed=3))


@pytest.fixture(scope="module")
def hands():
    return [plain_hand(number) for number in range(4)]


def test_the_same_number_and_seed_give_the_same_bytes(hands):
    assert simulate_random(RandomHold(1, seed=3)).digest == hands[1].digest
    assert len({hand.digest for hand in hands}) == len(hands)


def test_every_hand_has_two_to_four_fingers_and_labels(hands):
    for hand in hands:
        assert 2 <= len(hand.modules) <= 4
        assert len(hand.modules) == hand.metadata["n_pads"]
        for module in hand.modules.values():
            assert np.isfinite(module.readings).all()
            assert (module.label_states > 0).all()
            assert 25.0 < 1 / module.period < 520.0


def test_a_stable_object_does_not_slide(hands):
    for hand in hands:
        for name, arrays in hand.truth.fingers.items():
            times = hand.modules[name].times
            stable = hand.modules[name].label_states == ContactState.STABLE.code
            slip = np.interp(times, hand.truth.times, arrays["slip_speed"])
            assert stable.sum() == 0 or np.quantile(slip[stable], 0.99) < 0.0015


def test_a_recording_that_starts_loaded_has_the_truth_of_its_part():
    hands = (simulate_random(RandomHold(0, seed=seed)) for seed in range(20))
    cut = next(hand for hand in hands if "starts_loaded" in hand.metadata)
    first = min(float(module.times[0]) for module in cut.modules.values())
    assert abs(cut.truth.times[0] - first) < 2 * cut.modules["thumb"].period
    arrays = [cut.truth.hand, *cut.truth.fingers.values()]
    assert {len(array) for part in arrays for array in part.values()} == {len(cut.truth.times)}


def test_readings_show_the_contact_force():
    """Of a sensor without gains, cross-talk or noise to speak of, the sum of the taxels."""
    hand = simulate_random(RandomHold(2, seed=3, kind="papillarray"))
    name = "thumb"
    module = hand.modules[name]
    force = np.linalg.norm(fingertip_force(module.readings, module.sensor, tare=0.3), axis=1)
    wanted = np.linalg.norm(hand.truth.fingers[name]["contact_force"], axis=1)
    held = wanted > 0.5 * wanted.max()
    assert np.corrcoef(force[held | (wanted < 0.01)], wanted[held | (wanted < 0.01)])[0, 1] > 0.9


def test_a_measured_hand_differs_from_the_plain_one_in_its_readout_alone(hands):
    """The same physics and times; other readings, and the mechanisms in the metadata."""
    plain = hands[1]
    measured = simulate_random(RandomHold(1, seed=3, measured=("scan", "filter", "noise")))
    expected = {**plain.metadata, "measured": ["scan", "filter", "noise"]}
    assert "measured" not in plain.metadata
    assert dict(measured.metadata) == expected
    for name, array in plain.truth.hand.items():
        np.testing.assert_array_equal(measured.truth.hand[name], array)
    for name, module in plain.modules.items():
        np.testing.assert_array_equal(measured.modules[name].times, module.times)
        assert (measured.modules[name].readings != module.readings).any()


@pytest.mark.parametrize("kind", SENSOR_KINDS)
def test_each_mechanism_is_drawn_the_same_with_and_without_the_others(kind):
    plain = draw_sensor(np.random.default_rng(1), kind)
    for seed in range(20):
        drawn = [
            with_measured(plain, kind, names, np.random.default_rng(seed)).parameters
            for names in [(), *((name,) for name in MEASURED), MEASURED]
        ]
        none, scan, filtered, noise, vibration, colour, steps, updates, *rest, together = drawn
        assert none == vibration == updates == plain.parameters
        assert all(parameters == none for parameters in rest)
        slow = [(x.slow_share, x.slow_time, x.walk) for x in (colour, together)]
        assert slow[0] == slow[1]
        assert steps.still_share == together.still_share
        assert 1 <= steps.step <= together.step
        assert (scan.scan_time, scan.scan_line) == (together.scan_time, together.scan_line)
        assert filtered.n_averaged == together.n_averaged
        assert noise.noise_counts == together.noise_counts >= plain.parameters.noise_counts
        assert noise.noise_by_axis == together.noise_by_axis
        assert (scan.scan_time > 0) == (kind != "papillarray")


def hand_with(wanted, measured, numbers=range(40)):
    """Return the number of the first hand whose sensor or carrier is as wanted."""
    for number in numbers:
        hold = RandomHold(number, seed=3, measured=measured)
        kind = str(hold.generator("hand").choice(SENSOR_KINDS))
        drawn = draw_sensor(hold.generator("sensor"), kind)
        drawn = with_measured(drawn, kind, measured, hold.generator("measured"))
        if wanted(drawn.stream, simulation.carrier_of(hold)):
            return number
    raise AssertionError("no such hand")


@pytest.mark.parametrize("carrier", ["carry", "person"])
def test_a_carried_hand_moves_all_the_time(carrier):
    number = hand_with(lambda _, drawn: drawn == carrier, (carrier,))
    plain = plain_hand(number)
    carried = simulate_random(RandomHold(number, seed=3, measured=(carrier,)))
    assert carried.metadata["carrier"] == carrier
    assert "carrier" not in plain.metadata
    assert plain.metadata["object_mass"] == carried.metadata["object_mass"]
    n = min(len(plain.truth.times), len(carried.truth.times))
    change = carried.truth.hand["gravity"][:n] - plain.truth.hand["gravity"][:n]
    assert np.abs(change).max() > 0.05


def test_an_unknown_mechanism_is_refused():
    with pytest.raises(ValueError, match="unknown mechanism 'glue'; there are scan, filter, noise"):
        RandomHold(0, measured=("glue",))


@pytest.mark.parametrize("seed", range(20))
def test_friction_holds_every_object(seed):
    item = draw_object(np.random.default_rng(seed), grip=2.0, n_opposite=1)
    assert item.mass * 9.81 <= 2 * item.mu_static * 2.0 or item.mass < 0.0304


def test_events_fill_the_hold_and_do_not_overlap():
    from holdfast_lab.randomized.drawing import ranges

    found = set()
    for seed in range(40):
        events = draw_events(np.random.default_rng(seed), ranges()["events"], ranges()["arm"], 18.0)
        ends = [event.start + event.duration for event in events]
        assert all(event.start > end for event, end in zip(events[1:], ends, strict=False))
        assert ends[-1] < 18.0
        found |= {event.kind for event in events}
    assert found == set(EVENT_KINDS)


@given(st.floats(1.0, 5.0), st.floats(0.0, 1.0), st.integers(1, 300))
def test_rows_show_the_last_update_and_none_of_the_future(rows, phase, n):
    shown = last_updates(np.arange(n) / RATE, RATE / rows, phase)
    assert shown[0] == 0
    assert (shown <= np.arange(n)).all()
    assert (np.arange(n) - shown < rows + 1).all()
    assert (np.diff(shown) >= 0).all()
    assert len(np.unique(shown)) == pytest.approx(n / rows, abs=2)


def test_gaps_lose_all_rows_of_their_time():
    times = np.arange(50_000) / 500
    kept = kept_in_gaps(times, 0.5, (0.019, 0.025), np.random.default_rng(2))
    gaps = np.diff(times[kept])
    gaps = gaps[gaps > 1.5 / 500]
    assert 30 <= len(gaps) <= 70
    assert gaps.max() < 0.06
    assert np.median(gaps) == pytest.approx(0.022 + 1 / 500, abs=0.002)
    assert kept[[0, -1]].all()
