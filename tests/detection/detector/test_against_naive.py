from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import Cause, ContactState, Fault
from holdfast.detection import ANY_FINGER, Debounce, Detector, Model, Tare

from . import naive
from .build import RATE, RICH, SLIP_OWN, finger_model, model, sensor, tactile

pytestmark = pytest.mark.slow


def eventful(seed, which, n=420):
    """Samples that go missing, repeat, stick, saturate, break, pull, and come in at odd times."""
    rng = np.random.default_rng(seed)
    values = np.array(tactile(n, seed, which).readings)
    press = np.zeros(n)
    for start in rng.integers(60, n, size=3):
        press[start : start + rng.integers(20, 90)] += rng.normal(scale=60)
    values[:, :, 2] += np.rint(press)[:, None]
    values = np.clip(values, 1, 999)
    frozen = rng.integers(120, n - 80)
    values[frozen : frozen + 70] = values[frozen]
    values[rng.integers(30, n, size=2), 0, 1] = 1000.0
    values[rng.integers(0, n, size=3), 1, 2] = rng.choice([np.nan, np.inf])
    kept = rng.random(n) > 0.05
    hole = rng.integers(50, n)
    kept[hole : hole + rng.integers(2, 30)] = False
    return values, kept


def stream(seed, fingers, which):
    rng = np.random.default_rng([seed, 1])
    found = {name: eventful([seed, i], which) for i, name in enumerate(fingers)}
    times = np.arange(420) / RATE + rng.uniform(-0.2, 0.2, size=420) / RATE
    for k, time in enumerate(times):
        yield {name: values[k] for name, (values, kept) in found.items() if kept[k]}, float(time)


def same(estimate, slow):
    time, hand, rows = slow
    assert estimate.time == time
    assert str(estimate.state) == hand
    assert list(estimate.fingers) == list(rows)
    for name, (names, numbers, slip) in rows.items():
        one = estimate.fingers[name]
        faults = tuple(map(str, one.faults))
        assert (str(one.state), str(one.reason), faults, one.faulty_taxels) == names
        found = (one.time, one.stable_probability, one.instability, *one.force)
        assert found == pytest.approx(numbers, rel=1e-9, abs=1e-9, nan_ok=True)
        if slip is None:
            assert one.slip_probability is one.slip_speed is None
        else:
            assert one.slip_probability == pytest.approx(slip[0], rel=1e-9, abs=1e-9, nan_ok=True)
            assert (one.cause is Cause.SLIP) == slip[1]
            found = (one.slip_speed, one.slip_distance)
            expected = slip[2:]
            if slip[2] is not None:
                expected = pytest.approx(expected, rel=1e-9, abs=1e-9, nan_ok=True)
            assert found == expected


MODELS = {
    "rich": {"features": RICH, "tare": "0.2", "threshold": 15.0},
    "rich, first": {"features": RICH, "tare": "first"},
    "none": {"tare": "none", "threshold": 200.0},
    "debounced": {"tare": "0.1", "debounce": Debounce(0.05, 0.1), "threshold": 30.0},
    "held": {"tare": "0.1", "debounce": Debounce(0.02, 0.05, 0.12), "threshold": 30.0},
    "long window": {"tare": "0.3", "window": 20},
    "slips": {"tare": "0.1", "threshold": 30.0, "slips": ("thumb", "index", "ring")},
    "slips by features of their own": {
        "tare": "0.1",
        "threshold": 30.0,
        "slips": ("thumb", "ring"),
        "own": SLIP_OWN,
    },
    "speeds": {
        "tare": "0.1",
        "threshold": 30.0,
        "slips": ("thumb", "ring"),
        "own": SLIP_OWN,
        "speeds": ("ring",),
    },
    "speeds by the features of stability": {
        "tare": "first",
        "slips": ("thumb", "index"),
        "speeds": ("thumb", "index"),
    },
    "slips of some": {"tare": "first", "features": RICH, "slips": ("index",)},
}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("options", MODELS.values(), ids=MODELS)
def test_equals_the_naive_detector(options, seed):
    hand_model = model(("thumb", "index", "ring"), **options)
    which = sensor()
    sensors = dict.fromkeys(hand_model.fingers, which)
    detector, slow = (
        Detector(hand_model),
        naive.Hand(hand_model, sensors, Tare.parse(hand_model.tare), RATE),
    )
    seen = set()
    for samples, time in stream(seed, hand_model.fingers, which):
        estimate = detector.update(samples, time)
        same(estimate, slow.update(samples, time))
        seen |= {(x.state, x.reason, *x.faults) for x in estimate.fingers.values()}
    assert len(seen) >= 5  # of states, reasons and faults together


