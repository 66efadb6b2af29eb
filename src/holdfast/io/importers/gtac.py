"""Import of recordings of the GTac gripper: 15 finger sections with a 3-axis Hall sensor each.

Only the magnetic layer of the sensor has three axes. The piezoresistive cells and the servos
are not imported.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from holdfast.errors import RecordingError
from holdfast.io.importers.table import Table, csv_files, header_line, read_table, with_integer_type
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.sensors.types import Array

N_NODES = 15
NAMES = tuple(f"mag_{axis}{node + 1}" for node in range(N_NODES) for axis in "xyz")
MILLISECOND = 1e-3
TO_TAXEL_FRAME = np.array([1, -1, -1])
"""Half a turn about x: z of the device decreases when a section is pressed, z of a taxel
increases."""


def can_read(path: Path) -> bool:
    """Return whether `path` is such a CSV file, or a folder with one."""
    return any(_is_header(header_line(file)) for file in csv_files(path))


def parts(path: Path) -> list[Path]:
    """Return the file, or the files of this format in a folder.

    Raises:
        RecordingError: there is none.
    """
    files = [file for file in csv_files(path) if path.is_file() or _is_header(header_line(file))]
    if not files:
        raise RecordingError(f"no gtac file in {path}; CSV files with columns mag_x1.. expected")
    return files


def read(path: Path) -> Iterator[Recording]:
    """Read the recording in a CSV file, or those in the CSV files of a folder.

    Raises:
        RecordingError: there is no CSV file, or one has another form.
    """
    return (_recording(file) for file in parts(path))


def _is_header(names: tuple[str, ...]) -> bool:
    if set(NAMES) <= set(names):
        return True
    numbered = tuple(str(k) for k in range(len(names) - 1))
    return len(names) > len(NAMES) + 2 and names == ("", *numbered)


def _recording(path: Path) -> Recording:
    table, _ = read_table(path)
    if not _is_header(table.names):
        raise RecordingError(
            f"{path}: columns mag_x1,mag_y1,...,mag_z{N_NODES} expected, or a header of numbers "
            f"after an unnamed index; {', '.join(map(repr, table.names[:4]))}... given"
        )
    numbered = table.names[0] == "" and "mag_x1" not in table.names
    values = table.values[:, 1 : 1 + len(NAMES)] if numbered else table.columns(NAMES)
    times, n_without_time = _times(table)
    rotated = values[n_without_time:].reshape(-1, N_NODES, 3) * TO_TAXEL_FRAME
    readings = with_integer_type(rotated)
    metadata = {"source": "roobooot/GTac_", "rows_without_time": n_without_time}
    try:
        return Recording(path.stem, {"finger1": Tactile(sensor("gtac"), times, readings)}, metadata)
    except RecordingError as cause:
        raise RecordingError(f"{path}: {cause}") from cause


def _times(table: Table) -> tuple[Array, int]:
    """Return the times [s], and 1 if the first row has none (as the logger writes it), else 0."""
    named = "milliseconds" in table.names
    milliseconds = table.columns(["milliseconds"])[:, 0] if named else table.values[:, -1]
    missing = np.isnan(milliseconds)
    n_without_time = int(missing[0])
    if missing[1:].any():
        row = int(np.flatnonzero(missing[1:])[0]) + 1
        raise RecordingError(
            f"{table.path}, row {table.first_line + row}: no time; only the first row may have none"
        )
    return milliseconds[n_without_time:] * MILLISECOND, n_without_time
