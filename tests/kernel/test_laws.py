"""Laws of a living skin: what breaks one is named in time, and what keeps them is not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from detection.detector.build import RATE, model, sensor
from holdfast.contact import STABLE, ContactState, Fault, Reason
from holdfast.detection import Detector, Model, detect
from holdfast.recordings import Recording, Tactile
from holdfast.synthetic import synthetic_recording

START, N = 300, 1500
"""First sample that is spoilt, and number of samples."""
LAWS = {Fault.REPEATED, Fault.EQUAL_TAXELS, Fault.STUCK, Fault.COPIED}


def living(n=N, n_taxels=6, level=3.0, seed=0):
    """Return the noise of a skin, in whole counts."""
    rng = np.random.default_rng(seed)
    return np.rint(30_000 + rng.normal(scale=level, size=(n, n_taxels, 3)))


def ring(values, period, start=START):
    """Repeat readings from a sample on."""
    values[start:] = values[start + np.arange(len(values) - start) % period]
    return values


def estimates_of(values, times=None):
    which = sensor(values.shape[1], "skin", limits=(0.0, 65_535.0))
    detector = Detector(model(("thumb",), which=which))
    times = np.arange(len(values)) / RATE if times is None else times
    hands = [detector.update({"thumb": x}, t) for x, t in zip(values, times, strict=True)]
    return [hand.fingers["thumb"] for hand in hands]


def first_with(fault, estimates):
    return next((k for k, e in enumerate(estimates) if fault in e.faults), None)


class TestTime:
    @pytest.mark.parametrize("toggles", [False, True])
    @pytest.mark.parametrize("n_taxels", [5, 6, 30])
    @pytest.mark.parametrize("period", [3, 17, 64, 65, 200, 511, 512])
    def test_readings_that_return_in_order(self, period, n_taxels, toggles):
        values = ring(living(n_taxels=n_taxels), period)
        values[START:, 2, 0] += toggles * np.random.default_rng(1).integers(0, 2, N - START)
        estimates = estimates_of(values)
        found = first_with(Fault.REPEATED, estimates)
        assert START + period + 15 <= found <= START + max(2 * period, period + 31)
        assert {(e.state, e.reason) for e in estimates[found:]} == {
            (ContactState.UNKNOWN, Reason.FAULT)
        }

    @pytest.mark.parametrize(
        ("n_varying", "period", "expected"),
        [(12, 10, True), (11, 10, False), (18, 2, False), (18, 513, False), (18, 700, False)],
    )
    def test_what_may_be_chance_or_is_too_long(self, n_varying, period, expected):
        values = np.full((N, 18), 30_000.0)
        values[:, :n_varying] = living().reshape(N, 18)[:, :n_varying]
        estimates = estimates_of(ring(values.reshape(N, 6, 3), period))
        assert (first_with(Fault.REPEATED, estimates) is not None) == expected

    def test_a_value_that_is_sent_twice_is_no_repeat_and_hides_none(self):
        values = np.repeat(living(), 2, axis=0)
        assert first_with(Fault.REPEATED, estimates_of(values)) is None
        found = first_with(Fault.REPEATED, estimates_of(ring(values, 80)))
        assert found <= START + 2 * 80

    def test_a_recording_that_is_played_again_after_a_pause(self):
        times = np.arange(N) / RATE + np.arange(N) // 300 * 1.0
        assert first_with(Fault.REPEATED, estimates_of(ring(living(), 300, 0), times)) is None

    @pytest.mark.parametrize("name", ["any", "twin", "noise-floor"])
    @pytest.mark.parametrize("period", [65, 300, 512])
    def test_a_held_finger_is_never_stable(self, period, name):
        made = synthetic_recording("made", 0, ("thumb",))
        module = made.modules["thumb"]
        start = int(np.argmax(module.times > 4.0))
        values = np.array(module.readings, dtype=np.float64)
        values[start:, 3, 2] += np.arange(len(values) - start) % 2  # of the ring of 300 and 512
        values = ring(values, period, start)
        spoilt = Recording("made", {"thumb": Tactile(module.sensor, module.times, values)})
        trace = detect(Model.load(f"builtin:{name}"), spoilt).fingers["thumb"]
        assert (trace.state[start - 50 : start] == STABLE).any()
        assert set(trace.state[start + period + 31 :]) == {0}


class TestTaxels:
    @pytest.mark.parametrize("n_taxels", [6, 30, 70])
    def test_two_that_are_equal_while_they_change(self, n_taxels):
        values = living(n_taxels=n_taxels)
        values[START:, -1] = values[START:, 2]
        estimates = estimates_of(values)
        found = first_with(Fault.EQUAL_TAXELS, estimates)
        assert START + 20 <= found <= START + 2 * n_taxels + 24
        assert {e.faulty_taxels for e in estimates[found:]} == {(2, n_taxels - 1)}
        assert ContactState.UNKNOWN not in {e.state for e in estimates[found:]}

    def test_all_of_a_finger(self):
        values = living()
        values[START:] = values[START:, :1]
        estimates = estimates_of(values)
        assert {e.state for e in estimates[START + 40 :]} == {ContactState.UNKNOWN}
        assert Fault.EQUAL_TAXELS in estimates[-1].faults


class TestAxes:
    @pytest.mark.parametrize("axes", [[0], [2], [0, 1]])
    def test_one_that_changed_and_is_frozen(self, axes):
        values = living()
        values[START:, :, axes] = values[START, :, axes].T
        estimates = estimates_of(values)
        assert START + 50 <= first_with(Fault.STUCK, estimates) <= START + 60
        assert estimates[-1].state is ContactState.UNKNOWN

    @pytest.mark.parametrize("other", [1, 2])
    def test_one_that_is_equal_to_another(self, other):
        values = living()
        values[START:, :, 0] = values[START:, :, other]
        estimates = estimates_of(values)
        assert START + 19 <= first_with(Fault.STUCK, estimates) <= START + 22
        assert estimates[-1].state is ContactState.UNKNOWN

    def test_one_that_rests_while_two_taxels_toggle(self):
        """A quiet hold of a sensor with steps."""
        values = living(level=0.6)
        values[START:, 2:] = 0.0
        values[START:, :2] = values[START, :2]
        values[START:, :2, 0] += np.random.default_rng(1).integers(0, 2, (N - START, 2))
        quiet = estimates_of(values)[START : START + 600]
        assert first_with(Fault.STUCK, quiet) is None


class TestModules:
    def states(self, spoil):
        values = {name: living(seed=k) for k, name in enumerate(("thumb", "index", "ring"))}
        spoil(values)
        which = sensor(6, "skin", limits=(0.0, 65_535.0))
        detector = Detector(model(tuple(values), which=which))
        return [
            detector.update({name: v[k] for name, v in values.items()}, k / RATE) for k in range(N)
        ]

    def test_two_that_are_equal_while_they_change(self):
        def copy(values):
            values["ring"][START:800] = values["thumb"][START:800]

        hands = self.states(copy)
        copied = [
            {name for name, e in hand.fingers.items() if Fault.COPIED in e.faults} for hand in hands
        ]
        assert copied == [set()] * 320 + [{"thumb", "ring"}] * 480 + [set()] * (N - 800)
        states = {hand.fingers[name].state for hand in hands[320:800] for name in copied[320]}
        assert states == {ContactState.UNKNOWN}
        assert {hand.fingers["index"].state for hand in hands[320:]} != {ContactState.UNKNOWN}


class TestNoise:
    @pytest.mark.parametrize("taxels", [[1], [0, 1, 2, 3], [0, 1, 2, 3, 4, 5]])
    def test_frozen_readings_whose_last_bit_toggles(self, taxels):
        values = living(level=20.0)
        rest = values[900]
        values[900:, taxels] = rest[taxels]
        values[900:, taxels, 2] += np.arange(N - 900)[:, None] % 2
        estimates = estimates_of(values)
        assert 900 < first_with(Fault.STUCK, estimates) <= 900 + 160
        assert ContactState.STABLE not in {e.state for e in estimates[1060:]} or len(taxels) == 1


@settings(max_examples=25)
@given(
    seed=st.integers(0, 9999),
    n_taxels=st.sampled_from([1, 2, 4, 5, 9, 30]),
    level=st.sampled_from([0.0, 0.05, 0.2, 0.4, 0.8, 3.0]),
    step=st.sampled_from([1.0, 10.0]),
    zero=st.booleans(),
)
def test_living_skins_keep_all_laws(seed, n_taxels, level, step, zero):
    """Presses of a skin with little noise or much, in steps, that rests at zero or not."""
    rng = np.random.default_rng(seed)
    press = np.clip(np.cumsum(rng.normal(scale=8, size=1200)), 0, None)[:, None, None]
    shares = rng.uniform(0.0, 1.0, (n_taxels, 3)) * [0.3, 0.2, 1.0]
    values = press * shares + rng.normal(scale=step * level, size=(1200, n_taxels, 3))
    values = np.rint(values / step) * step
    values = np.where(press > 0, values, 0.0) if zero else values + 30_000
    laws = LAWS - ({Fault.STUCK} if zero or level < 0.8 else set())  # a quiet finger that rests
    assert not laws & {fault for e in estimates_of(values) for fault in e.faults}