@pytest.mark.parametrize("n_taxels", [64, 65, 87, 120, 512])
def test_a_large_finger_goes_on_without_taxels_beyond_index_60(n_taxels):
    """One jumps once, one is lost, and one freezes, under a press."""
    lost, jumping, frozen = n_taxels - 1, n_taxels - 2, n_taxels - 3
    which = sensor(n_taxels, "large", limits=(0.0, 65_535.0), magnetic=True)
    rng = np.random.default_rng(n_taxels)
    values = np.rint(30_000 + rng.normal(scale=3, size=(220, n_taxels, 3)))
    values[60:, :, 2] += np.rint(np.linspace(0, 100, n_taxels))
    values[70:, lost, 1] = np.nan
    values[50, jumping] += 9000
    values[90:, frozen] = values[90, frozen]
    hand_model = model(("thumb",), which=which, threshold=30.0)
    detector, sensors = Detector(hand_model), {"thumb": which}
    slow = naive.Hand(hand_model, sensors, Tare.parse(hand_model.tare), RATE)
    named = []
    for k, readings in enumerate(values):
        estimate = detector.update({"thumb": readings}, k / RATE)
        same(estimate, slow.update({"thumb": readings}, k / RATE))
        named.append(estimate.fingers["thumb"].faulty_taxels)
        assert k < 40 or estimate.fingers["thumb"].state is not ContactState.UNKNOWN
    assert (named[49], named[50], named[69], named[70]) == ((), (jumping,), (), (lost,))
    assert named[-1] == (frozen, lost)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", ["anyskin", "other"])  # the unit of one is known
