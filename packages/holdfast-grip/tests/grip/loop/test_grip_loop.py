import math
from contextlib import nullcontext

import pytest

from grip.build import FINGERS, RATE, hand, holding, scales
from holdfast.contact import ContactState, Fault
from holdfast_grip import (
    FingerCommand,
    GripCommand,
    GripController,
    GripReason,
    Limits,
    LoopState,
)
from holdfast_grip.errors import HandError
from holdfast_grip.hands.base import HandDevice
from holdfast_grip.loop.grip_loop import GripLoop

SLIPPING = {"probability": 0.0, "state": ContactState.UNSTABLE}


class Tape(HandDevice):
    """Hand that keeps its commands, and may fail. It asks for every command."""

    name = "tape:"
    heartbeat, needs_idle = 0.0, True

    def __init__(self):
        self.commands, self.fails = [], False

    def open(self):
        pass

    def _send(self, command):
        if self.fails:
            raise HandError("no")
        self.commands.append(command)

    def close(self):
        pass


class Beats:
    def __init__(self):
        self.commands = []

    def beat(self, command):
        self.commands.append(command)

    def check(self):
        pass


@pytest.fixture
def tape():
    return Tape()


@pytest.fixture
def armed(tape):
    """An armed loop that holds, and the time of its last update."""
    controller, time = holding()
    return GripLoop(controller, tape, armed=True), time


def stepped(loop, time, n=10, **changes):
    for _ in range(n):
        time += 1 / RATE
        loop.step(hand(time, **changes), time)
    return time


def test_a_dry_run_sends_nothing_and_logs_everything(tape):
    controller, time = holding(rise=30.0)
    texts = []
    with GripLoop(controller, tape, log=lambda text, _: texts.append(text)) as loop:
        stepped(loop, time, index=SLIPPING)
    assert (tape.commands, loop.n_sent, len(texts)) == ([], 0, 1)
    assert texts[0].startswith("grip REACT")


@pytest.mark.parametrize("armed", [True, False])
def test_no_armed_grip_begins_with_a_dead_finger(tape, armed):
    controller = GripController(Limits(), newtons_per_unit=1e-3)
    loop = GripLoop(controller, tape, armed=armed)
    estimate = hand(0.0, ring={"state": ContactState.UNKNOWN, "faults": (Fault.DEAD,)})
    with pytest.raises(HandError, match=r"ring.*dead") if armed else nullcontext(), loop:
        loop.step(estimate, 0.0)
    assert tape.commands == []


def test_the_controller_gets_the_joints_of_the_hand_before_the_estimate(tape):
    controller, time = holding()
    reports, seen, update = [[0.0, 1.0], [0.5, 1.0]], [], controller.update
    tape.joint_reports = lambda: [reports.pop(0)] if reports else []
    controller.observe = seen.append
    controller.update = lambda estimate, at: seen.append("estimate") or update(estimate, at)
    with GripLoop(controller, tape) as loop:
        stepped(loop, time, n=3)
    assert seen == [[0.0, 1.0], "estimate", [0.5, 1.0], "estimate", "estimate"]


def test_armed_it_sends_what_the_controller_says(tape):
    controller, time = holding()
    beats = Beats()
    with GripLoop(controller, tape, armed=True, watchdog=beats) as loop:
        time = stepped(loop, time)
        stepped(loop, time, index=SLIPPING)
        assert scales(tape.commands[-1])["index"] > 1.1
        assert beats.commands == tape.commands
    assert scales(tape.commands[-1]) == scales(tape.commands[-2])


@pytest.mark.parametrize("on_fault", ["hold", "open"])
def test_an_exception_leaves_the_hand_in_the_safe_state(tape, on_fault):
    controller, time = holding(on_fault=on_fault)
    with pytest.raises(RuntimeError), GripLoop(controller, tape, armed=True) as loop:
        stepped(loop, time)
        raise RuntimeError
    assert tape.commands[-1].state is LoopState.FAULT
    assert tape.commands[-1].release is (on_fault == "open")


def test_a_hand_that_fails_ends_the_loop_with_its_own_error(tape):
    controller, time = holding()
    with pytest.raises(HandError, match="no"), GripLoop(controller, tape, armed=True) as loop:
        time = stepped(loop, time)
        tape.fails = True
        stepped(loop, time)


def test_heartbeats_continue_between_commands(tape):
    controller, time = holding(max_rate=30.0)
    beats = Beats()
    with GripLoop(controller, tape, armed=True, watchdog=beats) as loop:
        stepped(loop, time, n=100)
        assert len(beats.commands) == 100
        assert len(tape.commands) == pytest.approx(20, abs=1)


