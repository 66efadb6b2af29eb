import math
import time
from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import ContactState, Fault, Reason
from holdfast.detection import Detector, detect
from holdfast.errors import StreamError
from holdfast.live.source_filter import MAX_BUFFERED_ARRIVALS
from holdfast.live.stream_detector import StreamDetector
from holdfast.recordings import Recording
from holdfast.resampling import resample

from . import build

pytestmark = pytest.mark.slow


def detected(recording, model=None, steps=None, **options):
    source = build.Script.of(recording, steps)
    detector = StreamDetector(model or build.model(), source, **options)
    estimates = [one for arrival in source for one in detector.update(arrival).estimates]
    return detector, estimates + detector.finish().estimates


def slower(factor):
    modules = build.grasp().modules.items()
    return Recording("slow", {k: replace(m, times=m.times * factor) for k, m in modules})


def check_equal(estimates, expected):
    for name, trace in expected.fingers.items():
        mine = [d.estimate.fingers[name] for d in estimates if name in d.updated_fingers]
        assert len(mine) == len(trace)
        assert all(build.same(one, trace.estimate(k)) for k, one in enumerate(mine))
    assert [d.estimate.state.code for d in estimates] == expected.hand.tolist()


def test_estimates_are_those_of_the_recording_sample_by_sample():
    recording = build.grasp()
    _, estimates = detected(recording)
    check_equal(estimates, detect(build.model(), recording))
    assert {d.estimate.state for d in estimates} == set(ContactState)


def test_a_source_of_another_rate_is_resampled_as_the_recording_is():
    slow = slower(2.5)
    detector, estimates = detected(slow)
    assert detector.resampled
    expected = detect(build.model(), resample(slow, 150.0))
    for name, trace in expected.fingers.items():
        mine = [d.estimate.fingers[name] for d in estimates if name in d.updated_fingers]
        n = min(len(mine), len(trace))  # the last sample may wait for one that never comes
        assert abs(len(mine) - len(trace)) <= 1
        states = np.array([one.state.code for one in mine[:n]])
        assert (states == trace.state[:n]).mean() > 0.999
        forces = np.array([one.force for one in mine[:n]])
        np.testing.assert_allclose(forces, trace.force[:n], rtol=1e-6, atol=1e-6)


def test_arrivals_are_buffered_until_the_rate_is_known():
    arrivals = build.arrivals_of(build.grasp())
    detector = StreamDetector(build.model(), build.Script.of(build.grasp()))
    found = [detector.update(arrival).estimates for arrival in arrivals[:80]]
    first = next(k for k, estimates in enumerate(found) if estimates)
    assert 70 <= first <= 76
    assert len(found[first]) == first + 1
    assert detector.rate == pytest.approx(150.0)


def test_a_fault_of_the_transport_makes_its_finger_unknown_until_the_next_sample():
    recording = build.grasp()
    steps = build.arrivals_of(recording)
    k = 500
    thumbless = {n: s for n, s in steps[k].samples.items() if n != "thumb"}
    steps[k] = steps[k]._replace(samples=thumbless, faults={"thumb": (Fault.TAXEL_COUNT,)})
    steps.insert(k + 1, build.notice_arrival("odd", index=[Fault.LATE]))
    _, estimates = detected(recording, steps=steps)
    before, at, reported, after = (estimates[i].estimate for i in (k - 1, k, k + 1, k + 2))
    assert before.fingers["thumb"].state is not ContactState.UNKNOWN
    assert at.fingers["thumb"].state is ContactState.UNKNOWN
    assert at.fingers["thumb"].faults == (Fault.TAXEL_COUNT,)
    assert at.fingers["index"].faults == ()
    assert reported.fingers["index"].state is ContactState.UNKNOWN
    assert reported.fingers["index"].reason is Reason.FAULT
    assert np.isnan(reported.fingers["index"].stable_probability)
    assert estimates[k + 1].updated_fingers == ("index",)
    assert all(finger.faults == () for finger in after.fingers.values())


