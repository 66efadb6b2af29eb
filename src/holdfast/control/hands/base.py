"""What every hand does with commands."""

import hashlib
import math
import os
import tempfile
from abc import abstractmethod
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from holdfast.control.command import GripCommand
from holdfast.control.limits import Limits
from holdfast.errors import HandError
from holdfast.openable import Openable


class Hand(Openable):
    """Hand that takes commands. A context manager: entering it connects.

    Only `open` waits for the hand. `send` returns at once. After `close`, the hand keeps the
    last command that it got, so the owner sends a safe one before.

    Attributes:
        name: URI of the hand.
        fingers: fingers that the hand has; None if it takes the commands of any.
    """

    name: str = ""
    fingers: tuple[str, ...] | None = None

    @property
    def resource(self) -> str:
        """What only one controller may command; two URIs of one hand have the same."""
        return self.name

    @property
    def silent(self) -> bool:
        """Whether an open hand that reports its state has not done so for too long.

        No force changes meanwhile.
        """
        return False

    def check(self, limits: Limits, fingers: Iterable[str]) -> None:
        """Check, before anything is sent, that the hand can do what the limits allow.

        Args:
            limits: limits of the commands.
            fingers: fingers that will be commanded.

        Raises:
            ValueError: the hand lacks a finger, or the highest scale exceeds its ceiling.
        """
        if unknown := self._unknown(fingers):
            raise ValueError(unknown)

    @abstractmethod
    def open(self) -> None:
        """Connect.

        Raises:
            HandError: the hand does not answer, or is another one than expected.
        """

    def send(self, command: GripCommand) -> None:
        """Send a command.

        Raises:
            HandError: the hand refuses it, or is disconnected.
        """
        if unknown := self._unknown(command.fingers):
            raise HandError(unknown)
        for finger, one in command.fingers.items():
            if not (math.isfinite(one.scale) and one.scale >= 0.0):
                raise HandError(
                    f"{self.name}: a scale of at least 0 expected, {one.scale:g} given for {finger}"
                )
        self._send(command)

    @abstractmethod
    def _send(self, command: GripCommand) -> None:
        """Send a command that was checked.

        Raises:
            HandError: the hand refuses it, or is disconnected.
        """

    @abstractmethod
    def close(self) -> None:
        """Disconnect. It has no effect on a hand that is closed."""

    def _unknown(self, fingers: Iterable[str]) -> str:
        """Return a message about fingers that the hand does not have; empty if there are none."""
        if self.fingers is None:
            return ""
        for finger in fingers:
            if finger not in self.fingers:
                return f"{self.name} has {', '.join(self.fingers)}; {finger!r} commanded"
        return ""


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
