import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import Fault
from holdfast.devices.sources.timeline import (
    ArrivalClock,
    Timeline,
    clock_notice,
)

PERIOD = 1 / 150


def stamps(pairs):
    timeline = Timeline()
    return [timeline.stamp(t, received) for t, received in pairs]


def steady(n, *, start=1000.0, received=50.0):
    return [(start + k * PERIOD, received + k * PERIOD) for k in range(n)]


def test_steady_stamps_stay_as_they_are():
    pairs = steady(300)
    assert [s.time for s in stamps(pairs)] == [t for t, _ in pairs]
    assert not any(s.faults for s in stamps(pairs))


@given(
    st.lists(
        st.tuples(st.floats(-1e9, 1e9), st.floats(0.0, 10.0, allow_subnormal=False)),
        min_size=2,
        max_size=50,
    )
)
def test_times_increase_for_any_stamps(given):
    received, last = 0.0, -math.inf
    timeline = Timeline()
    for device_time, passed in given:
        received += passed
        time = timeline.stamp(device_time, received).time
        assert time > last
        last = time


@pytest.mark.parametrize("jump", [-3600.0, -1.0, 1.0, 3600.0])
def test_time_goes_on_as_on_the_host_where_the_clock_jumps(jump):
    before, after = steady(100), steady(200)[100:]
    given = before + [(t + jump, received) for t, received in after]
    stamped = stamps(given)
    assert [s.time for s in stamped] == pytest.approx([t for t, _ in before + after], abs=1e-6)
    assert stamped[100].faults == (Fault.CLOCK_JUMP,)
    assert not any(s.faults for k, s in enumerate(stamped) if k != 100)


def test_a_gap_after_a_stall_is_no_jump():
    """The reader stalls for 9 s; buffered samples arrive first, then new ones."""
    pairs = steady(150)
    buffered = [(1001.0 + k * PERIOD, 60.0) for k in range(1, 100)]
    new = [(1010.0 + k * PERIOD, 60.0 + k * PERIOD) for k in range(1, 100)]
    stamped = stamps(pairs + buffered + new)
    assert [s.time for s in stamped] == [t for t, _ in pairs + buffered + new]
    assert not any(Fault.CLOCK_JUMP in s.faults for s in stamped)
    assert all(s.faults == (Fault.LATE,) for s in stamped[150:249])
    assert not any(s.faults for s in stamped[249:])


def test_a_jump_after_a_late_sample_leaves_nothing_late():
    """Sample 100 comes 0.3 s late; those up to 145 are missing, then the clock has jumped."""
    pairs = steady(300)
    t, received = pairs[100]
    after = [(t + 3600.0, received) for t, received in pairs[146:]]
    stamped = stamps([*pairs[:100], (t, received + 0.3), *after])
    assert stamped[100].faults == (Fault.LATE,)
    assert stamped[101].faults == (Fault.CLOCK_JUMP,)
    assert not any(s.faults for s in stamped[102:])


def test_clocks_that_drift_are_not_late():
    stamped = stamps([(1000.0 + k, 50.0 + k * (1 + 5e-5)) for k in range(10_000)])
    assert not any(s.faults for s in stamped)


def late_times(delay_of, seconds=30.0):
    """Stamps [s] of the late samples, given the delay of a sample from its stamp."""
    n = round(seconds / PERIOD)
    stamped = stamps([(k * PERIOD, 50.0 + k * PERIOD + delay_of(k * PERIOD)) for k in range(n)])
    assert not any(Fault.CLOCK_JUMP in one.faults for one in stamped)
    return [one.time for one in stamped if Fault.LATE in one.faults]


def test_a_link_that_is_quick_again_makes_a_new_lag_late():
    late = late_times(lambda t: 0.4 * (5 <= t < 12 or t >= 20))
    seconds = {int(t) for t in late}
    assert {5, 6, 7, 20, 21, 22} <= seconds <= {5, 6, 7, 8, 9, 20, 21, 22, 23, 24}


@pytest.mark.parametrize(
    ("delay_of", "begin", "end"),
    [
        (lambda t: 0.01 * max(t - 5, 0), 16, 30),
        (lambda t: 0.3 * max(t - 5, 0), 6, 30),
        (lambda t: 4 - 0.2 * (t - 5) if 5 <= t < 25 else 0, 5, 24),
    ],
    ids=["queue that grows slowly", "queue that grows", "link that catches up"],
)
def test_a_delay_that_changes_stays_late(delay_of, begin, end):
    late = late_times(delay_of)
    expected = [k * PERIOD for k in range(4500) if begin <= k * PERIOD < end]
    assert len(set(expected) - set(late)) == 0


