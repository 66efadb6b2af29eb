"""The format `pins-log`: text files `*.pins`, one sample a line.

A line has the time [s], then x, y and z of each taxel [count], with spaces between them.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from holdfast.errors import RecordingError
from holdfast.files import read_input
from holdfast.io.importers import IF_IN_CONTACT
from holdfast.recordings import Recording, Tactile
from holdfast_pins.skin import pin_skin

SUFFIX = ".pins"
MAX_FILE_SIZE = 1 << 28
"""A larger file is refused [bytes]: everything that is read is untrusted."""
HINT = IF_IN_CONTACT
"""Is printed after each import."""


def can_read(path: Path) -> bool:
    """Return whether `path` is such a file, or a folder with one."""
    return bool(_files(path))


def parts(path: Path) -> list[Path]:
    """Return the file, or the files of a folder.

    Raises:
        RecordingError: there is none.
    """
    if not (files := _files(path)):
        raise RecordingError(f"no file *{SUFFIX} in {path}")
    return files


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path] if path.suffix == SUFFIX else []
    return sorted(path.glob(f"*{SUFFIX}"))


def read(path: Path) -> Iterator[Recording]:
    """Yield the recording in a file.

    Raises:
        RecordingError: a line has another number of values.
    """
    skin = pin_skin()
    rows = [line.split() for line in read_input(path, MAX_FILE_SIZE).decode("utf-8").splitlines()]
    expected = 1 + 3 * skin.n_taxels
    for number, row in enumerate(rows, start=1):
        if len(row) != expected:
            raise RecordingError(f"{path}, line {number}: {len(row)} values, {expected} expected")
    if not rows:
        raise RecordingError(f"{path} is empty; lines of {expected} values expected")
    values = np.array(rows, dtype=np.float64)
    readings = values[:, 1:].reshape(-1, skin.n_taxels, 3)
    modules = {"finger1": Tactile(skin, values[:, 0], readings)}
    yield Recording(path.stem, modules, {"source": "pin logger"})
