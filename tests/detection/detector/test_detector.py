import copy
import itertools
import pickle
import sys
import tracemalloc

import numpy as np
import pytest

from holdfast.contact import ContactEvent, ContactState, Fault, Reason
from holdfast.detection import (
    ANY_FINGER,
    HAND,
    Debounce,
    Detector,
    FeatureSpec,
    Linear,
    Model,
    Tare,
    detect,
)
from holdfast.detection.detector import MAX_EVENTS
from holdfast.detection.features import extract
from holdfast.detection.plan import StreamPlan
from holdfast.errors import ModelError, StreamError
from holdfast.sensors import sensor as built_in

from .build import (
    RATE,
    feed,
    finger_model,
    lively,
    model,
    recording,
    runs,
    sensor,
    tactile,
)

UNKNOWN, NO_CONTACT, UNSTABLE, STABLE = ContactState
N_TARE = 20
"""Samples in the tare of 0.2 s."""


def by_force(threshold=0.5, **options):
    """Stable where F_x is above 100: the probability is exactly half there."""
    rule = Linear((100.0,), (10.0,), ((1.0,),), (0.0,))
    features = (FeatureSpec("F_x"),)
    part = finger_model(features, rule=rule, threshold=threshold, contact_threshold=5.0)
    options = {"tare": "none", "window": 2, "rate": RATE} | options
    return Model(fingers={ANY_FINGER: part}, **options)


FLAT = type(sensor())(
    "flat", [[0.0, 0.0, 0.0]], [np.eye(3)], [0.0, 0.0, 1.0], RATE, "N", (-1e4, 1e4)
)  # fmt: skip


def flat(fx, k):
    """Sample k: a change that no force shows, as constant readings are none of a living skin."""
    return [[fx, 1e-9 * (k % 2), 0.0]]


def pushes(detector, forces, finger="finger1", start=0.0):
    samples = [flat(fx, k) for k, fx in enumerate(forces)]
    return [e.state for e in feed(detector, samples, finger, start)]


class TestReasons:
    def test_tare_then_warm_up_then_a_state(self):
        estimates = feed(Detector(model(("thumb",))), lively(60))
        assert runs(estimates, lambda e: e.reason)[:3] == [("tare", 20), ("warm_up", 5), ("", 35)]
        assert all(np.isnan(e.force).all() for e in estimates[:N_TARE])
        assert np.isfinite([e.force for e in estimates[N_TARE:]]).all()
        assert (
            np.isfinite([e.instability for e in estimates]).tolist() == [False] * 25 + [True] * 35
        )
        assert np.isfinite([e.stable_probability for e in estimates]).tolist() == (
            [False] * 25 + [True] * 35
        )

    @pytest.mark.parametrize("tare", ["first", "none"])
    def test_no_time_for_a_tare(self, tare):
        estimates = feed(Detector(model(("thumb",), tare=tare)), lively(30))
        assert runs(estimates, lambda e: e.reason) == [("warm_up", 5), ("", 25)]

    def test_the_state_is_unknown_exactly_where_there_is_a_reason(self):
        values = lively()
        values[[40, 90], 0, 0] = np.nan
        for estimate in feed(Detector(model(("thumb",))), values):
            assert (estimate.state is UNKNOWN) == (estimate.reason is not Reason.NONE)
            assert np.isnan(estimate.stable_probability) == (estimate.state is UNKNOWN)

    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_a_sample_that_is_not_finite(self, bad):
        values = lively(60)
        values[40, :, 2] = bad
        estimates = feed(Detector(model(("thumb",))), values)
        expected = [("tare", 20), ("warm_up", 5), ("", 15), ("fault", 1), ("warm_up", 5), ("", 14)]
        assert runs(estimates, lambda e: e.reason) == expected
        assert estimates[40].faults == (Fault.NOT_FINITE,)
        assert estimates[41].faults == ()

    @pytest.mark.parametrize("start", [0.0, 1.7e9])
    @pytest.mark.parametrize(("periods", "gap"), [(2.5, False), (3.0, False), (3.1, True)])
    def test_a_gap_is_longer_than_three_periods(self, periods, gap, start):
        detector = Detector(model(("thumb",)))
        feed(detector, lively(60), start=start)
        again = start + (59 + periods) / RATE
        estimates = feed(detector, lively(20), start=again)
        expected = [("gap", 5), ("", 15)] if gap else [("", 20)]
        assert runs(estimates, lambda e: e.reason) == expected

    def test_a_missing_finger_keeps_its_estimate_for_three_periods(self):
        detector = Detector(model())
        values = lively()
        for k in range(50):
            last = detector.update({"thumb": values[k], "index": values[k + 1]}, k / RATE)
        estimates = [detector.update({"thumb": values[k]}, k / RATE) for k in range(50, 60)]
        assert [e.fingers["index"] for e in estimates[:3]] == [last.fingers["index"]] * 3
        assert {e.fingers["index"].reason for e in estimates[3:]} == {Reason.GAP}
        assert {e.fingers["index"].time for e in estimates} == {49 / RATE}
        assert {e.fingers["thumb"].reason for e in estimates} == {Reason.NONE}
        assert np.isnan(estimates[-1].fingers["index"].force).all()