def test_the_delay_of_the_newest_sample():
    timeline = Timeline()
    delays = []
    for device_time, received in ((1.0, 5.0), (2.0, 6.34), (3.0, 7.0)):
        timeline.stamp(device_time, received)
        delays.append(round(timeline.delay, 2))
    assert delays == [0.0, 0.34, 0.0]


def share_of_faults(pairs):
    """Share of the samples after the first second that have a fault."""
    stamped = stamps(pairs)[150:]
    return sum(bool(one.faults) for one in stamped) / len(stamped)


@pytest.mark.parametrize(
    ("device_time", "share"),
    [
        *((lambda k, s=s: s * k * PERIOD, 1) for s in (1.2, 1.5, 3.0)),  # too fast
        (lambda k: 1.05 * k * PERIOD, 0),
        *((lambda k, s=s: s * k, 1) for s in (-PERIOD, -0.3 * PERIOD, -0.04, -1.0, 0.0)),
        (lambda k: 60.0 * (k % 2), 1),  # jumps again and again
    ],
)
def test_an_impossible_clock_is_a_fault_within_a_second(device_time, share):
    assert share_of_faults([(1000.0 + device_time(k), k * PERIOD) for k in range(900)]) == share


def test_a_recording_that_is_played_fast_is_no_fault():
    timeline = Timeline()
    for k in range(900):
        assert timeline.stamp(1000.0 + 8 * k * PERIOD, k * PERIOD).faults == ()
    assert timeline.clock.pace == pytest.approx(8.0, rel=0.01)


def test_a_burst_at_the_start_makes_no_clock_fast():
    """Two seconds of samples come at once; the last of them was the quickest."""
    burst = [(1000.0 + k * PERIOD, 50.0) for k in range(300)]
    after = [(1000.0 + k * PERIOD, 50.0 + (k - 300) * PERIOD) for k in range(300, 900)]
    assert not any(one.faults for one in stamps([*burst, *after]))


def test_a_clock_that_runs_away_is_late():
    stamped = stamps([(1000.0 + k, 50.0 + k * 1.01) for k in range(100)])
    assert [s.faults for s in stamped[:9]] == [()] * 9
    assert all(s.faults == (Fault.LATE,) for s in stamped[12:])


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 1e300, -1e300, 1e11])
def test_a_stamp_that_is_not_finite_is_refused(wrong):
    with pytest.raises(ValueError, match=f"{wrong}".replace("+", r"\+")):
        Timeline().stamp(wrong, 0.0)


@pytest.mark.parametrize(
    ("stamp", "words"),
    [
        (1.7e9, None),
        (1.7e9 - 59, None),
        (3000.0, None),
        (-5.0, None),
        (1.7e9 - 90, "2 min behind"),
        (1.7e9 - 7201, "2 h behind"),
        (1.5e9, "2315 d behind"),
        (1.8e9, "1157 d ahead"),
    ],
)
def test_stamps_of_another_time(stamp, words):
    notice = clock_notice(stamp, 1.7e9)
    assert notice is None if words is None else words in notice


class TestArrivalClock:
    @pytest.mark.parametrize("rate", [50.0, 150.0, 1000.0])
    @pytest.mark.parametrize("latency", [0.0, 0.016])
    @pytest.mark.parametrize("jitter", [0.0, 0.5e-3])
    def test_bursts_of_an_even_device_have_even_times(self, rate, latency, jitter):
        """A USB adapter passes on what came in 16 ms, at once or in pieces."""
        sent = np.arange(int(10 * rate)) / rate
        due = np.ceil(sent / latency) * latency if latency else sent
        delays = np.random.default_rng(0).exponential(jitter, len(sent))
        arrived, sizes = np.unique(np.maximum.accumulate(due + delays), return_counts=True)
        clock, times, received = ArrivalClock(None), [], []
        for at, n in zip(arrived.tolist(), sizes.tolist(), strict=True):
            new = clock.times(n, at)
            times += new
            received += [at] * len(new)
        times, received = np.array(times), np.array(received)
        assert len(times) > 0.9 * len(sent)
        steps = np.diff(times)
        assert (steps > 0).all() and (times <= received).all()
        late = received - times
        assert late.max() < latency + 2 / rate + 0.01
        settled = steps[len(steps) // 5 :]
        assert settled.mean() == pytest.approx(1 / rate, rel=0.01)
        # The rate of a stream is the mean of the steps up to three times the median.
        kept = settled[settled <= 3 * np.median(settled)]
        assert 1 / kept.mean() == pytest.approx(rate, rel=0.1)

    def test_a_pause_is_a_pause(self):
        clock = ArrivalClock(0.01)
        before = [clock.times(1, 0.01 * k)[0] for k in range(100)]
        assert before[-1] == pytest.approx(0.99)
        assert clock.times(3, 5.0) == pytest.approx([4.98, 4.99, 5.0])
