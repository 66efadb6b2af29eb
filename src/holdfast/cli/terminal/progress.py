"""Progress bars, and the status lines of a recording and of a server, on stderr."""

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from datetime import timedelta
from threading import Lock, Timer
from typing import TYPE_CHECKING, Self, TypeVar

from holdfast.cli.terminal.console import print_message, visible

if TYPE_CHECKING:
    from rich.live import Live
    from rich.progress import Progress

    from holdfast.live.publishers.orca_port import OrcaPort
    from holdfast.live.publishers.xela_server import XelaServer
    from holdfast.live.recorder import Recorder, RecorderStatus

T = TypeVar("T")

DISPLAY_DELAY = 2.0
"""Time after which a progress bar appears [s]."""

PROGRESS_INTERVAL = 60.0
"""Minimum time between two progress messages where stderr is no terminal [s]."""

MIN_ESTIMATE_SHARE = 0.03
"""Share of the work that must be done before the remaining time is estimated."""

MIN_ESTIMATE_TIME = 3.0
"""Time that the work must have taken before the remaining time is estimated [s]."""


REFRESH_INTERVAL = 0.25
"""Time between two updates of the status line on a terminal [s]."""
STATUS_INTERVAL = 10.0
"""Time between two status lines where stderr is no terminal [s]."""
END_POLL_INTERVAL = 0.2
"""Time between two checks whether a server has ended [s]."""
PLAY_REFRESH_INTERVAL = 1.0
"""Time between two updates of the rate of a server on a terminal [s]."""


def progress(
    items: Iterable[T],
    what: str,
    total: float | None = None,
    cost: Callable[[T], float] = lambda _: 1.0,
) -> Iterator[T]:
    """Yield the items, and show the progress.

    Args:
        items: any items.
        what: one or two words for the bar.
        total: sum of the costs of all items; by default the length of `items`, if it has one.
        cost: function that returns the cost of an item, in any unit.
    """
    length = total if total is not None else getattr(items, "__len__", lambda: None)()
    with ProgressBar(what, length) as bar:
        for item in items:
            yield item
            bar.advance(cost(item))


class ProgressBar:
    """Progress on stderr with the remaining time.

    On a terminal it is a bar, elsewhere one message per minute. It appears after two seconds, and
    the remaining time after three seconds and 3 % of the work. Stdout is not touched: it may be
    a file or a pipe.

    Args:
        description: one or two words for the bar.
        total: number of steps, or sum of their costs; None if it is not known.
    """

    def __init__(self, description: str, total: float | None = None) -> None:
        self._description = description
        self._total = total
        self._done = 0.0  # sum of the costs of finished steps
        self._started_at = self._last_message_at = time.monotonic()  # [s, monotonic]
        self._bar: Progress | None = None  # None until it appears
        self._lock = Lock()  # the timer and `advance` start the bar in two threads
        # A first step may take minutes, and only then is `advance` called.
        self._timer = Timer(DISPLAY_DELAY, self._display)
        self._timer.daemon = True

    def advance(self, cost: float = 1.0) -> None:
        """Add the cost of a finished step."""
        self._done += cost
        if not sys.stderr.isatty():
            now = time.monotonic()
            if self._total and now - self._last_message_at > PROGRESS_INTERVAL:
                self._last_message_at = now
                left = self._expected_duration() - (now - self._started_at)
                text = "" if math.isnan(left) else f", about {left / 60:.0f} min left"
                print_message(f"{self._description}: {self._done / self._total:.0%}{text}")
        elif time.monotonic() - self._started_at > DISPLAY_DELAY:
            self._display()

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        with self._lock:
            if self._bar is not None:
                self._bar.stop()

    def _display(self) -> None:
        with self._lock:
            self._bar = self._bar or _start_bar(self._description, self._total)
            self._bar.update(
                self._bar.task_ids[0],
                completed=self._done,
                ends=self._started_at + self._expected_duration(),
            )

    def _expected_duration(self) -> float:
        """Return the expected time from start to end [s]; NaN if it is not known yet."""
        taken = time.monotonic() - self._started_at
        share = self._done / self._total if self._total else 0.0
        if share < MIN_ESTIMATE_SHARE or taken < MIN_ESTIMATE_TIME:
            return math.nan
        return taken / share


def _start_bar(description: str, total: float | None) -> "Progress":
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn
    from rich.text import Text

    class TimeLeft(ProgressColumn):
        """Remaining time by the costs of all steps; rich uses only the last 30 s."""

        def render(self, task: Task) -> Text:
            left = task.fields["ends"] - task.get_time()
            return Text(_format_time(left), style="progress.remaining")

    bar = Progress(
        "{task.description}",
        BarColumn(),
        TaskProgressColumn(),
        TimeLeft(),
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=False,  # messages on stderr appear above the bar; data are left alone
    )
    bar.add_task(description, total=total, ends=math.nan)
    bar.start()
    return bar


def _format_time(seconds: float) -> str:
    """Return a time as hours, minutes and seconds.

    Example:
        >>> _format_time(3725.4), _format_time(-1.0), _format_time(float("nan"))
        ('1:02:05', '0:00:00', '-:--:--')
    """
    return "-:--:--" if math.isnan(seconds) else str(timedelta(seconds=max(0, round(seconds))))


class LiveDisplay:
    """Lines on stderr that are drawn again, where it is a terminal."""

    def __init__(self) -> None:
        self._live: Live | None = None  # None where stderr is no terminal

    def __enter__(self) -> Self:
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
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._live.stop()

    def print(self, *texts: str) -> None:
        """Print messages above the lines."""
        for text in texts:
            if self._live:
                self._live.console.print(visible(text), markup=False, highlight=False)
            else:
                print_message(text)


class StatusLine(LiveDisplay):
    """Status of a recorder: on a terminal one updated line, elsewhere one line every 10 s.

    Args:
        recorder: a recorder that is open.
    """

    def __init__(self, recorder: "Recorder") -> None:
        super().__init__()
        self._recorder = recorder
        self._next_update = 0.0  # [s, monotonic]

    def __enter__(self) -> Self:
        super().__enter__()
        self._next_update = time.monotonic() + (0.0 if self._live else STATUS_INTERVAL)
        return self

    def update(self) -> None:
        """Print the status if the time for the next update has come."""
        now = time.monotonic()
        if now < self._next_update:
            return
        self._next_update = now + (REFRESH_INTERVAL if self._live else STATUS_INTERVAL)
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


def show_clients(server: "XelaServer | OrcaPort") -> None:
    """Show the number of clients of a server until it ends.

    A terminal has one line that is overwritten, with the rate; elsewhere each change is a line.
    """
    on_terminal = sys.stderr.isatty()
    updated_at, n_sent, n_clients = time.monotonic(), 0, -1
    while not server.wait(END_POLL_INTERVAL):
        now, number = time.monotonic(), server.n_clients
        clients = "1 client" if number == 1 else f"{number} clients"
        if not number:
            clients = f"waiting for a client on port {server.port}"
        if on_terminal and now - updated_at >= PLAY_REFRESH_INTERVAL:
            rate = (server.n_packets - n_sent) / (now - updated_at)
            # `\033[K` erases the rest of a longer line.
            sys.stderr.write(f"\r{clients}, {rate:.1f} packets/s \033[K")
            updated_at, n_sent = now, server.n_packets
        elif not on_terminal and number != n_clients:
            n_clients = number
            print_message(clients)
    if on_terminal:
        print_message("")  # ends the line that was overwritten
