"""The line that follows a recording while it is made."""

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

from holdfast.cli.terminal.console import say

if TYPE_CHECKING:
    from rich.live import Live

    from holdfast.live.recorder import Recorder, RecorderStatus

REFRESH = 0.25
"""How often the line is written anew on a terminal [s]."""
NOW_AND_THEN = 10.0
"""Where stderr is no terminal, a line is told after so long [s]."""


class RecordLine:
    """How far a recorder is, on stderr: a line in its place, or one now and then.

    Args:
        recorder: that is followed.
    """

    def __init__(self, recorder: "Recorder") -> None:
        self._recorder = recorder
        self._live: Live | None = None
        self._next = 0.0

    def __enter__(self) -> Self:
        self._next = time.monotonic()
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.live import Live

            self._live = Live(console=Console(stderr=True), auto_refresh=False, transient=True)
            self._live.start()
        else:
            self._next += NOW_AND_THEN
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live:
            self._live.stop()

    def say(self, *texts: str) -> None:
        """Tells something above the line."""
        for text in texts:
            if self._live:
                self._live.console.print(text, markup=False, highlight=False)
            else:
                say(text)

    def update(self) -> None:
        """Writes the line anew, where it is time to."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + (REFRESH if self._live else NOW_AND_THEN)
        words = line(self._recorder.status)
        if self._live is None:
            say("   ".join(text for text, _ in words))
            return
        from rich.text import Text

        drawn = Text("   ").join(Text(text, "bold red" if bad else "") for text, bad in words)
        drawn.no_wrap, drawn.overflow = True, "ellipsis"
        self._live.update(drawn, refresh=True)


def line(status: "RecorderStatus") -> list[tuple[str, bool]]:
    """What is told of a recording, piece by piece, and whether it is bad news."""
    faults = [f"{name} {' '.join(here)}" for name, here in status.recent_faults.items()]
    return [
        (f"{status.seconds:.1f} s", False),
        (f"{status.rate:.1f} Hz", False) if status.rate else ("no samples", True),
        (f"gaps {status.n_gaps}", status.n_gaps > 0),
        (f"lost {status.n_lost}", status.n_lost > 0),
        *([(f"dropped {status.n_dropped}", True)] if status.n_dropped else []),
        (size(status.n_bytes), False),
        (f"markers {status.n_markers}", False),
        *((text, True) for text in faults),
    ]


def size(n_bytes: int) -> str:
    """A number of bytes as people read it.

    Example:
        >>> size(900), size(2_500_000)
        ('0.9 kB', '2.5 MB')
    """
    return f"{n_bytes / 1e3:.1f} kB" if n_bytes < 1e6 else f"{n_bytes / 1e6:.1f} MB"