def test_in_silence_every_finger_is_unknown_until_the_next_sample():
    arrivals = build.arrivals_of(build.grasp())
    detector = StreamDetector(build.model(), build.Script.of(build.grasp()))
    assert detector.update(None, silent=True).estimates == []
    for arrival in arrivals[:500]:
        detector.update(arrival)
    (one,) = detector.update(None, silent=True).estimates
    assert one.updated_fingers == build.FINGERS
    for finger in one.estimate.fingers.values():
        assert (finger.state, finger.reason) == (ContactState.UNKNOWN, Reason.GAP)
        assert finger.faults == (Fault.PACKET_GAP,)
    (odd,) = detector.update(build.notice_arrival("odd", thumb=[Fault.TAXEL_COUNT])).estimates
    for estimate in (one.estimate, odd.estimate):  # a notice does not end the silence
        assert estimate.state is ContactState.UNKNOWN
        assert {finger.state for finger in estimate.fingers.values()} == {ContactState.UNKNOWN}
    (back,) = detector.update(arrivals[500]).estimates
    assert all(finger.faults == () for finger in back.estimate.fingers.values())


def test_a_missing_finger_becomes_unknown_once_while_the_others_go_on():
    recording = build.grasp()
    detector = StreamDetector(build.model(), build.Script.of(recording))
    estimates = []
    for k, arrival in enumerate(build.arrivals_of(recording)[:600]):
        there = {n: s for n, s in arrival.samples.items() if k < 500 or n != "thumb"}
        estimates += detector.update(arrival._replace(samples=there)).estimates
    lost = [d for d in estimates[500:] if "thumb" in d.updated_fingers]
    assert len(lost) == 1
    thumb = lost[0].estimate.fingers["thumb"]
    assert (thumb.state, thumb.reason) == (ContactState.UNKNOWN, Reason.GAP)


