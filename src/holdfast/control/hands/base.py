"""What every hand does with commands."""

import math
from abc import abstractmethod
from collections.abc import Iterable

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
        """Name of what only one controller may command; the same for all URIs of one hand."""
        return self.name

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
