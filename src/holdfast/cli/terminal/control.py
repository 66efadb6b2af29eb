"""Control a running command: signals that stop it, and markers from stdin.

Markers are keys of a terminal, or lines of a pipe.
"""

import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Self

STOP_KEY = "q"
MARKER_KEYS = {
    " ": "mark",
    "c": "closing",
    "l": "locked",
    "d": "disturbance",
    "r": "released",
    **{digit: f"mark {digit}" for digit in "123456789"},
}
"""Marker text of each key."""
KEY_HELP = "keys: c closing, l locked, d disturbance, r released, space or 1-9 a mark, q stops"

_MAX_LINE_LENGTH = 4096


class MarkerKeys:
    """Reader of markers from stdin that never blocks.

    A terminal is switched to single keys, and restored at the end. If this process is in the
    background, or stdin is closed, there are no markers.

    Args:
        keys: marker text of each key.

    Attributes:
        interactive: True if stdin is a terminal whose keys can be read.
        stop_pressed: True after the stop key.
    """

    def __init__(self, keys: Mapping[str, str] = MARKER_KEYS) -> None:
        self._keys = keys
        self.interactive = self.stop_pressed = False
        self._stdin: int | None = None  # None if nothing can be read, also after the end of a pipe
        # Sets the terminal back; None if it was not switched.
        self._restore: Callable[[], None] | None = None
        self._unfinished_line = b""  # bytes of a pipe after its last newline

    def __enter__(self) -> Self:
        with suppress(OSError, ValueError, AttributeError):
            self._stdin = sys.stdin.fileno()
            if os.isatty(self._stdin):
                self._open_terminal(self._stdin)
        return self

    def __exit__(self, *_: object) -> None:
        if self._restore:
            self._restore()
        self._stdin = self._restore = None

    @property
    def ended(self) -> bool:
        """Whether nothing can be read, or no more."""
        return self._stdin is None

    def poll(self) -> list[str]:
        """Return the markers since the last call."""
        data = self._read()
        if not self.interactive:
            *lines, self._unfinished_line = (self._unfinished_line + data).split(b"\n")
            # A pipe without newlines fills no memory.
            if len(self._unfinished_line) > _MAX_LINE_LENGTH:
                lines, self._unfinished_line = [*lines, self._unfinished_line], b""
            texts = (line.decode(errors="replace").strip() for line in lines)
            return [text for text in texts if text]
        keys = data.decode(errors="replace").lower()  # also with caps lock
        self.stop_pressed |= STOP_KEY in keys
        return [self._keys[key] for key in keys if key in self._keys]

    def _open_terminal(self, stdin: int) -> None:
        """Switch the terminal to single keys; this would stop a process in the background."""
        self._stdin = None
        try:
            import termios
            import tty
        except ImportError:  # not a POSIX system
            return
        # The system stops a process in the background that changes the terminal.
        if os.tcgetpgrp(stdin) != os.getpgrp():
            return
        before = termios.tcgetattr(stdin)

        def restore() -> None:
            with suppress(termios.error):  # the terminal is closed
                # After what was written is shown.
                termios.tcsetattr(stdin, termios.TCSADRAIN, before)

        # Before the switch: an interrupt in between leaves the terminal as it was.
        self._stdin, self._restore, self.interactive = stdin, restore, True
        tty.setcbreak(stdin)

    def _read(self) -> bytes:
        if self._stdin is None:
            return b""
        try:
            if not select.select([self._stdin], [], [], 0)[0]:  # 0: never wait
                return b""
            data = os.read(self._stdin, _MAX_LINE_LENGTH)
        except (OSError, ValueError):  # stdin is closed, or cannot be polled
            data = b""
        if not data:  # end of file
            self._stdin = None
            return b"\n"  # ends a last line without a newline
        return data


@dataclass
class StopRequest:
    """Handler of the signals that stop a command.

    Attributes:
        requested: True after the first signal.
        graceful: True if the first signal only sets `requested`. Otherwise every signal raises
            KeyboardInterrupt, and the second one always does.
    """

    requested: bool = False
    graceful: bool = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        if self.requested or not self.graceful:
            raise KeyboardInterrupt
        self.requested = True


@contextmanager
def handle_stop_signals() -> Iterator[StopRequest]:
    """Handle the stop signals inside a `with` block; only in the main thread."""
    stop = StopRequest()
    numbers = []
    if threading.current_thread() is threading.main_thread():  # the only one that may set handlers
        numbers = [signal.SIGINT, signal.SIGTERM]
        hang_up = getattr(signal, "SIGHUP", None)  # Windows has none
        # Under nohup, SIGHUP is ignored: the command goes on when the terminal is closed.
        if hang_up is not None and signal.getsignal(hang_up) is not signal.SIG_IGN:
            numbers.append(hang_up)
    previous = [(number, signal.signal(number, stop)) for number in numbers]
    try:
        yield stop
    finally:
        for number, handler in previous:
            signal.signal(number, handler)
