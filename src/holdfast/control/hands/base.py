"""What every hand does with commands."""

import hashlib
import os
import tempfile
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from holdfast.control.command import GripCommand
from holdfast.errors import HandError


class Hand(ABC):
    """Hand that takes commands. A context manager: entering it connects.

    Only `open` waits for the hand. `send` returns at once. After `close`, the hand keeps the
    last command that it got, so the owner sends a safe one before.

    Attributes:
        name: URI of the hand.
    """

    name: str = ""

    @abstractmethod
    def open(self) -> None:
        """Connect.

        Raises:
            HandError: the hand does not answer, or is another one than expected.
        """

    @abstractmethod
    def send(self, command: GripCommand) -> None:
        """Send a command.

        Raises:
            HandError: the hand refuses it, or is disconnected.
        """

    @abstractmethod
    def close(self) -> None:
        """Disconnect. It has no effect on a hand that is closed."""

    def __enter__(self) -> Self:
        try:
            self.open()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class Claim:
    """Claim on a hand, so that one process of this machine controls it at a time.

    The claim of a process that died ends with it.

    Args:
        name: URI of the hand.
    """

    def __init__(self, name: str) -> None:
        digest = hashlib.sha256(name.encode()).hexdigest()[:16]
        self._path = Path(tempfile.gettempdir()) / f"holdfast-hand-{digest}.lock"
        self._name = name
        self._file: int | None = None

    def __enter__(self) -> Self:
        import fcntl

        try:
            self._file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as cause:
            self._release()
            raise HandError(
                f"{self._name} has another controller already: stop that one first"
            ) from cause
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._release()

    def _release(self) -> None:
        if self._file is not None:
            with suppress(OSError):
                os.close(self._file)
            self._file = None
