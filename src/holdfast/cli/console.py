"""What verbs say and print: results to stdout, all talk to stderr."""

import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Self, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress

T = TypeVar("T")

PATIENCE = 2.0
"""A progress bar appears when something takes longer than this [s]."""


def say(text: str) -> None:
    """Tells a person something, on stderr."""
    sys.stderr.write(f"{text}\n")


def complain(text: str) -> None:
    """Tells on stderr, in one line, why there is no result."""
    say(f"holdfast: {' '.join(text.split())}")


def show(text: str = "") -> None:
    """Prints a line of a result for a person, on stdout."""
    sys.stdout.write(f"{text}\n")


def print_json(value: object) -> None:
    """Prints `value` as one line of JSON on stdout; what is not finite becomes null.

    NumPy values, mappings and paths are taken as what they hold.

    Example:
        >>> print_json({"rate": 150.0, "delay": float("nan")})
        {"rate":150.0,"delay":null}
    """
    from msgspec import json

    sys.stdout.write(json.encode(value, enc_hook=_plain).decode() + "\n")


def print_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Prints rows in aligned columns on stdout; numbers stand to the right.

    Example:
        >>> print_table(("sensor", "taxels"), [("gtac", 15), ("anyskin", 5)])
        sensor   taxels
        gtac         15
        anyskin       5
    """
    lines = [[str(cell) for cell in row] for row in (header, *rows)]
    columns = [_aligned(column) for column in zip(*lines, strict=True)]
    for cells in zip(*columns, strict=True):
        show("  ".join(cells).rstrip())


def _aligned(column: Sequence[str]) -> list[str]:
    width = max(len(cell) for cell in column)
    if all(_is_number(cell) for cell in column[1:]):
        return [cell.rjust(width) for cell in column]
    return [cell.ljust(width) for cell in column]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text in ("", "-")
    return True


def progress(items: Iterable[T], what: str, total: int | None = None) -> Iterator[T]:
    """Yields `items`, with a `Bar` that follows them.

    Args:
        items: to go through.
        what: a word or two beside the bar.
        total: how many there are, where `items` has no length.
    """
    n_items = total if total is not None else getattr(items, "__len__", lambda: None)()
    with Bar(what, n_items) as bar:
        for item in items:
            yield item
            bar.advance()


class Bar:
    """A progress bar on stderr, that appears after two seconds and only on a terminal.

    Args:
        what: a word or two beside the bar.
        total: number of steps, where it is known.
    """

    def __init__(self, what: str, total: int | None = None) -> None:
        self._what = what
        self._total = total
        self._n_done = 0
        self._appears = time.monotonic() + PATIENCE if sys.stderr.isatty() else float("inf")
        self._shown: Progress | None = None

    def advance(self, n: int = 1) -> None:
        """Moves on by `n` steps."""
        self._n_done += n
        if self._shown is None and time.monotonic() > self._appears:
            self._shown = _shown(self._what, self._total)
        if self._shown is not None:
            self._shown.update(self._shown.task_ids[0], completed=self._n_done)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown is not None:
            self._shown.stop()


def _shown(what: str, total: int | None) -> "Progress":
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True)
    bar.add_task(what, total=total)
    bar.start()
    return bar


def _plain(value: object) -> object:
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "__fspath__"):
        return str(value)
    raise TypeError(f"{type(value).__name__} is no JSON value")
