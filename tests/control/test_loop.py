import pytest

from control.build import FINGERS, RATE, hand, holding, scales
from holdfast.contact import ContactState
from holdfast.control import FingerCommand, GripCommand, LoopState
from holdfast.control.hands.base import Hand
from holdfast.control.loop import GripLoop
from holdfast.errors import HandError

SLIPPING = {"probability": 0.0, "state": ContactState.UNSTABLE}


class Tape(Hand):
    """Hand that keeps its commands, and may fail."""

    name = "tape:"

    def __init__(self):
        self.commands, self.fails = [], False

    def open(self):
        pass

    def send(self, command):
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


@pytest.fixture
def tape():
    return Tape()


def stepped(loop, time, n=10, **changes):
    for _ in range(n):
        time += 1 / RATE
        loop.step(hand(time, **changes), time)
    return time


def test_a_dry_run_sends_nothing_and_logs_everything(tape):
    controller, time = holding()
    texts = []
    with GripLoop(controller, tape, log=lambda text, _: texts.append(text)) as loop:
        stepped(loop, time, index=SLIPPING)
    assert tape.commands == []
    assert loop.n_sent == 0
    assert "grip REACT: index rises from 1.000 (unstable)" in texts
    assert "grip REACT" in texts


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
    assert texts == ["grip FAULT (limit): thumb: a scale of 99 given, 1 to 3 expected"]
