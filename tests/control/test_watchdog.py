"""The watchdog, with real processes. No time is asserted: each test waits as long as it takes."""

import os
import signal
import subprocess
import sys
import time

import msgspec
import pytest

from holdfast.control import FingerCommand, GripCommand, GripReason, LoopState
from holdfast.control.watchdog import N_SAFE_COMMANDS, Watchdog
from holdfast.errors import HandError

PATIENCE = 120.0
COMMAND = GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(1.3, GripReason.SLIP)})

LOOP = """
import sys, time
from holdfast.control import FingerCommand, GripCommand, LoopState
from holdfast.control.watchdog import Watchdog
watchdog = Watchdog("log:" + sys.argv[1], sys.argv[2], timeout=float(sys.argv[3]))
watchdog.start()
command = GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(1.3)})
watchdog.beat(command)
print("started", flush=True)
while True:
    watchdog.beat(command)
    time.sleep(0.005)
"""


def commands(path):
    lines = path.read_bytes().splitlines() if path.exists() else []
    return [msgspec.json.decode(line, type=GripCommand) for line in lines]


def wait_for(path, n):
    end = time.monotonic() + PATIENCE
    while len(commands(path)) < n and time.monotonic() < end:
        time.sleep(0.01)
    return commands(path)


@pytest.fixture
def loop(tmp_path):
    """A control loop in another process, which was stopped by a signal."""
    processes = []

    def stopped(number, on_fault, timeout):
        process = subprocess.Popen(
            [sys.executable, "-c", LOOP, str(tmp_path / "hand"), on_fault, str(timeout)],
            stdout=subprocess.PIPE,
        )
        processes.append(process)
        assert process.stdout.readline() == b"started\n"
        os.kill(process.pid, number)
        return tmp_path / "hand"

    yield stopped
    for process in processes:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize("on_fault", ["hold", "open"])
def test_it_takes_over_when_the_loop_is_killed(loop, on_fault):
    """The closed pipe is enough: the time-out of the heartbeats is an hour here."""
    found = wait_for(loop(signal.SIGKILL, on_fault, 3600.0), N_SAFE_COMMANDS)
    assert len(found) == N_SAFE_COMMANDS
    for command in found:
        assert (command.state, command.reason) == (LoopState.FAULT, GripReason.WATCHDOG)
        assert command.release is (on_fault == "open")
        assert command.fingers["thumb"].scale == 1.3


def test_it_takes_over_when_the_loop_hangs(loop):
    found = wait_for(loop(signal.SIGSTOP, "hold", 0.1), N_SAFE_COMMANDS)
    assert found[0].reason is GripReason.WATCHDOG


class TestInOneProcess:
    def test_a_farewell_ends_it_without_a_command(self, tmp_path):
        with Watchdog(f"log:{tmp_path / 'hand'}", "open", timeout=PATIENCE) as watchdog:
            watchdog.beat(COMMAND)
        assert commands(tmp_path / "hand") == []

    def test_it_takes_over_after_an_exception(self, tmp_path):
        with (
            pytest.raises(RuntimeError),
            Watchdog(f"log:{tmp_path / 'hand'}", "open", timeout=PATIENCE) as watchdog,
        ):
            watchdog.beat(COMMAND)
            raise RuntimeError
        assert commands(tmp_path / "hand")[-1].release

    def test_a_loop_that_was_taken_over_may_not_continue(self, tmp_path):
        watchdog = Watchdog(f"log:{tmp_path / 'hand'}", "hold", timeout=0.05)
        watchdog.start()
        watchdog.beat(COMMAND)
        wait_for(tmp_path / "hand", N_SAFE_COMMANDS)
        with pytest.raises(HandError, match="has taken over or ended"):
            for _ in range(10_000):
                watchdog.beat(COMMAND)
                time.sleep(0.01)
        watchdog.kill()

    def test_before_the_first_heartbeat_it_commands_nothing(self, tmp_path):
        watchdog = Watchdog(f"log:{tmp_path / 'hand'}", "open", timeout=0.05)
        watchdog.start()
        watchdog.abandon()
        assert commands(tmp_path / "hand") == []

    def test_a_hand_that_it_cannot_reach_is_an_error(self, tmp_path):
        watchdog = Watchdog(f"log:{tmp_path}/no/hand", "hold")
        with pytest.raises(HandError, match=r"cannot command log:.*: cannot write .*No such file"):
            watchdog.start()

    def test_without_a_start_there_is_no_heartbeat(self):
        with pytest.raises(HandError, match="has taken over or ended"):
            Watchdog("log:x", "hold").beat(COMMAND)


@pytest.mark.parametrize(("on_fault", "n"), [("hold", 0), ("open", N_SAFE_COMMANDS)])
def test_before_the_grip_it_can_open_the_hand_only(tmp_path, on_fault, n):
    path = tmp_path / "hand"
    watchdog = Watchdog(f"log:{path}", on_fault, timeout=3600.0)
    watchdog.start()
    watchdog.beat(msgspec.structs.replace(COMMAND, state=LoopState.IDLE))
    watchdog.abandon()
    assert [one.release for one in commands(path)] == [True] * n