def test_a_controller_beyond_its_limits_is_stopped_by_the_guard(tape):
    controller, time = holding()
    broken = GripCommand(time, LoopState.HOLD, {name: FingerCommand(99.0) for name in FINGERS})
    controller.update = lambda estimate, time: broken
    texts = []
    with GripLoop(controller, tape, armed=True, log=lambda text, _: texts.append(text)) as loop:
        loop.step(hand(time), time)
    assert {one.scale for one in tape.commands[0].fingers.values()} == {1.0}
    assert tape.commands[0].state is LoopState.FAULT
    assert len(texts) == 1 and texts[0].startswith("grip FAULT (limit): thumb")


@pytest.mark.parametrize("given", [float("nan"), float("inf")])
def test_a_time_that_is_no_time_is_a_fault_and_is_forgotten(tape, given):
    controller, time = holding(recovery=0.0)
    loop = GripLoop(controller, tape)
    loop.step(hand(time), time)
    assert loop.step(hand(time), given).reason is GripReason.CLOCK
    assert loop.step(hand(time + 1 / RATE), time + 1 / RATE).state is LoopState.HOLD


class LateBeats(Beats):
    """Watchdog that has taken over, as the loop finds out before or after a command."""

    def __init__(self, before=math.inf, after=math.inf):
        super().__init__()
        self._before, self._after = before, after

    def beat(self, command):
        super().beat(command)
        if len(self.commands) > self._before:
            raise HandError("taken over")

    def check(self):
        if len(self.commands) > self._after:
            raise HandError("taken over")


class TestTakenOver:
    @pytest.mark.parametrize("beats", [LateBeats(before=3), LateBeats(after=3)])
    def test_the_last_command_is_the_safe_one(self, tape, beats):
        controller, time = holding(on_fault="open")
        loop = GripLoop(controller, tape, armed=True, watchdog=beats)
        with pytest.raises(HandError, match="taken over"), loop:
            stepped(loop, time)
        assert len(tape.commands) <= 5
        assert tape.commands[-1].release

    def test_the_safe_command_holds_what_was_sent_last(self, tape):
        controller, time = holding()
        loop = GripLoop(controller, tape, armed=True, watchdog=LateBeats(before=3))
        with pytest.raises(HandError, match="taken over"), loop:
            time = stepped(loop, time, n=3)
            stepped(loop, time, **dict.fromkeys(FINGERS, SLIPPING))
        assert scales(loop.last)["index"] > 1.0
        assert scales(tape.commands[-1]) == dict.fromkeys(FINGERS, 1.0)

    def test_an_orderly_end_after_it_does_not_close_the_hand(self, tape):
        controller, time = holding(on_fault="open")
        loop = GripLoop(controller, tape, armed=True, watchdog=LateBeats(before=10))
        with pytest.raises(HandError, match="taken over"), loop:
            stepped(loop, time, n=10)
        assert tape.commands[-1].release


class TestFollow:
    def test_it_sends_nothing_and_the_next_step_has_its_force(self, tape, armed):
        loop, time = armed
        time = stepped(loop, time, n=1)
        for _ in range(5):
            time += 1 / RATE
            loop.follow(hand(time, **dict.fromkeys(FINGERS, SLIPPING)), time)
        assert len(tape.commands) == 1
        stepped(loop, time, n=1)
        assert len(tape.commands) == 2
        assert scales(loop.last)["index"] > 1.2
        assert loop.guard.violation == ""

    def test_the_guard_checks_it(self, tape, armed):
        loop, time = armed
        time = stepped(loop, time, n=1)
        good, loop.controller.update = loop.controller.update, lambda estimate, time: GripCommand(
            time, LoopState.HOLD, {name: FingerCommand(99.0) for name in FINGERS}
        )  # fmt: skip
        loop.follow(hand(time + 1 / RATE), time + 1 / RATE)
        loop.controller.update = good
        stepped(loop, time + 1 / RATE, n=1)
        assert tape.commands[-1].reason is GripReason.LIMIT


def test_a_silent_hand_is_a_fault_in_which_no_force_changes(tape, armed, monkeypatch):
    loop, time = armed
    time = stepped(loop, time)
    monkeypatch.setattr(Tape, "silent", True)
    time = stepped(loop, time, index=SLIPPING)
    assert (loop.last.state, loop.last.reason) == (LoopState.FAULT, GripReason.HAND)
    assert scales(loop.last) == dict.fromkeys(FINGERS, 1.0)
    monkeypatch.setattr(Tape, "silent", False)
    stepped(loop, time, n=100)
    assert loop.last.state is LoopState.HOLD
