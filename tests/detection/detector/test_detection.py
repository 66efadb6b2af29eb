"""Offline is live: `detect` and `run` equal `update` sample by sample, in every field."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from holdfast.contact import SLIP_CODE, ContactState, Reason
from holdfast.demo_data import BOX_SLIPS
from holdfast.detection import Debounce, Detector, Model, detect, fingertip_force
from holdfast.errors import ModelError, StreamError
from holdfast.io import load_recording
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_truth import SlipDecisions
from holdfast.recordings import Recording
from holdfast.resampling import resample
from holdfast.synthetic import synthetic_recording

from .build import (
    RATE,
    RICH,
    SLIP_OWN,
    TAXELS,
    broken,
    model,
    recording,
    sensor,
    tactile,
)

STATES = tuple(ContactState)


def feed(detector, made):
    """Every estimate of `update`, fed with the samples of a recording in order of time."""
    modules = {n: m for n, m in made.modules.items() if n != "palm/1"}
    for time in np.unique(np.concatenate([m.times for m in modules.values()])):
        samples = {}
        for name, module in modules.items():
            for k in np.flatnonzero(module.times == time):
                samples[name] = module.readings[k]
        yield set(samples), detector.update(samples, time)


def fields(estimate):
    numbers = (estimate.time, estimate.stable_probability, estimate.instability, *estimate.force)
    codes = (estimate.state, estimate.reason, estimate.faults, estimate.faulty_taxels)
    codes += (estimate.cause, estimate.slip_probability)
    codes += (estimate.slip_speed, estimate.slip_distance)
    return repr((*numbers, *codes))


def assert_same(detection, estimates):
    rows = dict.fromkeys(detection.fingers, 0)
    for k, (present, estimate) in enumerate(estimates):
        assert estimate.time == detection.times[k]
        assert estimate.state is STATES[detection.hand[k]]
        for finger in present:
            one = detection.fingers[finger].estimate(rows[finger])
            assert fields(estimate.fingers[finger]) == fields(one)
            rows[finger] += 1
    assert rows == {finger: len(trace) for finger, trace in detection.fingers.items()}
    assert len(detection.times) == len(estimates)


CLOCKS = {
    "one clock": {"thumb": tactile(seed=1), "index": tactile(seed=2)},
    "shifted": {"thumb": tactile(seed=1), "index": tactile(seed=2, start=0.0031)},
    "two rates": {"thumb": tactile(seed=1), "index": tactile(150, seed=2, rate=71.0)},
    "late": {"thumb": tactile(seed=1), "index": tactile(100, seed=2, start=0.9)},
    "short": {"thumb": tactile(seed=1), "index": tactile(1, seed=2)},
    "one missing": {"index": tactile(seed=2)},
    "one more": {n: tactile(seed=i) for i, n in enumerate(("index", "palm/1", "thumb"))},
    "broken": {"thumb": broken(tactile(seed=1)), "index": broken(tactile(seed=2, start=0.0031))},
    "since 1970": {n: tactile(seed=i, start=1.7e9) for i, n in enumerate(("thumb", "index"))},
}


@pytest.mark.parametrize("tare", ["0.2", "first", "none"])
@pytest.mark.parametrize("clock", CLOCKS)
def test_detect_equals_update(clock, tare):
    made = recording(**CLOCKS[clock])
    hand_model = model(features=RICH, tare=tare, threshold=20.0, debounce=Debounce(0.02, 0.05))
    assert_same(detect(hand_model, made), list(feed(Detector(hand_model), made)))


def test_detect_equals_update_over_many_chunks():
    made = recording(thumb=tactile(5000, seed=1), index=tactile(4000, seed=2, rate=71.0))
    hand_model = model()
    assert_same(detect(hand_model, made), list(feed(Detector(hand_model), made)))


@pytest.mark.parametrize("kind", [np.int16, np.uint16, np.float32, np.float64])
def test_readings_of_any_type(kind):
    module = tactile(120, seed=3)
    made = recording(thumb=type(module)(module.sensor, module.times, module.readings.astype(kind)))
    hand_model = model(("thumb",))
    assert_same(detect(hand_model, made), list(feed(Detector(hand_model), made)))


@given(cuts=st.lists(st.integers(1, 260), max_size=5), clock=st.sampled_from(sorted(CLOCKS)))
@settings(max_examples=40)
def test_any_pieces_give_the_same(cuts, clock):
    made = recording(**CLOCKS[clock])
    hand_model = model(features=RICH, threshold=20.0)
    whole = detect(hand_model, made)
    detector = Detector(hand_model)
    bounds = [
        -np.inf,
        *sorted({float(whole.times[c]) for c in cuts if c < len(whole.times)}),
        np.inf,
    ]
    pieces = []
    for start, stop in pairwise(bounds):
        part = {
            n: m.slice(*np.searchsorted(m.times, (start, stop))) for n, m in made.modules.items()
        }
        if any(m.n_samples for n, m in part.items() if n in hand_model.fingers):
            pieces.append(detector.run(Recording("piece", part)))
    assert np.array_equal(np.concatenate([p.hand for p in pieces]), whole.hand)
    for finger, trace in whole.fingers.items():
        parts = [p.fingers[finger] for p in pieces if finger in p.fingers]
        for found, expected in zip(zip(*parts, strict=True), trace, strict=True):
            if expected is None:  # no slip rule
                assert set(found) == {None}
                continue
            assert np.array_equal(np.concatenate(found), expected, equal_nan=True)


@given(cuts=st.lists(st.integers(1, 199), min_size=1, max_size=4, unique=True))
@settings(max_examples=25)
def test_run_and_update_take_turns(cuts):
    made = recording(**CLOCKS["broken"])
    hand_model = model(threshold=20.0)
    whole = Detector(hand_model)
    estimates = [(e.time, e.state) for _, e in feed(whole, made)]
    mixed = Detector(hand_model)
    bounds = [-np.inf, *(estimates[c][0] for c in sorted(cuts)), np.inf]
    for i, (start, stop) in enumerate(pairwise(bounds)):
        part = {
            n: m.slice(*np.searchsorted(m.times, (start, stop))) for n, m in made.modules.items()
        }
        if i % 2 and any(m.n_samples for m in part.values()):
            mixed.run(Recording("piece", part))
        elif any(m.n_samples for m in part.values()):
            list(feed(mixed, Recording("piece", part)))
    assert mixed.events() == whole.events()


def test_a_recording_at_another_rate_is_resampled():
    made = recording(thumb=tactile(400, seed=1, rate=250.0), index=tactile(400, seed=2, rate=250.0))
    hand_model = model()
    found = detect(hand_model, made)
    assert_same(found, list(feed(Detector(hand_model), resample(made, RATE))))
    assert len(found.times) == pytest.approx(160, abs=1)


@pytest.mark.parametrize("rate", [84.0, 118.0])
def test_a_recording_near_the_rate_is_taken_as_it_is(rate):
    made = recording(thumb=tactile(seed=1, rate=rate), index=tactile(seed=2, rate=rate))
    assert np.array_equal(detect(model(), made).times, made.modules["thumb"].times)


def test_the_future_changes_nothing():
    made = recording(**CLOCKS["shifted"])
    modules = {}
    for name, module in made.modules.items():
        values = np.array(module.readings)
        values[130:] = 990 - values[130:]
        modules[name] = type(module)(module.sensor, module.times, values)
    hand_model = model(features=RICH, threshold=20.0, slips=("thumb", "index"))
    one, two = detect(hand_model, made), detect(hand_model, recording(**modules))
    assert np.array_equal(one.hand[:260], two.hand[:260])
    for finger, trace in one.fingers.items():
        for found, other in zip(trace, two.fingers[finger], strict=True):
            if found is not None:  # no slip rule
                assert np.array_equal(found[:130], other[:130], equal_nan=True)


@pytest.mark.parametrize("start", [0.0, 0.3, 1e9, 1.7e9])
def test_a_shift_of_time_changes_nothing(start):
    hand_model = model(("thumb",), threshold=20.0, slips=("thumb",), speeds=("thumb",))
    plain = detect(hand_model, recording(thumb=tactile(seed=4))).fingers["thumb"]
    moved = detect(hand_model, recording(thumb=tactile(seed=4, start=start))).fingers["thumb"]
    for found, expected in zip(moved[1:-1], plain[1:-1], strict=True):
        assert np.array_equal(found, expected, equal_nan=True)
    assert plain.slip_speed is not None and np.nanmax(plain.slip_distance) > 0
    # Its steps of time are rounded.
    np.testing.assert_allclose(moved.slip_distance, plain.slip_distance, rtol=1e-4)


class TestSlip:
    """The slip rule: live equals batch, and both equal the rule over arrays."""

    @pytest.mark.parametrize(
        "options",
        [
            {"slips": ("thumb", "index")},
            {"slips": ("thumb",)},
            {"slips": ()},
            {"slips": ("index",), "own": SLIP_OWN},
            {"slips": ("index",), "own": TAXELS},
            {"slips": ("thumb", "index"), "own": TAXELS, "speeds": ("thumb", "index")},
            {"slips": ("thumb", "index"), "own": TAXELS, "speeds": ("thumb",)},
        ],
        ids=["both", "one", "none", "force", "taxels", "speeds", "a speed"],
    )
    @pytest.mark.parametrize("clock", CLOCKS)
    def test_detect_equals_update(self, clock, options):
        made = recording(**CLOCKS[clock])
        hand_model = model(features=RICH, threshold=20.0, **options)
        found = detect(hand_model, made)
        assert_same(found, list(feed(Detector(hand_model), made)))
        for name, trace in found.fingers.items():
            assert (trace.slip_probability is None) == (name not in options["slips"])
            assert (trace.slip_speed is None) == (trace.slip_distance is None)
            assert (trace.slip_speed is None) == (name not in options.get("speeds", ()))
        if clock == "one clock" and "own" in options:
            assert np.nanstd(found.fingers["index"].slip_probability) > 0.01

    @pytest.mark.parametrize(("threshold", "is_raised"), [(0.999, True), (1.0, False)])
    def test_a_threshold_of_1_is_never_reached(self, threshold, is_raised):
        """Also not by a probability that is rounded to 1."""
        hand_model = model(slips=("thumb",), own=TAXELS)
        head = hand_model.fingers["thumb"].slip
        sure = replace(head, rule=replace(head.rule, intercepts=(1e4,)), threshold=threshold)
        hand_model = hand_model.changed(lambda part: part.with_heads(sure) if part.slip else part)
        trace = detect(hand_model, recording(**CLOCKS["one clock"])).fingers["thumb"]
        assert (trace.slip_probability == 1).any()
        assert (trace.cause == SLIP_CODE).any() == is_raised == hand_model.reports_slips
        decisions = SlipDecisions(
            trace.times, trace.slip_probability, trace.cause == SLIP_CODE, head.hold, None
        )
        assert (decisions.raised_at(np.array([threshold]))[0] == decisions.raised).all()

    @pytest.mark.parametrize("clock", ["one clock", "two rates", "since 1970", "broken"])
    def test_distance_is_the_sum_of_the_speed(self, clock):
        """Both are 0 while the finger does not slide, and NaN while UNKNOWN."""
        made, slips = recording(**CLOCKS[clock]), ("thumb", "index")
        hand_model = model(threshold=20.0, slips=slips, speeds=slips)
        n_slides, speeds = 0, set()
        for trace in detect(hand_model, made).fingers.values():
            slides, unknown = trace.cause == SLIP_CODE, trace.state == 0
            assert np.isnan(trace.slip_speed[unknown]).all()
            assert not np.isnan(trace.slip_speed[~unknown]).any()
            assert (trace.slip_speed[~slides & ~unknown] == 0).all()
            speeds.update(trace.slip_speed[slides].tolist())
            steps = np.diff(trace.times, prepend=np.nan)
            steps[np.flatnonzero(slides & ~np.roll(slides, 1))] = 1 / RATE
            for start, end in runs(slides):
                slid = np.cumsum((trace.slip_speed * steps)[start:end])
                np.testing.assert_allclose(trace.slip_distance[start:end], slid, rtol=1e-9)
                n_slides += 1
            assert (trace.slip_distance[~slides & ~unknown] == 0).all()
        assert n_slides > 1
        assert min(speeds) >= 0 and max(speeds) == 3 and len(speeds) > 10

    @pytest.mark.parametrize("clock", ["one clock", "two rates", "since 1970", "broken"])
    def test_the_decision_is_that_of_raised_at(self, clock):
        made = recording(**CLOCKS[clock])
        hand_model = model(threshold=20.0, slips=("thumb", "index"))
        n_raised = 0
        for name, trace in detect(hand_model, made).fingers.items():
            head = hand_model.finger(name).slip
            found = trace.cause == SLIP_CODE
            made = SlipDecisions(trace.times, trace.slip_probability, found, head.hold, None)
            (expected,) = made.raised_at(np.array([head.threshold]))
            assert np.array_equal(found, expected)
            n_raised += found.sum()
        assert n_raised

    def test_unloading_ends_a_slip_at_once(self):
        """Also within the hold time."""
        module = tactile(seed=1)
        values = np.array(module.readings)
        values[140:160] = values[:20]  # as during the tare
        made = recording(thumb=type(module)(module.sensor, module.times, values))
        hand_model = model(("thumb",), threshold=20.0, slips=("thumb",))
        sure = with_slip(hand_model, hold=10.0, threshold=1e-9)
        trace = detect(sure, made).fingers["thumb"]
        slides = trace.cause == SLIP_CODE
        assert slides[144] and slides[165]
        empty = trace.slip_probability == 0
        assert empty[141:160].any()
        assert not slides[empty].any()


def with_slip(hand_model, **fields):
    return hand_model.changed(lambda part: part.with_heads(replace(part.slip, **fields)))


class TestIntervalTare:
    def test_equals_the_batch_functions(self):
        made = recording(thumb=tactile(seed=1), index=tactile(seed=2, start=0.003))
        found = detect(model(tare="0.5:0.9"), made)
        for name, module in made.modules.items():
            expected = fingertip_force(module.readings, module.sensor, (0.5, 0.9), module.times)
            assert np.array_equal(found.fingers[name].force, expected)

    def test_is_refused_live(self):
        with pytest.raises(ModelError, match=r"0.5:0.9"):
            Detector(model(tare="0.5:0.9"))

    def test_without_samples_is_refused(self):
        with pytest.raises(ValueError, match=r"index of 'made'.* 7:9"):
            detect(model(tare="7:9"), recording(index=tactile(seed=2)))


class TestRefusals:
    def test_none_of_the_fingers(self):
        with pytest.raises(ModelError, match="ring"):
            detect(model(), recording(ring=tactile()))

    def test_run_with_none_of_the_fingers(self):
        with pytest.raises(StreamError, match="ring"):
            Detector(model()).run(recording(ring=tactile()))

    def test_run_with_other_taxels(self):
        with pytest.raises(StreamError, match=r"index: .*\(1, 3\)"):
            Detector(model()).run(recording(index=tactile(which=sensor(1, "small"))))

    def test_run_that_goes_back(self):
        detector = Detector(model())
        detector.run(recording(index=tactile(20, start=1.0)))
        with pytest.raises(StreamError, match=r"1.1 s"):
            detector.run(recording(index=tactile(20, start=1.1)))


def test_unstable_beside_a_high_probability_says_why():
    """The load of a real box comes and goes; the hold time passes after a shake."""
    made = Model.load("builtin:any")
    made = replace(made, debounce=replace(made.debounce, hold=1.0))
    reasons = set()
    for one in (load_recording(BOX_SLIPS), synthetic_recording("shaken", 0, ("index", "thumb"))):
        for finger, trace in detect(made, one).fingers.items():
            threshold = made.finger(finger, one.modules[finger].sensor).stable.threshold
            for estimate in trace.estimates():
                unstable = estimate.state is ContactState.UNSTABLE
                if unstable and estimate.stable_probability >= threshold:
                    assert estimate.reason in (Reason.LOAD, Reason.HOLD)
                if estimate.reason in (Reason.LOAD, Reason.HOLD):
                    assert unstable
                    reasons.add(estimate.reason)
                if estimate.reason is Reason.HOLD:
                    assert estimate.stable_probability >= threshold
    assert reasons == {Reason.LOAD, Reason.HOLD}