def test_the_buffer_before_the_rate_is_known_is_bounded():
    recording = build.grasp()
    detector = StreamDetector(build.model(), build.Script.of(recording))
    first, *_ = build.arrivals_of(recording)
    for k in range(3):
        for _ in range(MAX_BUFFERED_ARRIVALS):
            odd = build.notice_arrival("odd", thumb=[Fault.TAXEL_COUNT])
            assert detector.update(odd).estimates == []
        detector.update(first._replace(time=0.01 * k))
    assert len(detector._filter._buffer) == 6
    stuck = build.arrivals_of(recording)[: MAX_BUFFERED_ARRIVALS // 8]
    for one in stuck:  # the clock of the device hardly moves
        detector.update(one._replace(time=0.03 + one.time * 1e-6))
    assert len(detector._filter._buffer) == 6 + len(stuck)
    assert detector._filter._buffer.maxlen == MAX_BUFFERED_ARRIVALS


def test_silence_is_longer_for_slow_sources():
    recording = build.grasp()
    detector = StreamDetector(build.model(), build.Script.of(recording))
    assert detector.silence_timeout == 0.1
    for arrival in build.arrivals_of(recording)[:200]:
        detector.update(arrival._replace(time=20 * arrival.time))
    assert detector.silence_timeout == pytest.approx(0.4, rel=0.01)


def test_a_tare_in_contact_is_refused_and_one_without_contact_restarts():
    recording = build.grasp()
    detector = StreamDetector(build.model(), build.Script.of(recording))
    detector.restart_tare()
    arrivals = build.arrivals_of(recording)
    for arrival in arrivals[:200]:
        detector.update(arrival)
    detector.restart_tare()
    thumb = detector.update(arrivals[200]).estimates[-1].estimate.fingers["thumb"]
    assert (thumb.state, thumb.reason) == (ContactState.UNKNOWN, Reason.TARE)
    for arrival in arrivals[201:600]:
        detector.update(arrival)
    with pytest.raises(StreamError, match=r"^thumb, index, middle in contact"):
        detector.restart_tare()


def test_tared_readings_begin_at_zero():
    recording = build.grasp()
    detector = StreamDetector(build.model(), build.Script.of(recording))
    arrivals = build.arrivals_of(recording)
    assert detector.subtract_tare(arrivals[0].samples) == {}
    for arrival in arrivals[:120]:
        detector.update(arrival)
    tared = detector.subtract_tare(arrivals[120].samples)
    assert set(tared) == set(build.FINGERS)
    assert all(np.abs(values).max() < 10 for values in tared.values())


class NoticesOnly(build.Script):
    """Sends arrivals without samples, without end and without a pause."""

    paced = True

    def read(self, timeout):
        if self.steps:
            return super().read(timeout)
        time.sleep(0.001)
        return build.notice_arrival("invalid packet")


def read_times(source, n):
    stream = StreamDetector(build.model(), source)
    return stream, [stream.read() for _ in range(n)]


def test_a_source_without_samples_is_silent():
    recording = build.grasp()
    source = NoticesOnly.of(recording, build.arrivals_of(recording)[:500], patient=True)
    stream, _ = read_times(source, 500)
    assert not stream.silent
    found = []
    build.wait_for(lambda: found.extend(stream.read().estimates) or stream.silent)
    (silence,) = found
    assert {one.state for one in silence.estimate.fingers.values()} == {ContactState.UNKNOWN}
    assert stream.read().estimates == []


def test_a_source_that_is_not_paced_is_not_silent_because_its_reader_is_slow():
    arrivals = build.arrivals_of(build.grasp())
    steps = [*arrivals[:500], build.notice_arrival("a marker"), arrivals[500]]
    stream, _ = read_times(build.Script.of(build.grasp(), steps), 500)
    time.sleep(1.5 * stream.silence_timeout)  # not to be waited for: it is the slow reader
    assert stream.read().estimates == []
    assert not stream.silent


def test_in_slow_motion_silence_is_longer():
    asked = []

    class Slow(build.Script):
        speed = 0.1

        def read(self, timeout):
            asked.append(timeout)
            return super().read(0.0)

    stream, _ = read_times(Slow.of(build.grasp()), 1)
    assert asked == [10 * stream.silence_timeout]


def with_palm(recording):
    """The arrivals of a recording whose source has a module that no model uses."""
    palm = replace(next(iter(recording.modules.values())))
    more = Recording(recording.name, {**recording.modules, "palm/1": palm})
    return build.Script.of(more)


def test_iterating_ignores_the_modules_that_no_model_uses():
    stream = StreamDetector(build.model(), with_palm(build.grasp()))
    assert math.isnan(stream.start)
    estimates = list(stream)
    assert stream.start == estimates[0].time < estimates[-1].time
    expected = detect(build.model(), build.grasp())
    assert [one.state.code for one in estimates] == expected.hand.tolist()
    assert {name for one in estimates for name in one.fingers} == set(build.FINGERS)


def test_samples_of_unused_modules_do_not_end_the_silence():
    arrivals = build.arrivals_of(build.grasp())
    palm = arrivals[500]._replace(samples={"palm/1": arrivals[500].samples["thumb"]})
    steps = [*arrivals[:500], None, palm, arrivals[501]]
    stream, _ = read_times(build.Script.of(build.grasp(), steps, patient=True), 502)
    assert stream.silent
    stream.read()
    assert not stream.silent


def test_a_detector_fed_without_it_refuses_unused_modules_and_does_not_resample():
    slow = slower(2.5)
    source = with_palm(slow)
    detector = Detector(build.model(), StreamDetector(build.model(), source).fingers)
    with pytest.raises(StreamError, match=r"^finger 'palm/1' given"):
        for arrival in source:
            detector.update(arrival.samples, arrival.time)
    n_instants = slow.modules["thumb"].n_samples
    stream = StreamDetector(build.model(), with_palm(slow))
    times = [estimate.time for estimate in stream]
    assert stream.resampled
    assert stream.rate == pytest.approx(60.0)
    assert np.median(np.diff(times)) == pytest.approx(1 / 150)
    assert len(times) > 2 * n_instants


def test_changes_that_lasted_are_fewer_than_changes():
    every = list(StreamDetector(build.model(), build.Script.of(build.grasp())).changes(0.0))
    lasted = list(StreamDetector(build.model(), build.Script.of(build.grasp())).changes(0.3))
    assert {event.finger for event in every} == {*build.FINGERS, "hand"}
    assert 0 < len(lasted) < len(every)
    assert {(e.finger, e.state, e.time) for e in lasted} <= {
        (e.finger, e.state, e.time) for e in every
    }
    with pytest.raises(ValueError, match="at least 0 s expected"):
        next(StreamDetector(build.model(), build.Script.of(build.grasp())).changes(-1.0))
