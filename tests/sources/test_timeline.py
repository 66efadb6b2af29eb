import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import Fault
from holdfast.sources.timeline import Timeline, TransportDelay

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


def test_a_burst_after_a_stall_is_late_and_no_jump():
    pairs = steady(400)
    stalled = [(t, 52.0 if 51.0 < received < 52.0 else received) for t, received in pairs]
    stamped = stamps(stalled)
    assert [s.time for s in stamped] == [t for t, _ in pairs]
    late = [s.time for s in stamped if s.faults == (Fault.LATE,)]
    assert late == [t for t, _ in pairs if 1001.0 < t < 1001.9 - 1e-3]
    assert all(s.faults in ((), (Fault.LATE,)) for s in stamped)


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


def test_clocks_that_drifted_over_a_long_pause_did_not_jump():
    stamped = stamps([*steady(10), (11_000.0 + 0.9, 10_050.0)])
    assert stamped[-1] == (11_000.9, ())


def test_a_jump_after_a_late_sample_leaves_nothing_late():
    """Sample 100 comes 0.3 s late; those up to 145 are missing, then the clock has jumped."""
    pairs = steady(300)
    t, received = pairs[100]
    after = [(t + 3600.0, received) for t, received in pairs[146:]]
    stamped = stamps([*pairs[:100], (t, received + 0.3), *after])
    assert stamped[100].faults == (Fault.LATE,)
    assert stamped[101].faults == (Fault.CLOCK_JUMP,)
    assert not any(s.faults for s in stamped[102:])


def test_a_small_step_back_is_just_after_the_last():
    first, second, third = stamps([(10.0, 0.0), (9.96, 0.01), (10.02, 0.02)])
    assert first.time < second.time == math.nextafter(10.0, math.inf)
    assert third == (10.02, ())
    assert second.faults == ()


def test_clocks_that_drift_are_not_late():
    stamped = stamps([(1000.0 + k, 50.0 + k * (1 + 5e-5)) for k in range(10_000)])
    assert not any(s.faults for s in stamped)


def test_a_clock_that_runs_away_is_late():
    stamped = stamps([(1000.0 + k, 50.0 + k * 1.01) for k in range(100)])
    assert [s.faults for s in stamped[:9]] == [()] * 9
    assert all(s.faults == (Fault.LATE,) for s in stamped[12:])


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_stamp_that_is_not_finite_is_refused(wrong):
    with pytest.raises(ValueError, match=f"a time in seconds expected, {wrong} given"):
        Timeline().stamp(wrong, 0.0)


def test_the_offset_is_what_jumps_add():
    timeline = Timeline()
    timeline.stamp(100.0, 0.0)
    assert timeline.offset == 0.0
    timeline.stamp(40.0, 1.0)
    assert timeline.offset == 61.0


def test_a_delay_after_a_reset():
    delay = TransportDelay()
    assert delay.update(0.0, 1.0) == 0.0
    assert delay.update(1.0, 3.0) == pytest.approx(1.0, abs=1e-3)
    delay.reset()
    assert delay.update(2.0, 5.0) == 0.0
    assert delay.lead(3.0, 5.5) == pytest.approx(0.5, abs=1e-3)