class TestContactThreshold:
    def test_absolute(self):
        hand_model = by_force()
        forces = [200, 200, 3.4, 4.9, 5.1, 101, 99]
        found = pushes(Detector(hand_model, {"finger1": FLAT}), forces)
        expected = [STABLE, STABLE, NO_CONTACT, NO_CONTACT, UNSTABLE, STABLE, UNSTABLE]
        assert found[1:] == expected[1:]

    def test_it_is_lower_while_in_contact(self):
        forces = [200, 200, 4.9, 3.6, 3.4, 4.9]
        found = pushes(Detector(by_force(), {"finger1": FLAT}), forces)
        assert found[1:] == [STABLE, UNSTABLE, UNSTABLE, NO_CONTACT, NO_CONTACT]

    def test_the_probability_without_contact_is_zero(self):
        estimates = feed(Detector(by_force(), {"f": FLAT}), [flat(1.0, k) for k in range(3)], "f")
        assert (estimates[-1].state, estimates[-1].stable_probability) == (NO_CONTACT, 0.0)


class TestDebounce:
    def test_a_state_is_reported_when_it_has_lasted(self):
        hand_model = by_force(debounce=Debounce(min_duration=0.03))
        forces = [150] * 5 + [50] * 2 + [150] * 5 + [50] * 6
        found = pushes(Detector(hand_model, {"finger1": FLAT}), forces)
        assert [s for s, _ in itertools.groupby(found[1:])] == [STABLE, UNSTABLE]
        assert found.index(UNSTABLE) == 12 + 3

    def test_the_first_state_after_unknown_is_reported_at_once(self):
        hand_model = by_force(debounce=Debounce(min_duration=1.0))
        detector = Detector(hand_model, {"finger1": FLAT})
        assert pushes(detector, [150, 150, 50, np.nan, 50, 50]) == [
            UNKNOWN, STABLE, STABLE, UNKNOWN, UNKNOWN, UNSTABLE,
        ]  # fmt: skip

    def test_instability_is_held(self):
        hand_model = by_force(debounce=Debounce(hold=0.05))
        estimates = pushes(
            Detector(hand_model, {"finger1": FLAT}, RATE), [110] * 5 + [90] + [110] * 8
        )
        assert estimates[1:] == [STABLE] * 4 + [UNSTABLE] * 5 + [STABLE] * 4

    def test_hysteresis_moves_the_threshold_away(self):
        hand_model = by_force(debounce=Debounce(hysteresis=0.2))  # 0.3 and 0.7 are 91.5 and 108.5
        forces = [50, 50, 101, 108, 109, 101, 92, 91, 108]
        found = pushes(Detector(hand_model, {"finger1": FLAT}), forces)
        expected = [UNSTABLE] * 3 + [STABLE] * 3 + [UNSTABLE] * 2
        assert found[1:] == expected


