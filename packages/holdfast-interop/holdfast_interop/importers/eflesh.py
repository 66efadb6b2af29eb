"""Import of tugs at held objects with eFlesh fingertips: a tensor of torch for each sequence.

A file `seq_N.pt` is a zip archive. Its member `data/0` has the values as they are in memory, its
member `data.pkl` the program of a pickle that would build the tensor. The values are read, and
the pickle is never run: only the name of the number type is looked up in its bytes.
`labels.csv` beside the files has one label for each sequence, or `labels`, as the authors have it:
line N, from 0, is that of `seq_N`.
"""

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.files import check_regular, read_input
from holdfast.io.importers import IN_CONTACT
from holdfast.io.importers.table import SLIPPED, natural_order, read_table
from holdfast.recordings import STARTS_LOADED, Recording, Tactile
from holdfast.sensors import sensor

HINT = f"{IN_CONTACT}; whether the object slipped is in the metadata (slipped)"
SOURCE = "notvenky/eFlesh"
TENSOR_SUFFIX = ".pt"
LABELS_FILE, LABEL_LINES_FILE = "labels.csv", "labels"
MAX_LABEL_LINES_SIZE = 1 << 20
"""Size above which a file of label lines is refused [bytes]."""
N_FINGERTIPS = 2
N_MAGNETOMETERS = 5
NUMBER_TYPE = np.dtype("<f4")
ROW_SIZE = N_FINGERTIPS * N_MAGNETOMETERS * 3 * NUMBER_TYPE.itemsize
"""Size of the values of one instant [bytes]."""
SEQUENCE_RATE = 100.0
"""Nominal rate; the files have no times [Hz]."""

_ZIP_MAGIC = b"PK\x03\x04"
_STORAGE = re.compile(rb"[A-Z][A-Za-z]{1,20}Storage\b")
_FORM = f"{N_FINGERTIPS} fingertips x {N_MAGNETOMETERS} magnetometers x 3 axes of float32"


def can_read(path: Path) -> bool:
    """Return whether `path` is a file of torch, or a folder with sequences."""
    if path.is_dir():
        return bool(sequences_in(path))
    if path.suffix != TENSOR_SUFFIX:
        return False
    with path.open("rb") as file:
        return file.read(len(_ZIP_MAGIC)) == _ZIP_MAGIC


def parts(path: Path) -> list[Path]:
    """Return the file, or the sequences of a folder in natural order.

    Raises:
        RecordingError: there is none.
    """
    files = [path] if path.is_file() else sequences_in(path)
    if not files:
        raise RecordingError(f"no eflesh sequence in {path}; files seq_N{TENSOR_SUFFIX} expected")
    return files


def sequences_in(folder: Path) -> list[Path]:
    """Return the sequences of a folder in natural order."""
    return sorted(folder.glob(f"seq_*{TENSOR_SUFFIX}"), key=natural_order)


def read(path: Path) -> Iterator[Recording]:
    """Yield the recording in a file.

    Raises:
        RecordingError: it has another form, or is cut or damaged.
    """
    check_regular(path)
    if not path.stat().st_size:
        raise RecordingError(f"{path} is empty; a tensor saved by torch expected")
    values = read_tensor(path)
    times = np.arange(len(values)) / SEQUENCE_RATE
    skin = sensor("anyskin")
    modules = {
        f"finger{k + 1}": Tactile(skin, times, values[:, k].copy()) for k in range(N_FINGERTIPS)
    }
    metadata: dict[str, Any] = {
        "source": SOURCE,
        "clock": f"none; {SEQUENCE_RATE:g} Hz assumed",
        STARTS_LOADED: True,
    }
    slipped = slipped_by_sequence(path.parent).get(path.stem)
    yield Recording(
        path.stem, modules, metadata if slipped is None else metadata | {SLIPPED: slipped}
    )


def read_tensor(path: Path) -> npt.NDArray[np.float32]:
    """Return (n_samples, n_fingertips, n_magnetometers, 3).

    Raises:
        RecordingError: the file is no such archive, or its values have another form.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            # Byte order and number type, where the archive names them; nothing is unpickled.
            for info in members:
                name = info.filename.rpartition("/")[2]
                if name not in ("byteorder", "data.pkl"):
                    continue
                content = archive.read(info)
                if name == "byteorder" and content.strip() != b"little":
                    raise RecordingError(
                        f"{path}: byte order {content[:20]!r} given, b'little' expected"
                    )
                kinds = {match.decode() for match in _STORAGE.findall(content)} - {"FloatStorage"}
                if name == "data.pkl" and kinds:
                    raise RecordingError(f"{path}: a {min(kinds)} given; {_FORM} expected")
            storages = [info for info in members if re.search(r"(^|/)data/\d+$", info.filename)]
            if len(storages) != 1 or not storages[0].filename.endswith("data/0"):
                raise RecordingError(
                    f"{path}: one tensor, a member data/0, expected; {len(storages)} tensors given "
                    f"among {len(members)} members"
                )
            data = archive.read(storages[0])
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError) as cause:
        raise RecordingError(f"{path} is cut or damaged: {cause}") from cause
    if not data or len(data) % ROW_SIZE:
        raise RecordingError(
            f"{path}: {len(data)} bytes of values given; rows of {ROW_SIZE} bytes expected "
            f"({_FORM})"
        )
    values = np.frombuffer(data, NUMBER_TYPE)
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        row, column = divmod(int(wrong[0]), ROW_SIZE // NUMBER_TYPE.itemsize)
        raise RecordingError(
            f"{path}, row {row}, value {column}: {values[wrong[0]]} given, a finite number expected"
        )
    return values.reshape(-1, N_FINGERTIPS, N_MAGNETOMETERS, 3)


def slipped_by_sequence(folder: Path) -> dict[str, bool]:
    """Return whether the object slipped, by name of the sequence; empty without such a file.

    Raises:
        RecordingError: a file has another form, or a sequence has two labels.
    """
    labels: dict[str, bool] = {}
    path = folder / LABELS_FILE
    if not path.is_file():
        path = folder / LABEL_LINES_FILE
        if not path.is_file():
            return {}
        lines = read_input(path, MAX_LABEL_LINES_SIZE).decode("utf-8", "replace").split("\n")
        for number, line in enumerate(lines[:-1] if lines[-1] == "" else lines):
            if line.strip() not in ("0", "1"):
                raise RecordingError(
                    f"{path}, line {number + 1}: 0 or 1 expected, {line.strip()[:20]!r} given"
                )
            labels[f"seq_{number}"] = line.strip() == "1"
        return labels
    table, _ = read_table(path)
    for row, (number, slip) in enumerate(table.columns(["sequence", "slip"]), table.first_line):
        name = f"seq_{number:.0f}"
        if slip not in (0, 1) or number % 1 or name in labels:
            raise RecordingError(
                f"{path}, row {row}: sequence {number:g} with slip {slip:g} given; a whole number, "
                "each once, with 0 or 1 expected"
            )
        labels[name] = bool(slip)
    return labels
