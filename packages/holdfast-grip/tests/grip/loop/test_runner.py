import math
import time as clocks
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
def held():
    """A runner whose loop holds an object, its hand, and the time of its newest estimate."""
    tape = Tape()
    controller, time = holding()
    runner = LoopRunner(GripLoop(controller, tape, armed=True))
    runner.process(update(hand(time)))
    return runner, tape, time


def test_without_a_pace_every_estimate_is_a_step():
    tape = Tape()
    controller, time = holding()
    runner = LoopRunner(GripLoop(controller, tape, armed=True), speed=0.0)
    runner.process(update(*(hand(time + k / RATE) for k in range(1, 6))))
    assert len(tape.commands) == 5
    assert {command.state for command in tape.commands} == {LoopState.HOLD}


def test_silence_is_a_fault(held, monkeypatch):
    runner, tape, _ = held
    monkeypatch.setattr("holdfast_grip.loop.runner.time.monotonic", lambda: runner._received + 0.1)
    runner.process(None)
    assert tape.commands[-1].reason is GripReason.STALE


def test_a_clock_of_the_source_that_stands_still_is_a_fault(held, monkeypatch):
    # The samples are new, but by their times they are not: an assembler makes them just increase.
    runner, tape, time = held
    now = runner._received
    monkeypatch.setattr("holdfast_grip.loop.runner.time.monotonic", lambda: now)
    for _ in range(20):
        now += 0.01
        time = math.nextafter(time, math.inf)
        runner.process(update(hand(time)))
    assert tape.commands[-1].reason is GripReason.STALE


def test_silence_counts_by_the_clock_of_a_slow_source(held, monkeypatch):
    runner, tape, _ = held
    runner._speed = 0.1
    monkeypatch.setattr("holdfast_grip.loop.runner.time.monotonic", lambda: runner._received + 0.1)
    runner.process(None)
    assert tape.commands[-1].state is LoopState.HOLD


def test_an_estimate_that_is_later_than_a_tick_is_no_fault_of_the_clock(held, monkeypatch):
    runner, tape, time = held
    monkeypatch.setattr("holdfast_grip.loop.runner.time.monotonic", lambda: runner._received + 0.01)
    runner.process(None)
    runner.process(update(hand(time + 1 / RATE)))
    runner.process(update(hand(time + 2 / RATE)))
    assert {command.state for command in tape.commands} == {LoopState.HOLD}


@pytest.fixture
def clock(held, monkeypatch):
    """The time of the host, which a test sets."""
    now = [held[0]._received]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


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
        clock[0] = runner._stepped_at + module.MAX_PAUSE - 0.001
        runner.process(update(hand(time + 1 / RATE)))
        assert tape.commands[-1].state is LoopState.HOLD
        clock[0] += module.MAX_PAUSE + 0.001
        runner.process(update(hand(time + 2 / RATE)))
        assert (tape.commands[-1].state, tape.commands[-1].reason) == ("FAULT", "behind")

    def test_what_is_pending_is_bounded(self, held):
        runner, _, time = held
        for k in range(3 * module.MAX_PENDING):
            runner.put(update(hand(time + k / RATE)))
        assert len(runner._pending) == module.MAX_PENDING

    def test_the_age_of_an_estimate_counts_from_the_arrival_of_its_samples(self, held):
        runner, tape, time = held
        arrival = Arrival(time + 1 / RATE, {}, clocks.monotonic() - 0.08)
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
