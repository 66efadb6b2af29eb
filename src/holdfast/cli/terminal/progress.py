"""Progress bars on stderr."""

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from datetime import timedelta
from threading import Lock, Timer
from typing import TYPE_CHECKING, Self, TypeVar

from holdfast.cli.terminal.console import say

if TYPE_CHECKING:
    from rich.progress import Progress

T = TypeVar("T")

PATIENCE = 2.0
"""A progress bar appears when something takes longer than this [s]."""

NOW_AND_THEN = 60.0
"""Where stderr is no terminal, progress is told in a line after so long [s]."""


def progress(
    items: Iterable[T],
    what: str,
    total: float | None = None,
    cost: Callable[[T], float] = lambda _: 1.0,
) -> Iterator[T]:
    """Yields `items`, with a `Bar` that follows them.

    Args:
        items: to go through.
        what: a word or two beside the bar.
        total: of the costs of all of them; how many there are, where `items` has a length.
        cost: of an item, in any unit.
    """
    known = total if total is not None else getattr(items, "__len__", lambda: None)()
    with Bar(what, known) as bar:
        for item in items:
            yield item
            bar.advance(cost(item))


class Bar:
    """Progress on stderr with the time left: on a terminal a bar, elsewhere a line a minute.

    It appears when something takes longer than two seconds.

    Args:
        what: a word or two beside the bar.
        total: number of steps, or sum of their costs, where it is known.
    """

    def __init__(self, what: str, total: float | None = None) -> None:
        self._what = what
        self._total = total
        self._done = 0.0
        self._begun = self._told = time.monotonic()
        self._shown: Progress | None = None
        self._lock = Lock()
        self._soon = Timer(PATIENCE, self._show)
        self._soon.daemon = True

    def advance(self, cost: float = 1.0) -> None:
        """Moves on by `cost`."""
        self._done += cost
        if not sys.stderr.isatty():
            self._tell()
        elif time.monotonic() - self._begun > PATIENCE:
            self._show()

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            self._soon.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._soon.cancel()
        with self._lock:
            if self._shown is not None:
                self._shown.stop()

    def _show(self) -> None:
        with self._lock:
            self._shown = self._shown or _shown(self._what, self._total)
            self._shown.update(
                self._shown.task_ids[0], completed=self._done, ends=self._begun + self._lasts()
            )

    def _tell(self) -> None:
        """Now and then a line for the log of a job that nobody watches."""
        now = time.monotonic()
        if self._total and now - self._told > NOW_AND_THEN:
            self._told = now
            left = self._lasts() - (now - self._begun)
            say(f"{self._what}: {self._done / self._total:.0%}, about {left / 60:.0f} min left")

    def _lasts(self) -> float:
        """How long all will have taken, should it go on as it went [s]; NaN where unknown."""
        if not self._done or not self._total:
            return math.nan
        return (time.monotonic() - self._begun) * self._total / self._done


def _shown(what: str, total: float | None) -> "Progress":
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn
    from rich.text import Text

    class TimeLeft(ProgressColumn):
        """Counts down to the end as the costs foretell it; rich looks at the last 30 s only."""

        def render(self, task: Task) -> Text:
            left = task.fields["ends"] - task.get_time()
            return Text(_clock(left), style="progress.remaining")

    bar = Progress(
        "{task.description}",
        BarColumn(),
        TaskProgressColumn(),
        TimeLeft(),
        console=Console(stderr=True),
        transient=True,
    )
    bar.add_task(what, total=total, ends=math.nan)
    bar.start()
    return bar


def _clock(seconds: float) -> str:
    """A time as people read it.

    Example:
        >>> _clock(3725.4), _clock(-1.0), _clock(float("nan"))
        ('1:02:05', '0:00:00', '-:--:--')
    """
    return "-:--:--" if math.isnan(seconds) else str(timedelta(seconds=max(0, round(seconds))))
