"""Import of recordings of the GTac gripper: 15 finger sections with a 3-axis Hall sensor each.

Only the magnetic layer of the sensor has three axes. The piezoresistive cells and the servos
are not imported.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from holdfast.errors import RecordingError
from holdfast.io.importers.table import (
    CsvFormat,
    Table,
    errors_named,
    read_table,
    with_integer_type,
)
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.sensors.types import Array

N_NODES = 15
NODE_COLUMNS = tuple(f"mag_{axis}{node + 1}" for node in range(N_NODES) for axis in "xyz")
MILLISECOND = 1e-3
TO_TAXEL_FRAME = np.array([1, -1, -1])
"""Half a turn about x: z of the device decreases when a section is pressed, z of a taxel
increases."""


def _is_header(names: tuple[str, ...]) -> bool:
    if set(NODE_COLUMNS) <= set(names):
        return True
    numbered = tuple(str(k) for k in range(len(names) - 1))
    return len(names) > len(NODE_COLUMNS) + 2 and names == ("", *numbered)


_FORMAT = CsvFormat(_is_header, "no gtac file in {}; CSV files with columns mag_x1.. expected")
can_read, parts = _FORMAT.can_read, _FORMAT.parts


def read(path: Path) -> Iterator[Recording]:
    """Yield the recording in a CSV file.

    Raises:
        RecordingError: it has another form.
    """
    table, _ = read_table(path)
    if not _is_header(table.names):
        raise RecordingError(
            f"{path}: columns mag_x1,mag_y1,...,mag_z{N_NODES} expected, or a header of numbers "
            f"after an unnamed index; {', '.join(map(repr, table.names[:4]))}... given"
        )
    numbered = table.names[0] == "" and "mag_x1" not in table.names
    values = table.values[:, 1 : 1 + len(NODE_COLUMNS)] if numbered else table.columns(NODE_COLUMNS)
    times, n_without_time = _times(table)
    rotated = values[n_without_time:].reshape(-1, N_NODES, 3) * TO_TAXEL_FRAME
    readings = with_integer_type(rotated)
    metadata = {"source": "roobooot/GTac_", "rows_without_time": n_without_time}
    with errors_named(path):
        modules = {"finger1": Tactile(sensor("gtac"), times, readings)}
        recording = Recording(path.stem, modules, metadata)
    yield recording


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
