"""Journal of a parameter search: a file of its trials, from which a stopped search resumes."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from holdfast.errors import OutputError


class _Trial(msgspec.Struct, frozen=True):
    search: str
    parameters: dict[str, float | str | None]
    loss: float


class Journal:
    """Losses of the trials of one search, by their parameters; one line of JSON for each trial.

    The key of a search depends on its samples and its setting, so that the losses are never used
    with other data or another setting. Several searches may write to one file, also at the same
    time. Incomplete lines are ignored.

    Args:
        path: of the file, which is created with the first trial.
        search: key of the search, from `search_key`.

    Raises:
        OutputError: the file cannot be read.
    """

    def __init__(self, path: Path, search: str) -> None:
        self._path = path
        self._search = search
        self._losses = {_text(t.parameters): t.loss for t in _trials(path) if t.search == search}

    def find(self, parameters: Mapping[str, Any]) -> float | None:
        """Return the loss of some parameters; None if they have not been tried."""
        return self._losses.get(_text(parameters))

    def add(self, parameters: Mapping[str, Any], loss: float) -> None:
        """Append the loss of some parameters.

        Raises:
            OutputError: the file cannot be written.
        """
        self._losses[_text(parameters)] = loss
        line = msgspec.json.encode(_Trial(self._search, dict(parameters), loss))
        try:
            with self._path.open("ab", buffering=0) as file:
                file.write(b"\n" + line + b"\n")  # one write: parallel searches do not mix
        except OSError as cause:
            raise OutputError(f"cannot write {self._path}: {cause.strerror}") from cause


def search_key(*parts: object) -> str:
    """Return a hash of arrays and plain values."""
    state = hashlib.blake2b(digest_size=16)
    for part in parts:
        if isinstance(part, np.ndarray):
            state.update(repr((part.dtype.str, part.shape)).encode())
            state.update(np.ascontiguousarray(part).data)
        else:
            state.update(repr(part).encode())
    return state.hexdigest()


def _trials(path: Path) -> list[_Trial]:
    try:
        lines = path.read_bytes().splitlines() if path.exists() else []
    except OSError as cause:
        raise OutputError(f"cannot read {path}: {cause.strerror}") from cause
    found = []
    for line in filter(None, lines):
        try:
            found.append(msgspec.json.decode(line, type=_Trial))
        except ValueError:  # msgspec's own errors are ValueErrors
            continue
    return found


def _text(parameters: Mapping[str, Any]) -> str:
    return repr(sorted(parameters.items()))
