"""Progress of training: how a caller may show it."""

from collections.abc import Iterable, Iterator
from typing import Protocol, TypeVar

T = TypeVar("T")


class Progress(Protocol):
    """Iteration over items that may show a progress bar."""

    def __call__(self, items: Iterable[T], what: str, total: int) -> Iterator[T]:
        """Yield the items.

        Args:
            items: to yield.
            what: is done with them, in one word.
            total: number of items.
        """
        ...


def show_nothing(items: Iterable[T], what: str, total: int) -> Iterator[T]:
    """Yield the items without a progress bar."""
    del what, total
    return iter(items)
