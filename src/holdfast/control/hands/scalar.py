"""Grippers with one force: a Python function gets the largest scale of all fingers."""

import math
from collections.abc import Callable
from importlib import import_module

from holdfast.control.command import GripCommand
from holdfast.control.hands.base import Hand
from holdfast.errors import HandError


class ScalarGripper(Hand):
    """Gripper that takes one number: the force scale, or 0 to open.

    The function is called when the number changes, and not before the grip begins. Attributes of
    the function can ask for more: `heartbeat` [s] and `needs_idle`, as of `Hand`.

    Args:
        function: is called with the scale at each command.
        name: URI of the hand.

    Raises:
        ValueError: the `heartbeat` of the function is no time.

    Example:
        >>> from holdfast.control import FingerCommand, LoopState
        >>> fingers = {"finger1": FingerCommand(1.2), "finger2": FingerCommand(1.5)}
        >>> with ScalarGripper(print) as gripper:
        ...     _ = gripper.send(GripCommand(0.0, LoopState.REACT, fingers))
        ...     _ = gripper.send(GripCommand(0.1, LoopState.FAULT, fingers, release=True))
        1.5
        0.0
    """

    def __init__(self, function: Callable[[float], object], name: str = "call:") -> None:
        self.name = name
        self.heartbeat = _heartbeat(function, name)
        self.needs_idle = bool(getattr(function, "needs_idle", False))
        self._function = function
        self._is_open = False

    @classmethod
    def from_path(cls, path: str, name: str) -> "ScalarGripper":
        """Return the gripper of a function, given as MODULE:FUNCTION.

        Raises:
            ValueError: there is no such module or function.
        """
        module, _, function = path.partition(":")
        try:
            found = getattr(import_module(module), function)
        except (ImportError, AttributeError, ValueError) as cause:
            raise ValueError(f"{name}: call:MODULE:FUNCTION expected ({cause})") from cause
        if not callable(found):
            raise ValueError(f"{name}: {path} is no function")
        return cls(found, name)

    def open(self) -> None:
        """Take commands from now on."""
        self._is_open = True

    def _send(self, command: GripCommand) -> None:
        if not self._is_open:
            raise HandError(f"{self.name} is not open")
        try:
            self._function(self._content(command))
        except Exception as cause:  # the function is the user's
            raise HandError(f"{self.name}: {type(cause).__name__}: {cause}") from cause

    def _content(self, command: GripCommand) -> float:
        return 0.0 if command.release else largest_scale(command)

    def close(self) -> None:
        """Take no more commands."""
        self.forget()
        self._is_open = False


def largest_scale(command: GripCommand) -> float:
    """Return the force scale of a gripper: the largest of all fingers, 1 without any."""
    return max((one.scale for one in command.fingers.values()), default=1.0)


def _heartbeat(function: Callable[[float], object], name: str) -> float | None:
    """Return the attribute `heartbeat` of a function [s]; None without one."""
    found = getattr(function, "heartbeat", None)
    if found is None:
        return None
    if not isinstance(found, int | float) or not 0.0 < found < math.inf:
        raise ValueError(
            f"{name}: the attribute heartbeat of the function: a time above 0 s expected, "
            f"{found!r} given"
        )
    return float(found)