HANDS = {
    "S": STABLE, "U": UNSTABLE, "-": NO_CONTACT,
    "SS": STABLE, "S-": NO_CONTACT, "--": NO_CONTACT, "SU": UNSTABLE, "S?": UNKNOWN,
    "U?": UNSTABLE, "SS-": STABLE, "SS-?": UNKNOWN, "S---": NO_CONTACT, "SSSS": STABLE,
}  # fmt: skip


@pytest.mark.parametrize(("fingers", "expected"), HANDS.items(), ids=HANDS)
def test_states_of_the_hand(fingers, expected):
    forces = {"S": 150.0, "U": 50.0, "-": 0.0}
    names = [f"finger{i + 1}" for i in range(len(fingers))]
    detector = Detector(by_force(), dict.fromkeys(names, FLAT))
    hand = {name: forces[kind] for name, kind in zip(names, fingers, strict=True) if kind != "?"}
    for k in range(3):
        samples = {name: flat(force, k) for name, force in hand.items()}
        estimate = detector.update(samples, k / RATE)
    assert estimate.state is expected


class TestEvents:
    def test_changes_in_order(self):
        detector = Detector(by_force(), {"a": FLAT, "b": FLAT})
        for k, (one, two) in enumerate([(150, 150), (150, 150), (50, 150), (150, 0)]):
            detector.update({"a": flat(one, k), "b": flat(two, k)}, float(k) / RATE)
        assert detector.events() == [
            ContactEvent("a", STABLE, UNKNOWN, 0.01),
            ContactEvent("b", STABLE, UNKNOWN, 0.01),
            ContactEvent(HAND, STABLE, UNKNOWN, 0.01),
            ContactEvent("a", UNSTABLE, STABLE, 0.02),
            ContactEvent(HAND, UNSTABLE, STABLE, 0.02),
            ContactEvent("a", STABLE, UNSTABLE, 0.03),
            ContactEvent("b", NO_CONTACT, STABLE, 0.03),
            ContactEvent(HAND, NO_CONTACT, UNSTABLE, 0.03),
        ]
        assert detector.events() == []

    def test_the_newest_are_kept(self):
        detector = Detector(by_force(), {"finger1": FLAT})
        pushes(detector, [150, 50] * 900)
        events = detector.events()
        assert len(events) == MAX_EVENTS
        assert events[-1].time == pytest.approx(1799 / RATE)


def test_reset_forgets_everything():
    detector, values = Detector(model()), lively()
    samples = [{"thumb": v, "index": v[::-1]} for v in values]
    one = [repr(detector.update(s, k / RATE)) for k, s in enumerate(samples)]
    events = detector.events()
    detector.update({"thumb": values[0]}, 50.0)
    detector.reset()
    assert [repr(detector.update(s, k / RATE)) for k, s in enumerate(samples)] == one
    assert detector.events() == events


REFUSED = {
    "unknown finger": ({"ring": np.zeros((2, 3))}, 1.0, "'ring'"),
    "after a known one": ({"thumb": np.zeros((2, 3)), "ring": np.zeros((2, 3))}, 1.0, "'ring'"),
    "taxels": ({"thumb": np.zeros((2, 3)), "index": np.zeros((3, 3))}, 1.0, "index"),
    "axes": ({"thumb": np.zeros((2, 2))}, 1.0, "thumb"),
    "list": ({"thumb": [1, 2, 3]}, 1.0, "thumb"),
    **{f"time {time}": ({}, time, f"time {time}") for time in (0.25, 0.49, np.nan, np.inf)},
}


