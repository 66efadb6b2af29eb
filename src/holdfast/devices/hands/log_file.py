"""A hand that is a file: every command is a line of JSON. For dry runs and tests."""

import os
from pathlib import Path
from typing import BinaryIO

import msgspec
from msgspec import structs

from holdfast.devices.hands.base import HandDevice
from holdfast.errors import HandError
from holdfast.grip.command import GripCommand


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
        """What only one controller may command: the file, by its real path."""
        return f"log:{os.path.realpath(self._path)}"

    def open(self) -> None:
        """Open the file.

        Raises:
            HandError: it cannot be written.
        """
        try:
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
