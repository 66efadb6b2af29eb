"""The watchdog, with real processes. No time is asserted: each test waits as long as it takes."""

import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

from holdfast_grip import FingerCommand, GripCommand, GripReason, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.loop import watchdog
from holdfast_grip.loop.watchdog import N_SAFE_COMMANDS, Watchdog

PATIENCE = 120.0
TESTS = str(Path(__file__).parents[2])
COMMAND = GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(1.3, GripReason.SLIP)})

LOOP = """
import sys, time
from contextlib import ExitStack
from grip.build import RATE, hand, holding
from holdfast_grip.hands import open_hand
from holdfast_grip.loop.grip_loop import GripLoop
from holdfast_grip.loop.watchdog import Watchdog
uri, on_fault, timeout = sys.argv[1], sys.argv[2], float(sys.argv[3])
controller, at = holding(on_fault=on_fault)
with ExitStack() as stack:
    commanded = stack.enter_context(open_hand(uri))
    watchdog = stack.enter_context(Watchdog(uri, on_fault, timeout=timeout))
    loop = stack.enter_context(GripLoop(controller, commanded, armed=True, watchdog=watchdog))
    while True:
        at += 1 / RATE
        loop.step(hand(at), at)
        time.sleep(1 / RATE)
"""


def commands(path):
    lines = path.read_bytes().splitlines() if path.exists() else []
    return [msgspec.json.decode(line, type=GripCommand) for line in lines]


def wait_for(path, n):
    end = time.monotonic() + PATIENCE
    while len(commands(path)) < n and time.monotonic() < end:
        time.sleep(0.01)
    found = commands(path)
    assert len(found) >= n, f"{n} commands expected, {found} came"
    return found


@pytest.fixture
def loop(tmp_path):
    """A control loop in another process, which has sent a command; all others are equal."""
    processes = []

    def start(*words):
        command = [sys.executable, "-c", LOOP, f"log:{tmp_path / 'hand'}", *words]
        path = {"PYTHONPATH": os.pathsep.join([TESTS, *sys.path])}
        process = subprocess.Popen(command, stderr=subprocess.PIPE, env=os.environ | path)
        processes.append(process)
        wait_for(tmp_path / "hand", 1)
        return process

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def test_a_loop_that_was_paused_sends_no_old_command(loop, tmp_path):
    """It is stopped until the watchdog opens the hand, and then goes on."""
    process = loop("open", "0.3")
    os.kill(process.pid, signal.SIGSTOP)
    wait_for(tmp_path / "hand", 2)
    os.kill(process.pid, signal.SIGCONT)
    _, error = process.communicate(timeout=PATIENCE)
    assert b"has taken over or ended" in error
    _, *found = commands(tmp_path / "hand")
    assert len(found) >= N_SAFE_COMMANDS
    assert found[0].reason is GripReason.WATCHDOG
    assert all(command.release for command in found)


class TestInOneProcess:
    @pytest.fixture
    def clock(self, monkeypatch):
        """The time of the loop's side, which a test sets."""
        now = [0.0]
        monkeypatch.setattr(watchdog, "time", SimpleNamespace(monotonic=lambda: now[0]))
        return now

    @pytest.fixture
    def started(self, tmp_path):
        """A watchdog that has started; at the end of the test it is killed."""
        started = Watchdog(f"log:{tmp_path / 'hand'}", "open", timeout=PATIENCE)
        started.start()
        yield started
        started.kill()

    def test_a_heartbeat_that_is_too_late_is_refused_and_the_watchdog_takes_over(
        self, tmp_path, started, clock
    ):
        started.beat(COMMAND)
        clock[0] = PATIENCE
        started.check()
        clock[0] = PATIENCE + 0.001
        with pytest.raises(HandError, match=r"at most 120 s between two heartbeats expected, 120"):
            started.beat(COMMAND)
        assert wait_for(tmp_path / "hand", N_SAFE_COMMANDS)[0].release

    def test_a_watchdog_that_is_stopped_is_a_fault_and_ends(self, started, clock, monkeypatch):
        monkeypatch.setattr(watchdog, "WATCHDOG_END_TIMEOUT", 0.1, raising=False)
        started.beat(COMMAND)
        os.kill(started._process.pid, signal.SIGSTOP)
        os.waitid(os.P_PID, started._process.pid, os.WSTOPPED | os.WNOWAIT)
        with pytest.raises(HandError, match="does not read its heartbeats any more"):
            for _ in range(1000):
                clock[0] += watchdog.UNREAD_TIMEOUT / 10
                started.beat(COMMAND)
        assert clock[0] <= 2 * watchdog.UNREAD_TIMEOUT
        started.abandon()

    def test_a_full_pipe_blocks_no_heartbeat(self, started, clock, monkeypatch):
        monkeypatch.setattr(watchdog, "WATCHDOG_END_TIMEOUT", 0.1, raising=False)
        os.kill(started._process.pid, signal.SIGSTOP)
        with pytest.raises(HandError, match="does not read its heartbeats any more"):
            for _ in range(100_000):  # no time passes
                started.beat(COMMAND)
        started.stop()

    def test_a_line_that_is_no_command_makes_it_take_over(self, tmp_path, started):
        started.beat(COMMAND)
        started._write(b'{"time": null}\n')
        assert wait_for(tmp_path / "hand", N_SAFE_COMMANDS)[0].release

    @pytest.mark.parametrize("failure", [None, RuntimeError])
    def test_a_farewell_ends_it_without_a_command_but_after_an_exception(self, tmp_path, failure):
        with (
            pytest.raises(RuntimeError) if failure else nullcontext(),
            Watchdog(f"log:{tmp_path / 'hand'}", "open", timeout=PATIENCE) as watchdog,
        ):
            watchdog.beat(COMMAND)
            if failure:
                raise failure
        assert any(one.release for one in commands(tmp_path / "hand")) is bool(failure)

    def test_a_hand_that_it_cannot_reach_is_an_error(self, tmp_path):
        watchdog = Watchdog(f"log:{tmp_path}/no/hand", "hold")
        with pytest.raises(HandError, match=r"cannot command log:.*: cannot write .*No such file"):
            watchdog.start()


@pytest.mark.parametrize(
    ("beats", "on_fault", "n"),
    [(0, "open", 0), (1, "hold", 0), (1, "open", N_SAFE_COMMANDS)],
)
def test_before_the_grip_it_can_open_the_hand_only(tmp_path, beats, on_fault, n):
    path = tmp_path / "hand"
    watchdog = Watchdog(f"log:{path}", on_fault, timeout=3600.0)
    watchdog.start()
    for _ in range(beats):
        watchdog.beat(msgspec.structs.replace(COMMAND, state=LoopState.IDLE))
    watchdog.abandon()
    assert [one.release for one in commands(path)] == [True] * n
