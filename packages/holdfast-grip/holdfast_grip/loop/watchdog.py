"""Watchdog: a process that brings the hand into its safe state if the control loop dies.

The controllers of the vendors keep the last command for ever. So a second process, with a
connection to the hand of its own, waits for heartbeats of the loop on a pipe. If the loop ends
without a farewell, even by SIGKILL, the pipe closes; if the loop hangs, heartbeats are missing.
Then the watchdog closes its end of the pipe and sends the safe command. Both sides measure the
time since the last heartbeat, on the same clock: the loop from before it wrote it, the watchdog
from after it read it. So the loop gives up first, and a heartbeat that succeeded was in time.
"""

import math
import os
import select
import subprocess
import sys
import time
from contextlib import suppress
from typing import IO, Self

import msgspec

from holdfast.children import python_command
from holdfast.errors import HoldfastError
from holdfast_grip.command import GripCommand, GripReason, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.guard import safe_command
from holdfast_grip.hands import open_hand
from holdfast_grip.limits import FaultAction

TIMEOUT = 0.1
"""Time without a heartbeat after which the watchdog takes over [s]."""
START_TIMEOUT = 60.0
"""Time in which the process must have connected to the hand [s]."""
UNREAD_TIMEOUT = 0.5
"""Time without reading its heartbeats after which the watchdog counts as hanging [s]."""
WRITE_TIMEOUT = 0.02
"""Longest wait for a pipe that is full [s]."""
WATCHDOG_END_TIMEOUT = 5.0
"""Time in which the process must end after its pipe was closed [s]; then it is killed."""
N_SAFE_COMMANDS, SAFE_COMMAND_PERIOD = 5, 0.02
"""Number of times that the safe command is sent, in case one is lost, and the time between [s]."""
READY_LINE, FAREWELL_LINE = b"ready\n", b"farewell\n"
_PROGRAM = "from holdfast_grip.loop.watchdog import main; sys.exit(main(*sys.argv[1:]))"
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
        self._timeout = timeout
        self._beaten_at = math.inf  # before the first heartbeat, none is missing
        # Bytes that were written, those the watchdog has read, and when these grew.
        self._n_written = self._n_read = 0
        self._read_at = -math.inf
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
        if answer != READY_LINE:
            self.kill()
            text = answer.decode("utf-8", "replace").strip() or "it does not start"
            raise HandError(f"the watchdog cannot command {self._arguments[0]}: {text}")
        if process.stdin is not None:
            # A full pipe must not block the loop.
            os.set_blocking(process.stdin.fileno(), False)

    def beat(self, command: GripCommand) -> None:
        """Report that the loop is alive, and the command that it sends next.

        It waits for at most `WRITE_TIMEOUT`.

        Raises:
            HandError: the watchdog has ended, has taken over or hangs, or the last heartbeat is
                too long ago; nothing but the safe command may be sent any more.
        """
        self.check()
        begun_at = time.monotonic()
        try:
            self._write(msgspec.json.encode(command) + b"\n")
            self._check_reader(begun_at)
        except TimeoutError as cause:
            raise HandError(
                f"the watchdog of {self._arguments[0]} does not read its heartbeats any more"
            ) from cause
        except OSError as cause:
            raise HandError(
                f"the watchdog of {self._arguments[0]} has taken over or ended"
            ) from cause
        # The write may have waited: only a heartbeat that was in time counts.
        self.check()
        self._beaten_at = begun_at

    def check(self) -> None:
        """Check that the last heartbeat is so new that the watchdog has not taken over.

        Raises:
            HandError: it is not. The pipe is closed, so that the watchdog does take over.
        """
        elapsed = time.monotonic() - self._beaten_at
        if elapsed <= self._timeout:
            return
        if self._process is not None:
            self._close(self._process.stdin)
        raise HandError(
            f"the watchdog of {self._arguments[0]} has taken over or ended: at most "
            f"{self._timeout:g} s between two heartbeats expected, {elapsed:.3g} s measured"
        )

    def stop(self) -> None:
        """End the process without any command."""
        try:
            self._write(FAREWELL_LINE)
        except OSError:
            self.kill()
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

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            self.stop()
        else:
            self.abandon()

    def _write(self, data: bytes) -> None:
        """Write to the pipe.

        Raises:
            TimeoutError: it is full, because the watchdog does not read.
            OSError: it is closed.
        """
        if self._process is None or self._process.stdin is None or self._process.stdin.closed:
            raise BrokenPipeError("the watchdog was not started, or its pipe is closed")
        pipe = self._process.stdin.fileno()
        while data:
            if not select.select([], [pipe], [], WRITE_TIMEOUT)[1]:
                raise TimeoutError("the pipe is full")
            n = os.write(pipe, data)
            self._n_written += n
            data = data[n:]

    def _check_reader(self, now: float) -> None:
        """Check that the watchdog has read something new in time.

        Raises:
            TimeoutError: it has not.
        """
        import fcntl
        import termios

        if self._process is None or self._process.stdin is None:
            return
        # The bytes in the pipe that are not read yet.
        n_unread = fcntl.ioctl(self._process.stdin, termios.FIONREAD, bytes(4))
        n_read = self._n_written - int.from_bytes(n_unread, sys.byteorder)
        if n_read > self._n_read or self._read_at == -math.inf:
            self._n_read, self._read_at = n_read, now
        elif now - self._read_at > UNREAD_TIMEOUT:
            raise TimeoutError("nothing was read")

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        self._close(process.stdin)
        self._close(process.stdout)
        try:
            process.wait(WATCHDOG_END_TIMEOUT)
        except subprocess.TimeoutExpired:  # it hangs
            process.kill()
            process.wait()

    @staticmethod
    def _close(pipe: IO[bytes] | None) -> None:
        if pipe is not None:
            with suppress(OSError):
                pipe.close()


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
    os.write(sys.stdout.fileno(), READY_LINE)
    pipe = sys.stdin.fileno()
    last = _watch(pipe, float(timeout))
    os.close(pipe)  # the next heartbeat of the loop fails, before it can send an old command
    release = on_fault == "open"
    # Nothing to hold in a hand that has no grip yet.
    if last is not None and (release or last.state is not LoopState.IDLE):
        command = safe_command(last, GripReason.WATCHDOG, release=release)
        for _ in range(N_SAFE_COMMANDS):
            with suppress(HandError):  # the next attempt may pass
                hand.send(command, repeat=True)
            time.sleep(SAFE_COMMAND_PERIOD)
    hand.close()
    return int(last is not None)


def _watch(pipe: int, timeout: float) -> GripCommand | None:
    """Return the last command when the loop dies, hangs or sends no JSON; None after a farewell.

    None as well if it ends before the first heartbeat: then nothing was commanded.
    """
    decoder = msgspec.json.Decoder(GripCommand)
    last, rest = None, b""
    while select.select([pipe], [], [], None if last is None else timeout)[0]:
        data = os.read(pipe, _MAX_LINE)
        *lines, rest = (rest + data).split(b"\n")
        if FAREWELL_LINE.strip() in lines:
            return None
        for line in lines:
            try:
                last = decoder.decode(line)
            # A loop that sends no JSON is broken.
            except msgspec.DecodeError:
                return last
        if not data:
            break
    return last
