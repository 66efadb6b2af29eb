import threading

import pytest

from control.build import RATE, hand, holding
from control.test_loop import SLIPPING, Beats, Tape
from holdfast.control import GripController, GripReason, Limits, LoopState
from holdfast.control.loop import GripLoop
from holdfast.control.runner import LoopRunner
from holdfast.errors import HandError
from holdfast.live.arrival_detector import StreamEstimate
from holdfast.live.stream_detector import StreamUpdate


def update(*estimates):
    return StreamUpdate(None, [StreamEstimate(one, tuple(one.fingers)) for one in estimates], [])


@pytest.fixture
def held():
    """A runner whose loop holds an object, its hand, and the time of its newest estimate."""
    tape = Tape()
    controller, time = holding()
    runner = LoopRunner(GripLoop(controller, tape, armed=True))
    runner.process(update(hand(time)))
    return runner, tape, time


def test_every_estimate_is_a_step(held):
    runner, tape, time = held
    runner.process(update(*(hand(time + k / RATE) for k in range(1, 6))))
    assert len(tape.commands) == 6
    assert {command.state for command in tape.commands} == {LoopState.HOLD}


def test_silence_is_a_fault(held, monkeypatch):
    runner, tape, _ = held
    monkeypatch.setattr("holdfast.control.runner.time.monotonic", lambda: runner._received + 0.1)
    runner.process(None)
    assert tape.commands[-1].reason is GripReason.STALE


def test_silence_counts_by_the_clock_of_a_slow_source(held, monkeypatch):
    runner, tape, _ = held
    runner._speed = 0.1
    monkeypatch.setattr("holdfast.control.runner.time.monotonic", lambda: runner._received + 0.1)
    runner.process(None)
    assert tape.commands[-1].state is LoopState.HOLD


def test_an_estimate_that_is_later_than_a_tick_is_no_fault_of_the_clock(held, monkeypatch):
    runner, tape, time = held
    monkeypatch.setattr("holdfast.control.runner.time.monotonic", lambda: runner._received + 0.01)
    runner.process(None)
    runner.process(update(hand(time + 1 / RATE)))
    runner.process(update(hand(time + 2 / RATE)))
    assert {command.state for command in tape.commands} == {LoopState.HOLD}


def test_a_stop_does_not_wait_for_the_updates_in_the_queue(held):
    runner, tape, time = held
    for k in range(1, 50):
        runner.put(update(hand(time + k / RATE, index=SLIPPING)))
    stopped = runner.stop()
    n = len(tape.commands)
    runner.run(lambda: True)
    assert stopped.result(0) is None
    assert {command.reason for command in tape.commands[n:]} == {GripReason.STOPPED}


def test_a_stop_needs_no_data_and_keeps_the_watchdog_quiet():
    tape, beats = Tape(), Beats()
    loop = GripLoop(GripController(Limits(on_fault="open")), tape, armed=True, watchdog=beats)
    runner = LoopRunner(loop)
    runner.process(None)
    assert tape.commands == []
    runner.stop()
    for _ in range(5):
        runner.process(None)
    assert [command.release for command in tape.commands] == [True]
    assert len(beats.commands) == 5


def test_a_stop_wins_over_a_reset_before_it(held):
    runner, tape, time = held
    runner.stop()
    runner.reset()
    runner.stop()
    runner.process(update(hand(time + 1 / RATE)))
    assert tape.commands[-1].reason is GripReason.STOPPED
    reset = runner.reset()
    runner.process(update(hand(time + 2 / RATE)))
    assert reset.done()
    assert tape.commands[-1].state is LoopState.HOLD


def test_a_hand_that_fails_fails_the_request_too(held):
    runner, tape, _ = held
    tape.fails = True
    stopped = runner.stop()
    with pytest.raises(HandError, match="no"):
        runner.run(lambda: False)
    with pytest.raises(HandError, match="no"):
        stopped.result(0)


def test_a_stop_from_another_thread_wakes_the_runner(held):
    runner, tape, _ = held
    over = threading.Event()
    thread = threading.Thread(target=runner.run, args=(over.is_set,))
    thread.start()
    runner.stop().result(60)
    over.set()
    thread.join(60)
    assert GripReason.STOPPED in {command.reason for command in tape.commands}
