"""Context managers of what is closed, and of what is opened and closed."""

from abc import ABC, abstractmethod
from typing import Self


class Closable(ABC):
    """Base class of what is open from the start, as a writer of a file. Leaving it closes."""

    @abstractmethod
    def close(self) -> None:
        """Close. It has no effect on what is closed."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Openable(Closable):
    """Base class of what has a connection. Entering it opens, leaving it closes.

    If opening fails, it is closed, so that nothing stays half open.

    Example:
        >>> class Door(Openable):
        ...     def open(self):
        ...         print("open")
        ...     def close(self):
        ...         print("closed")
        >>> with Door():
        ...     pass
        open
        closed
    """

    @abstractmethod
    def open(self) -> None:
        """Connect."""

    def __enter__(self) -> Self:
        try:
            self.open()
        except BaseException:
            self.close()
            raise
        return self