@pytest.mark.parametrize(("samples", "time", "message"), REFUSED.values(), ids=REFUSED)
def test_a_refused_update_changes_nothing(samples, time, message):
    values = lively()
    one, two = Detector(model()), Detector(model())
    for k in range(100):
        if k == 50:
            with pytest.raises(StreamError, match=message):
                two.update(samples, time)
        given = {"index": values[k]} if k == 50 else {"thumb": values[k], "index": values[k]}
        assert repr(one.update(given, k / RATE)) == repr(two.update(given, k / RATE))
    assert one.events() == two.events()


def test_a_sample_is_not_aliased():
    values = lively()
    one, two = Detector(model(("thumb",))), Detector(model(("thumb",)))
    buffer = np.empty((2, 3))
    for k in range(100):
        buffer[:] = values[k]
        estimate = two.update({"thumb": buffer}, k / RATE)
        buffer[:] = np.nan
        assert repr(estimate) == repr(one.update({"thumb": values[k]}, k / RATE))
    assert (values == lively()).all()


def test_an_estimate_stays_as_it_was():
    detector, values = Detector(model(("thumb",))), lively()
    first = [detector.update({"thumb": values[k]}, k / RATE) for k in range(50)]
    kept = list(map(repr, first))
    for k in range(50, 100):
        detector.update({"thumb": values[k]}, k / RATE)
    assert list(map(repr, first)) == kept


def test_two_detectors_share_nothing():
    hand_model, values = model(("thumb",)), lively()
    alone = list(map(repr, feed(Detector(hand_model), values)))
    one, two = Detector(hand_model), Detector(hand_model)
    for k, sample in enumerate(values):
        assert repr(one.update({"thumb": sample}, k / RATE).fingers["thumb"]) == alone[k]
        two.update({"thumb": sample[::-1] + k}, k / RATE)


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, pickle.dumps])
def test_is_not_copied(how):
    with pytest.raises(TypeError, match="not copied"):
        how(Detector(model()))


@pytest.mark.slow
def test_memory_does_not_grow():
    detector, values = Detector(model(threshold=5.0)), lively(500)

    def stream(first, last):
        for k in range(first, last):
            detector.update({"thumb": values[k % 500], "index": values[-k % 500]}, k / RATE)

    stream(0, 20_000)  # the list of events is full
    blocks = sys.getallocatedblocks()
    stream(20_000, 220_000)
    assert sys.getallocatedblocks() - blocks < 1000
    tracemalloc.start()
    try:
        stream(220_000, 221_000)
        before = tracemalloc.get_traced_memory()[0]
        stream(221_000, 231_000)
        assert tracemalloc.get_traced_memory()[0] - before < 300_000
    finally:
        tracemalloc.stop()


class TestConstruction:
    def test_a_model_for_any_finger_needs_the_fingers(self):
        with pytest.raises(ModelError, match="fingers"):
            Detector(Model.load("builtin:noise-floor"))


