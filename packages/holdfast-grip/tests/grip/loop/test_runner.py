import math
from types import SimpleNamespace

import pytest

from grip.build import FINGERS, RATE, hand, holding
from grip.loop.test_grip_loop import SLIPPING, Tape
from holdfast.contact import ContactState
from holdfast.devices.sources import Arrival
from holdfast.live.stream_detector import StreamEstimate, StreamUpdate
from holdfast_grip import GripController, GripReason, Limits, LoopState
from holdfast_grip.loop import runner as module
from holdfast_grip.loop.grip_loop import GripLoop
from holdfast_grip.loop.runner import LoopRunner


def update(*estimates):
    return StreamUpdate(None, [StreamEstimate(one, tuple(one.fingers)) for one in estimates], [])


@pytest.fixture
def clock(monkeypatch):
    """The time of the host, which a test sets."""
    now = [100.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


def started(speed=1.0):
    """A runner whose loop holds an object, its hand, and the time of its newest estimate."""
    tape = Tape()
    controller, time = holding()
    runner = LoopRunner(GripLoop(controller, tape, armed=True), speed)
    runner.process(update(hand(time)))
    return runner, tape, time


@pytest.fixture
def held(clock):
    return started()


def test_without_a_pace_every_estimate_is_a_step():
    runner, tape, time = started(speed=0.0)
    runner.process(update(*(hand(time + k / RATE) for k in range(1, 6))))
    assert len(tape.commands) == 6
    assert {command.state for command in tape.commands} == {LoopState.HOLD}


@pytest.mark.parametrize(("speed", "reason"), [(1.0, GripReason.STALE), (0.1, GripReason.NONE)])
def test_silence_is_a_fault_by_the_clock_of_the_source(clock, speed, reason):
    runner, tape, _ = started(speed)
    clock[0] += 0.1
    runner.process(None)
    assert tape.commands[-1].reason is reason


def test_a_clock_of_the_source_that_stands_still_is_a_fault(held, clock):
    # The samples are new, but by their times they are not: an assembler makes them just increase.
    runner, tape, time = held
    for _ in range(20):
        clock[0] += 0.01
        time = math.nextafter(time, math.inf)
        runner.process(update(hand(time)))
    assert tape.commands[-1].reason is GripReason.STALE


def test_an_estimate_that_is_later_than_a_tick_is_no_fault_of_the_clock(held, clock):
    runner, tape, time = held
    clock[0] += 0.01
    runner.process(None)
    runner.process(update(hand(time + 1 / RATE)))
    runner.process(update(hand(time + 2 / RATE)))
    assert {command.state for command in tape.commands} == {LoopState.HOLD}


class TestBehind:
    """Updates that arrived while the hand took a command."""

    def test_the_hand_gets_only_the_newest_command(self, held, clock):
        runner, tape, time = held
        clock[0] += 0.05
        for k in range(1, 21):
            runner.put(update(hand(time + k / RATE)))
        n = len(tape.commands)
        runner.run(lambda: True)
        assert [command.time for command in tape.commands[n:]] == [time + 20 / RATE]

    def test_a_slip_that_is_over_still_raises_the_force(self, held, clock):
        runner, tape, time = held
        clock[0] += 0.05
        for k in range(1, 8):
            slip = dict.fromkeys(FINGERS, SLIPPING if k == 3 else {})
            runner.put(update(hand(time + k / RATE, **slip)))
        runner.run(lambda: True)
        assert tape.commands[-1].fingers["index"].scale > 1.1

    def test_a_fault_that_is_over_still_counts(self, held):
        runner, tape, time = held
        for k in range(1, 8):
            bad = {"force": (math.nan, 0.0, 0.0)} if k == 3 else {}
            runner.put(update(hand(time + k / RATE, index=bad)))
        runner.run(lambda: True)
        assert tape.commands[-1].reason is GripReason.NOT_FINITE

    def test_a_grip_may_begin_in_them(self):
        tape = Tape()
        runner = LoopRunner(GripLoop(GripController(Limits()), tape, armed=True))
        for k in range(90):
            runner.put(update(hand(k / RATE)))
        runner.run(lambda: True)
        assert [command.state for command in tape.commands] == [LoopState.HOLD]

    def test_a_pause_of_the_loop_is_a_fault(self, held, clock):
        runner, tape, time = held
        clock[0] += module.MAX_PAUSE - 0.001
        runner.process(update(hand(time + 1 / RATE)))
        assert tape.commands[-1].state is LoopState.HOLD
        clock[0] += module.MAX_PAUSE + 0.001
        runner.process(update(hand(time + 2 / RATE)))
        assert (tape.commands[-1].state, tape.commands[-1].reason) == ("FAULT", "behind")

    def test_what_is_pending_is_bounded(self, held):
        runner, _, time = held
        followed, runner.loop.follow = [], lambda _, time: followed.append(time)
        for k in range(3 * module.MAX_PENDING):
            runner.put(update(hand(time + k / RATE)))
        runner.run(lambda: True)
        assert len(followed) == module.MAX_PENDING - 1

    def test_the_age_of_an_estimate_counts_from_the_arrival_of_its_samples(self, held):
        runner, tape, time = held
        arrival = Arrival(time + 1 / RATE, {}, module.time.monotonic() - 0.08)
        runner.process(update(hand(time + 1 / RATE))._replace(arrival=arrival))
        assert tape.commands[-1].reason is GripReason.STALE

    def test_time_passes_while_a_source_sends_only_faults(self, held, clock):
        runner, tape, time = held
        bad = {"index": {"state": ContactState.UNKNOWN}}
        for _ in range(20):
            clock[0] += 0.005
            runner.process(update(hand(time, **bad)))
        assert tape.commands[-1].state is LoopState.FAULT


def test_a_stamp_that_is_no_number_gives_the_safe_command(held):
    runner, tape, _ = held
    runner.process(update(hand(math.nan)))
    last = tape.commands[-1]
    assert (last.state, last.reason) == (LoopState.FAULT, GripReason.CLOCK)
    assert math.isfinite(last.time)
