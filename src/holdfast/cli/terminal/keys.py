"""What a person types, or a script writes, while something runs: one key or line at a time."""

import os
import select
import sys
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Self

STOP = "q"
LABELS = {
    " ": "mark",
    "c": "closing",
    "l": "locked",
    "d": "disturbance",
    "r": "released",
    **{digit: f"mark {digit}" for digit in "123456789"},
}
"""What each key marks."""
LEGEND = "keys: c closing, l locked, d disturbance, r released, space or 1-9 a mark, q stops"

_MOST_LINE = 4096


class Keys:
    """Markers from stdin: keys of a terminal, lines of a pipe; never waits.

    A terminal is set to give single keys, and set back at the end whatever happens. Where this
    process is in the background, or stdin is closed, nothing comes.

    Attributes:
        live: whether a person can press keys.
        stopped: whether the key for it was pressed.
    """

    def __init__(self) -> None:
        self.live = self.stopped = False
        self._stdin: int | None = None
        self._restore: Callable[[], None] | None = None
        self._rest = b""

    def __enter__(self) -> Self:
        with suppress(OSError, ValueError, AttributeError):
            self._stdin = sys.stdin.fileno()
            if os.isatty(self._stdin):
                self._take_terminal(self._stdin)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._restore:
            self._restore()
        self._stdin = self._restore = None

    def poll(self) -> list[str]:
        """The markers since the last time."""
        data = self._read()
        if not self.live:
            return self._lines(data)
        keys = data.decode(errors="replace").lower()
        self.stopped |= STOP in keys
        return [LABELS[key] for key in keys if key in LABELS]

    def _take_terminal(self, stdin: int) -> None:
        """Gets single keys of a terminal, unless that would stop a process in the background."""
        self._stdin = None
        try:
            import termios
            import tty
        except ImportError:  # no POSIX
            return
        if os.tcgetpgrp(stdin) != os.getpgrp():
            return
        before = termios.tcgetattr(stdin)

        def restore() -> None:
            with suppress(termios.error):  # the terminal has gone
                termios.tcsetattr(stdin, termios.TCSADRAIN, before)

        self._stdin, self._restore, self.live = stdin, restore, True
        tty.setcbreak(stdin)

    def _read(self) -> bytes:
        if self._stdin is None:
            return b""
        try:
            if not select.select([self._stdin], [], [], 0)[0]:
                return b""
            data = os.read(self._stdin, _MOST_LINE)
        except (OSError, ValueError):  # it is closed, or nothing that can be waited for
            data = b""
        if not data:  # nothing will come any more
            self._stdin = None
            return b"\n"
        return data

    def _lines(self, data: bytes) -> list[str]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > _MOST_LINE:
            lines, self._rest = [*lines, self._rest], b""
        texts = (line.decode(errors="replace").strip() for line in lines)
        return [text for text in texts if text]