class TestNoiseFloor:
    def noisy(self, level, n=1000):
        values = np.random.default_rng(5).normal(scale=level, size=(n, 2, 3))
        values[200:, :, 0] += 500 * level  # in contact
        values[600:700, :, 0] += 30 * level * np.random.default_rng(6).normal(size=(100, 2))
        return np.clip(30_000 + values, 1, 65_000)

    @pytest.mark.parametrize("level", [1.0, 5.0, 25.0])
    def test_stable_at_the_noise_and_unstable_in_bursts(self, level):
        which = sensor(limits=(0, 65_535))
        module = type(tactile())(which, np.arange(1000) / RATE, self.noisy(level))
        found = detect(Model.load("builtin:noise-floor"), recording(finger1=module))
        trace = found.fingers["finger1"]
        states = np.array([s.code for s in ContactState])[trace.state]
        quiet = np.r_[states[220:600], states[714:]]
        assert (states[64:200] == NO_CONTACT.code).mean() > 0.99
        assert (quiet == STABLE.code).mean() > 0.98
        assert (states[606:700] == UNSTABLE.code).all()

    @pytest.mark.parametrize("tare", ["2", "first", "none"])
    @pytest.mark.parametrize("level", [0.8, 3.0, 40.0, 900.0])
    def test_the_noise_is_that_of_a_force_component(self, level, tare):
        values = np.random.default_rng(7).normal(scale=level, size=(250, 1, 3))
        # half a second holds 50 samples only: 10 % is one and a half standard errors
        expected = pytest.approx(level, rel=0.1 if tare == "2" else 0.2)
        assert self.noise_of(values, FLAT, tare) == expected

    def test_the_noise_in_counts_is_at_least_that_of_the_step(self):
        values = np.full((40, 2, 3), 500.0)
        values[35:, 0, 0] += [0, 9, 0, 0, 4]
        assert self.noise_of(values, sensor(), "0.2") == pytest.approx(np.sqrt(2 / 12))

    def noise_of(self, values, which, tare):
        """Return the noise by which the feature `noise` divides, over a window of 4 samples."""
        specs = (FeatureSpec("sigma", 4), FeatureSpec("sigma", 4, "noise"))
        plan = StreamPlan({"f": which}, {"f": specs}, 4, Tare.parse(tare), RATE)
        module = type(tactile())(which, np.arange(len(values)) / RATE, values)
        sigma, ratio = extract(plan, recording(f=module))["f"].features[-1]
        # the details of noise have its variance, and N_w / 2 - 1 of N_w degrees of freedom
        return sigma / np.exp(ratio) / np.sqrt((4 / 2 - 1) / 4)


class TestBaselines:
    def test_of_fingers_whose_tare_is_complete_and_a_copy(self):
        detector, values = Detector(model()), lively(40)
        feed(detector, values[:N_TARE])
        assert detector.baselines() == {}
        feed(detector, values[N_TARE:], start=N_TARE / RATE)
        found = detector.baselines()
        assert list(found) == ["thumb"]
        assert np.allclose(found["thumb"], values[:N_TARE].mean(axis=0))
        found["thumb"][:] = 0.0
        assert detector.baselines()["thumb"].any()

    def test_fingers_of_the_model_count(self):
        assert Detector(model()).n_fingers == 2


class TestThresholds:
    def test_a_changed_threshold_acts_as_that_of_another_model(self):
        changed, forces = Detector(by_force(), {"f": FLAT}), np.linspace(20.0, 200.0, 60)
        changed.set_thresholds({"f": 0.95})
        states = pushes(changed, forces, "f")
        assert states == pushes(Detector(by_force(0.95), {"f": FLAT}), forces, "f")
        assert states != pushes(Detector(by_force(), {"f": FLAT}), forces, "f")
        changed.reset()  # keeps the thresholds
        assert states == pushes(changed, forces, "f")

    def test_another_finger_keeps_its_threshold(self):
        detector = Detector(by_force(), {"f": FLAT, "g": FLAT})
        detector.set_thresholds({"f": 0.95})
        for k in range(10):
            sample = flat(110.0, k)
            estimate = detector.update({"f": sample, "g": sample}, k / RATE)
        assert estimate.fingers["f"].state is UNSTABLE
        assert estimate.fingers["g"].state is STABLE

    @pytest.mark.parametrize("value", [-0.1, 1.1, float("nan")])
    def test_thresholds_outside_of_0_to_1_are_refused(self, value):
        with pytest.raises(ValueError, match="threshold"):
            Detector(model()).set_thresholds({"thumb": value, "index": value})


@pytest.mark.parametrize(
    "sample", [np.full((16, 3), "x", dtype=object), np.full((16, 3), 10**400, dtype=object),
               np.full((16, 3), {}, dtype=object), [[1, 2], [3]]],
)  # fmt: skip
def test_what_is_no_number_is_an_error_of_the_stream(sample):
    detector = Detector(Model.load("builtin:noise-floor"), {"index": built_in("uskin-4x4")})
    with pytest.raises(StreamError, match="index"):
        detector.update({"index": sample}, 0.0)
