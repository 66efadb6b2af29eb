import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast_grip import FingerCommand, GripCommand, GripReason, Limits, LoopState
from holdfast_grip.guard import CommandGuard, safe_command

LIMITS = Limits(min_scale=0.5, max_scale=2.0, rise=10.0, max_rate=100.0)


def command(scale, time=0.0, state=LoopState.HOLD):
    return GripCommand(time, state, {"thumb": FingerCommand(scale)})


@settings(max_examples=60)
@given(
    st.lists(st.tuples(st.floats(), st.floats(0.0, 0.1) | st.just(math.nan)), max_size=30),
    st.sampled_from(["hold", "open"]),
)
def test_nothing_beyond_the_limits_leaves(inputs, on_fault):
    guard = CommandGuard(Limits(min_scale=0.5, max_scale=2.0, rise=10.0, on_fault=on_fault))
    time, before = 0.0, 1.0
    for scale, dt in inputs:
        time += dt
        if math.isnan(time):
            time = 0.0
        sent = guard.admit(command(scale, time))
        if sent is None:
            continue
        now = sent.fingers["thumb"].scale
        assert 0.5 - 1e-9 <= now <= 2.0 + 1e-9
        assert sent.release is (bool(guard.violation) and on_fault == "open")
        assert not guard.violation or now == before
        before = now


@pytest.mark.parametrize(
    ("scale", "violation"),
    [
        (2.1, "thumb: a scale of 2.1 given, 0.5 to 2 expected"),
        (math.nan, "thumb: a scale of nan given, 0.5 to 2 expected"),
        (1.2, "thumb: a rise of 0.2 in 0.01 s given, 10/s at most"),
    ],
)
def test_a_violation_is_named_and_lasts(scale, violation):
    guard = CommandGuard(LIMITS)
    guard.admit(command(1.0))
    refused = guard.admit(command(scale, 0.01))
    assert guard.violation == violation
    assert (refused.state, refused.reason) == (LoopState.FAULT, GripReason.LIMIT)
    assert guard.admit(command(1.0, 0.02)).state is LoopState.FAULT


def test_commands_have_a_highest_rate_and_a_fault_passes_at_once():
    guard = CommandGuard(LIMITS)
    times = [k / 1000 for k in range(100)]
    sent = [time for time in times if guard.admit(command(1.0, time)) is not None]
    assert len(sent) == pytest.approx(10, abs=1)
    assert guard.admit(command(1.0, 0.0995, LoopState.FAULT)) is not None
    assert guard.admit(command(1.0, 0.0998, LoopState.FAULT)) is None


def test_the_safe_command_keeps_the_scales():
    safe = safe_command(command(1.4, 3.0), GripReason.WATCHDOG, release=True)
    assert safe.fingers["thumb"].scale == 1.4
    assert safe.release
    assert safe.state is LoopState.FAULT


def test_commands_pass_after_the_clock_went_back():
    guard = CommandGuard(LIMITS)
    guard.admit(command(1.0, 100.0))
    assert guard.admit(command(1.0, 0.5)) is not None
