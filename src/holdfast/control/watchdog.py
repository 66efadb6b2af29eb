"""Watchdog: a process that brings the hand into its safe state if the control loop dies.

The controllers of the vendors keep the last command for ever. So a second process, with a
connection to the hand of its own, waits for heartbeats of the loop on a pipe. If the loop ends
without a farewell, even by SIGKILL, the pipe closes; if the loop hangs, heartbeats are missing.
Then the watchdog sends the safe command.
"""

import os
import select
import subprocess
import sys
import time
from contextlib import suppress
from types import TracebackType
from typing import Self

import msgspec

from holdfast.children import python_command
from holdfast.control.command import GripCommand, GripReason, LoopState
from holdfast.control.guard import safe_command
from holdfast.control.hands import Hand, open_hand
from holdfast.control.limits import FaultAction
from holdfast.errors import HandError, HoldfastError

TIMEOUT = 0.1
"""Time without a heartbeat after which the watchdog takes over [s]."""
START_TIMEOUT = 60.0
"""Time in which the process must have connected to the hand [s]."""
N_SAFE_COMMANDS, SAFE_COMMAND_PERIOD = 5, 0.02
"""Number of times that the safe command is sent, in case one is lost, and the time between [s]."""
READY, FAREWELL = b"ready\n", b"farewell\n"
_PROGRAM = "from holdfast.control.watchdog import main; sys.exit(main(*sys.argv[1:]))"
_MAX_LINE = 65536


class Watchdog:
    """Process that takes over if this one dies or hangs.

    It begins to watch with the first heartbeat. A context manager: leaving it without an
    exception ends the watchdog without any command; with one, the watchdog takes over.

    Args:
        uri: URI of the hand, to which the process connects by itself.
        on_fault: "hold" or "open".
        timeout: time without a heartbeat after which it takes over [s].
    """

    def __init__(self, uri: str, on_fault: FaultAction, timeout: float = TIMEOUT) -> None:
        self._arguments = [uri, on_fault, repr(timeout)]
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the process, and wait until it is connected to the hand.

        Raises:
            HandError: the process cannot connect to the hand.
        """
        # In a session of its own, Ctrl-C does not reach it.
        self._process = process = subprocess.Popen(
            python_command(_PROGRAM, *self._arguments),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True,
        )  # fmt: skip
        output = process.stdout
        answer = b""
        if output is not None and select.select([output], [], [], START_TIMEOUT)[0]:
            answer = output.readline()
        if answer != READY:
            self.kill()
            text = answer.decode("utf-8", "replace").strip() or "it does not start"
            raise HandError(f"the watchdog cannot command {self._arguments[0]}: {text}")

    def beat(self, command: GripCommand) -> None:
        """Report that the loop is alive, and the command that it sends next.

        Raises:
            HandError: the watchdog has ended or has taken over; nothing may be sent any more.
        """
        try:
            self._write(msgspec.json.encode(command) + b"\n")
        except OSError as cause:
            raise HandError(
                f"the watchdog of {self._arguments[0]} has taken over or ended"
            ) from cause

    def stop(self) -> None:
        """End the process without any command."""
        with suppress(OSError):
            self._write(FAREWELL)
        self._end()

    def kill(self) -> None:
        """End the process at once."""
        if self._process is not None:
            self._process.kill()
        self._end()

    def abandon(self) -> None:
        """Close the pipe without a farewell, so that the watchdog takes over, and wait for it."""
        self._end()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.stop()
        else:
            self.abandon()

    def _write(self, data: bytes) -> None:
        if self._process is None or self._process.stdin is None:
            raise BrokenPipeError("the watchdog was not started")
        self._process.stdin.write(data)

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()
        process.wait()


def main(uri: str, on_fault: str, timeout: str) -> int:
    """Watch the heartbeats on stdin; the program of the watchdog's process.

    Returns:
        Exit code: 0 after a farewell, 1 after it took over, 2 if it cannot connect.
    """
    try:
        hand = open_hand(uri, standby=True)
        hand.open()
    except (HoldfastError, ValueError) as failure:
        print(failure, flush=True)  # noqa: T201 (the other end of the pipe reads it)
        return 2
    os.write(sys.stdout.fileno(), READY)
    last = _watch(sys.stdin.fileno(), float(timeout))
    if last is not None:
        _take_over(hand, last, release=on_fault == "open")
    hand.close()
    return int(last is not None)


def _watch(pipe: int, timeout: float) -> GripCommand | None:
    """Return the last command when the loop dies or hangs; None after a farewell.

    None as well if it ends before the first heartbeat: then nothing was commanded.
    """
    decoder = msgspec.json.Decoder(GripCommand)
    last, rest = None, b""
    while select.select([pipe], [], [], None if last is None else timeout)[0]:
        data = os.read(pipe, _MAX_LINE)
        *lines, rest = (rest + data).split(b"\n")
        if FAREWELL.strip() in lines:
            return None
        if lines:
            last = decoder.decode(lines[-1])
        if not data:
            break
    return last


def _take_over(hand: Hand, last: GripCommand, *, release: bool) -> None:
    """Send the safe command several times; none to hold a hand that has no grip yet."""
    if last.state is LoopState.IDLE and not release:
        return
    command = safe_command(last, GripReason.WATCHDOG, release=release)
    for _ in range(N_SAFE_COMMANDS):
        with suppress(HandError):  # the next attempt may pass
            hand.send(command, repeat=True)
        time.sleep(SAFE_COMMAND_PERIOD)
