"""The status line of a recording in progress, on stderr."""

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

from holdfast.cli.terminal.console import print_message, visible

if TYPE_CHECKING:
    from rich.live import Live

    from holdfast.live.recorder import Recorder, RecorderStatus

REFRESH_INTERVAL = 0.25
"""Time between two updates of the line on a terminal [s]."""
MESSAGE_INTERVAL = 10.0
"""Time between two lines where stderr is no terminal [s]."""


class StatusLine:
    """Status of a recorder: on a terminal one updated line, elsewhere one line every 10 s.

    Args:
        recorder: a recorder that is open.
    """

    def __init__(self, recorder: "Recorder") -> None:
        self._recorder = recorder
        self._live: Live | None = None
        self._next_update = 0.0

    def __enter__(self) -> Self:
        self._next_update = time.monotonic()
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.live import Live

            self._live = Live(
                console=Console(stderr=True),
                auto_refresh=False,
                transient=True,
                redirect_stdout=False,
            )
            self._live.start()
        else:
            self._next_update += MESSAGE_INTERVAL
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live:
            self._live.stop()

    def print(self, *texts: str) -> None:
        """Print messages above the line."""
        for text in texts:
            if self._live:
                self._live.console.print(visible(text), markup=False, highlight=False)
            else:
                print_message(text)

    def update(self) -> None:
        """Print the status if the time for the next update has come."""
        now = time.monotonic()
        if now < self._next_update:
            return
        self._next_update = now + (REFRESH_INTERVAL if self._live else MESSAGE_INTERVAL)
        parts = status_parts(self._recorder.status)
        if self._live is None:
            print_message("   ".join(text for text, _ in parts))
            return
        from rich.text import Text

        line = Text("   ").join(
            Text(visible(text), "bold red" if bad else "") for text, bad in parts
        )
        line.no_wrap, line.overflow = True, "ellipsis"
        self._live.update(line, refresh=True)


def status_parts(status: "RecorderStatus") -> list[tuple[str, bool]]:
    """Return the parts of the status line; each with True if it reports a problem."""
    faults = [f"{name} {' '.join(here)}" for name, here in status.recent_faults.items()]
    return [
        (f"{status.seconds:.1f} s", False),
        (f"{status.rate:.1f} Hz", False) if status.rate else ("no samples", True),
        (f"gaps {status.n_gaps}", status.n_gaps > 0),
        (f"lost {status.n_lost}", status.n_lost > 0),
        *([(f"dropped {status.n_dropped}", True)] if status.n_dropped else []),
        (format_size(status.n_bytes), False),
        (f"markers {status.n_markers}", False),
        *((text, True) for text in faults),
    ]


def format_size(n_bytes: int) -> str:
    """Return a number of bytes in kB or MB.

    Example:
        >>> format_size(900), format_size(2_500_000)
        ('0.9 kB', '2.5 MB')
    """
    return f"{n_bytes / 1e3:.1f} kB" if n_bytes < 1e6 else f"{n_bytes / 1e6:.1f} MB"
