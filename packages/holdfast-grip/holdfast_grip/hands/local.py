"""Hands without a network: a function of Python that gets one force, and a file for dry runs."""

import math
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import BinaryIO

import msgspec
from msgspec import structs

from holdfast_grip.command import GripCommand
from holdfast_grip.errors import HandError
from holdfast_grip.hands.base import HandDevice


class ScalarGripper(HandDevice):
    """Gripper that takes one number: the force scale, or 0 to open.

    The function is called when the number changes, and not before the grip begins. Attributes of
    the function can ask for more: `heartbeat` [s] and `needs_idle`, as of `HandDevice`.

    Args:
        function: is called with the scale at each command.
        name: URI of the hand.
        resource: as of `HandDevice`; by default the name.

    Raises:
        ValueError: the `heartbeat` of the function is no time.

    Example:
        >>> from holdfast_grip import FingerCommand, LoopState
        >>> fingers = {"finger1": FingerCommand(1.2), "finger2": FingerCommand(1.5)}
        >>> with ScalarGripper(print) as gripper:
        ...     _ = gripper.send(GripCommand(0.0, LoopState.REACT, fingers))
        ...     _ = gripper.send(GripCommand(0.1, LoopState.FAULT, fingers, release=True))
        1.5
        0.0
    """

    def __init__(
        self, function: Callable[[float], object], name: str = "call:", resource: str | None = None
    ) -> None:
        self.name = name
        beat = getattr(function, "heartbeat", None)
        if beat is not None and not (isinstance(beat, int | float) and 0.0 < beat < math.inf):
            raise ValueError(
                f"{name}: the attribute heartbeat of the function: a time above 0 s expected, "
                f"{beat!r} given"
            )
        self.heartbeat = None if beat is None else float(beat)
        self.needs_idle = bool(getattr(function, "needs_idle", False))
        self._function = function
        self._resource = name if resource is None else resource
        self._is_open = False

    @classmethod
    def from_path(cls, path: str, name: str) -> "ScalarGripper":
        """Return the gripper of a function, given as MODULE:FUNCTION.

        The module is one that Python finds, or else one in the working folder.

        Raises:
            ValueError: there is no such module or function.
        """
        module_name, _, function = path.partition(":")
        try:
            module = _import(module_name)
            function_of_user = getattr(module, function)
        except (ImportError, AttributeError, ValueError) as cause:
            raise ValueError(f"{name}: call:MODULE:FUNCTION expected ({cause})") from cause
        if not callable(function_of_user):
            raise ValueError(f"{name}: {path} is no function")
        return cls(function_of_user, name, _resource(module, function))

    @property
    def resource(self) -> str:
        """Name of the claim: the function, by the file that defines it."""
        return self._resource

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


def _import(name: str) -> ModuleType:
    """Import a module; search the working folder last, and for this import only.

    Raises:
        ImportError: there is no such module.
    """
    here = str(Path.cwd())
    if here in sys.path:
        return import_module(name)
    # Last, so that a file here does not replace an installed module.
    sys.path.append(here)
    try:
        return import_module(name)
    finally:
        with suppress(ValueError):  # the module may have removed it
            sys.path.remove(here)


def _resource(module: ModuleType, name: str) -> str:
    """Return the same text for all names by which modules import a function."""
    function = getattr(module, name)
    home = sys.modules.get(getattr(function, "__module__", None) or "")
    own_name = getattr(function, "__qualname__", "")
    # Functions that were made by a call have no name of their own by which they are found.
    if home is not None and own_name and getattr(home, own_name, None) is function:
        module, name = home, own_name
    file = getattr(module, "__file__", None)
    return f"call:{os.path.realpath(file) if file else module.__name__}:{name}"


def largest_scale(command: GripCommand) -> float:
    """Return the force scale of a gripper: the largest of all fingers, 1 without any."""
    return max((finger.scale for finger in command.fingers.values()), default=1.0)


class LogFile(HandDevice):
    """Hand that appends each command to a file, except one that differs in its time alone.

    Args:
        name: URI of the hand.
        path: of the file; it is created if it does not exist.
    """

    def __init__(self, name: str, path: str | Path) -> None:
        self.name = name
        self._path = Path(path)
        self._file: BinaryIO | None = None

    @property
    def resource(self) -> str:
        """Name of the claim: the file, by its real path."""
        return f"log:{os.path.realpath(self._path)}"

    def open(self) -> None:
        """Open the file.

        Raises:
            HandError: it cannot be written.
        """
        try:
            # Without a buffer, so that no command is lost if the process dies.
            self._file = self._path.open("ab", buffering=0)
        except OSError as cause:
            raise HandError(f"cannot write {self._path}: {cause.strerror}") from cause

    def _send(self, command: GripCommand) -> None:
        try:
            if self._file is None:
                raise HandError(f"{self.name} is not open")
            self._file.write(msgspec.json.encode(command) + b"\n")
        except OSError as cause:
            raise HandError(f"cannot write {self._path}: {cause.strerror}") from cause

    def _content(self, command: GripCommand) -> object:
        return structs.replace(command, time=0.0)

    def close(self) -> None:
        """Close the file."""
        self.forget()
        if self._file is not None:
            self._file.close()
            self._file = None
