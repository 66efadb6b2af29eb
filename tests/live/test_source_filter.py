import numpy as np
import pytest

from holdfast.contact import ContactState, Fault
from holdfast.detection import Model
from holdfast.devices.sources.base import Arrival
from holdfast.live.source_filter import RateMonitor
from holdfast.live.stream_detector import StreamDetector
from holdfast.sensors import sensor

from . import build

RATE = 150.0
FINGERS = ("thumb", "index")


def times_at(*parts):
    """Times of samples, given (rate, seconds) of each part."""
    steps = [np.full(round(rate * seconds), 1 / rate) for rate, seconds in parts]
    return np.cumsum(np.concatenate(steps))


def first_change(times, rate=RATE):
    """When a monitor reports another rate, and its notices."""
    monitor = RateMonitor(rate, FINGERS)
    notices, changed = [], []
    for time in times.tolist():
        notices += monitor.update(dict.fromkeys(FINGERS), time)
        if monitor.changed:
            changed.append(time)
    return changed[0] if changed else None, notices


@pytest.mark.parametrize("rate", [30.0, 100.0, 150.0, 1000.0])
@pytest.mark.parametrize("factor", [1 / 3, 0.5, 0.7, 1.5, 3.0])
def test_another_rate_is_reported_within_a_second(rate, factor):
    found, notices = first_change(times_at((rate, 2.0), (factor * rate, 3.0)), rate)
    assert 2.0 < found < 3.05
    (notice,) = notices
    assert f"{rate:.3g} at the start" in notice


@pytest.mark.parametrize("factor", [0.85, 1.0, 1.15])
def test_nearly_the_same_rate_is_not_reported(factor):
    assert first_change(times_at((RATE, 2.0), (factor * RATE, 5.0))) == (None, [])


def test_jitter_pauses_and_single_losses_are_not_reported():
    generator = np.random.default_rng(0)
    times = times_at((RATE, 20.0))
    times = np.sort(times + generator.uniform(-0.4, 0.4, len(times)) / RATE)
    times = times[generator.random(len(times)) > 0.05]  # every 20th packet is lost
    times[times > 5] += 3.0  # a pause
    assert first_change(times) == (None, [])


def test_the_rate_may_return():
    monitor = RateMonitor(RATE, FINGERS)
    for time in times_at((RATE, 1.0), (50.0, 1.0)).tolist():
        monitor.update({"thumb": None}, time)
    assert monitor.changed == {"thumb"}
    for time in (2.0 + times_at((RATE, 1.0))).tolist():
        monitor.update({"thumb": None}, time)
    assert monitor.changed == set()


def test_no_finger_is_stable_once_the_rate_fell():
    recording = build.grasp()
    source = build.Script.of(recording)
    source.is_device = True
    detector = StreamDetector(build.model(), source)
    arrivals = build.arrivals_of(recording)
    for arrival in arrivals[:700]:
        assert detector.update(arrival).arrival.notices == ()
    begin, after, notices = arrivals[700].time, [], []
    for k, arrival in enumerate(arrivals[700:850]):
        slow = arrival._replace(time=begin + k / 50)
        update = detector.update(slow)
        after += [one.estimate for one in update.estimates if k > 50]
        notices += update.arrival.notices
    assert len(notices) == 1
    assert {one.state for one in after} == {ContactState.UNKNOWN}
    assert all(Fault.RATE in finger.faults for one in after for finger in one.fingers.values())


def test_a_recording_is_not_watched():
    detector = StreamDetector(build.model(), build.Script.of(build.grasp()))
    for k, arrival in enumerate(build.arrivals_of(build.grasp())[:400]):
        update = detector.update(arrival._replace(time=k / (150 if k < 200 else 50)))
        assert update.arrival.notices == ()
    assert Fault.RATE not in update.estimates[-1].estimate.fingers["thumb"].faults


def monitored(readings, rate=100.0):
    """Return for each row whether the stream detector reports the fault `slow`."""
    skin = sensor("uskin-4x4")
    detector = StreamDetector(Model.load("builtin:any"), build.Script({"thumb": skin}))
    found = []
    for k, sample in enumerate(readings):
        update = detector.update(Arrival(k / rate, {"thumb": sample}, k / rate))
        for one in update.estimates:
            thumb = one.estimate.fingers["thumb"]
            assert Fault.SLOW not in thumb.faults or thumb.state is ContactState.UNKNOWN
            found.append(Fault.SLOW in thumb.faults)
    return np.array(found)


def noisy(n):
    return np.rint(30_000 + np.random.default_rng(0).normal(scale=3, size=(n, 16, 3)))


@pytest.mark.parametrize(("rate", "n_rows"), [(100, 10), (150, 15), (100, 20), (150, 30)])
@pytest.mark.parametrize("between", ["copies", "zeros", "late"])
def test_a_finger_that_updates_too_slowly_is_slow(rate, n_rows, between):
    readings = np.repeat(noisy(40), n_rows, axis=0)
    if between == "zeros":
        readings[np.arange(len(readings)) % n_rows != 0] = 0
    if between == "late":  # every other update comes two rows later
        late = np.arange(len(readings)) // n_rows % 2 * (np.arange(len(readings)) % n_rows < 2)
        readings = readings[np.arange(len(readings)) - 2 * late]
    found = monitored(readings, rate)
    assert found[10 * n_rows :].all()


@pytest.mark.parametrize("n_rows", [1, 2, 3])
def test_a_finger_that_updates_at_thirty_hertz_or_more_is_not_slow(n_rows):
    assert not monitored(np.repeat(noisy(600 // n_rows), n_rows, axis=0)).any()


def test_a_coarse_finger_at_rest_is_not_slow():
    changed = np.random.default_rng(1).random((6000, 16, 3)) < 0.05 / 48
    assert not monitored(30_000.0 + changed.cumsum(axis=0)).any()