def test_equals_the_naive_detector_in_a_field(name, seed):
    """Fields that turn, presses, both at once, and magnetometers that are read too early.

    One finger stays open, is missing for a while, and loses an axis: the other follows the field
    by it.
    """
    rng = np.random.default_rng(seed)
    which = sensor(6, name, limits=None, magnetic=True)
    values = 300 * rng.normal(size=(6, 3)) + rng.normal(size=(900, 6, 3))
    other = 300 * rng.normal(size=(6, 3)) + rng.normal(size=(900, 6, 3))
    frames = which.rotations if seed % 2 else np.broadcast_to(np.eye(3), (6, 3, 3))
    for start in rng.integers(140, 800, size=6):
        ramp = np.clip((np.arange(900) - start) / rng.integers(1, 100), 0, 1)
        field = rng.normal(size=3) * rng.choice([5, 40, 90])
        values += ramp[:, None, None] * np.einsum("ikj,k->ij", frames, field)
        other += ramp[:, None, None] * np.einsum("ikj,k->ij", frames, np.roll(field, 1))
        end = np.clip((start + 90 - np.arange(900)) / 20, 0, 1)
        press = rng.uniform(0, 1, (6, 1)) ** rng.choice([0.0, 0.3, 1.0]) * [10, 5, 150]
        values += (ramp * end)[:, None, None] * press
    # Pressed while both turn.
    turn = np.interp(np.arange(900), [60, 90, 110], [0, 1, 0])
    values += turn[:, None, None] * np.einsum("ikj,k->ij", frames, [50, -40, 20])
    other += turn[:, None, None] * np.einsum("ikj,k->ij", frames, [20, 50, 40])
    held = np.interp(np.arange(900), [40, 50, 120, 130], [0, 1, 1, 0])
    values += held[:, None, None] * rng.uniform(0, 1, (6, 1)) * [10, 5, 150]
    for k in rng.choice(np.arange(5, 900), 40, replace=False):
        values[k, rng.integers(6)] = rng.choice([0.0, 1500.0])
    values[rng.integers(100, 800) :][:80, 2] = 0
    other[300:, 4, 2] = other[300, 4, 2]
    hand_model = model(("thumb", "index"), tare="0.2", threshold=25.0, which=which)
    detector = Detector(hand_model)
    slow = naive.Hand(hand_model, dict.fromkeys(("thumb", "index"), which), Tare.parse("0.2"), RATE)
    seen, missing = set(), rng.integers(300, 800)
    for k, readings in enumerate(values):
        samples = {"thumb": readings, "index": other[k]}
        if missing <= k < missing + 60:
            del samples["index"]
        estimate = detector.update(samples, k / RATE)
        same(estimate, slow.update(samples, k / RATE))
        seen |= {*estimate.fingers["thumb"].faults, *estimate.fingers["index"].faults}
        seen |= {"shared"} if slow.fingers["thumb"].is_shared else set()
    assert {Fault.INVALID, Fault.STUCK, "shared"} <= seen


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", ["magnetic", "counts", "N", "few"])
def test_equals_the_naive_detector_with_jumps_and_new_baselines(kind, seed):
    """Taxels that jump and return, alone and in a press; holds that go to zero at once."""
    n, n_taxels, rng = 500, 3 if kind == "few" else 6, np.random.default_rng([seed, len(kind), 5])
    unit = "N" if kind == "N" else "count"
    which = sensor(n_taxels, kind, limits=None, unit=unit, magnetic=kind == "magnetic")
    which = replace(which, step=0.25) if kind == "N" else which
    grip = np.zeros(n)
    for start in range(60, 400, 170):
        grip[start : start + 110] = np.interp(np.arange(110), [0, rng.integers(1, 40)], [0, 1])
    values = grip[:, None, None] * rng.uniform(0.2, 1, (n_taxels, 1)) * [10, 5, 150]
    values += rng.normal(size=(n, n_taxels, 3)) * (which.step or 1.0)
    if kind != "magnetic":
        values = (which.step or 1.0) * np.rint(values / (which.step or 1.0))
    for start in rng.integers(20, n - 50, size=6):
        jump = rng.choice([-1, 1]) * rng.choice([256, 65536, 700, 9000]) * (which.step or 1.0)
        end = start + rng.choice([1, 2, 30, n])
        values[start:end, rng.integers(n_taxels), rng.integers(3)] += jump
    at, dip = 230 + rng.integers(60, 110), 60 + rng.integers(60, 100)
    values[at:] -= values[at - 1] - (which.step or 1.0) * np.rint(rng.normal(size=(n_taxels, 3)))
    values[dip : dip + 2] = values[0:2]
    values[rng.integers(n, size=3), 0, 1] = np.nan
    hand_model = model(("thumb",), tare="0.2", threshold=25.0, which=which)
    detector = Detector(hand_model)
    slow = naive.Hand(hand_model, {"thumb": which}, Tare.parse("0.2"), RATE)
    seen, gap = set(), rng.integers(100, n - 50)
    for k, readings in enumerate(values):
        if not gap <= k < gap + 5:
            estimate = detector.update({"thumb": readings}, k / RATE)
            same(estimate, slow.update({"thumb": readings}, k / RATE))
            seen |= {*estimate.fingers["thumb"].faults}
            seen |= {"stays"} if slow.fingers["thumb"].offsets else set()
    assert Fault.REZEROED in seen
    assert "stays" in seen or kind == "few"


def test_equals_the_naive_detector_with_contact_by_noise():
    hand_model = Model(fingers={ANY_FINGER: finger_model(contact_noise=5.0)}, window=6, tare="0.2")
    sensors = {"finger1": sensor(), "finger2": sensor(3, "other")}
    detector = Detector(hand_model, sensors, RATE)
    slow = naive.Hand(hand_model, sensors, Tare.parse("0.2"), RATE)
    for k in range(300):
        samples = {
            name: tactile(300, 7 + i, which).readings[k] / (1 if k > 100 else 5)
            for i, (name, which) in enumerate(sensors.items())
        }
        same(detector.update(samples, k / RATE), slow.update(samples, k / RATE))
