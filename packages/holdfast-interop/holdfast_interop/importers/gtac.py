"""Import of recordings of the GTac gripper: 15 finger sections with a 3-axis Hall sensor each.

Only the magnetic layer of the sensor has three axes; the piezoresistive cells are not imported.
The positions of the servos become truth of the hand. The second version of the gripper writes the
same `milliseconds` in every row; its times follow from its column `Hz`.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.io.importers import IF_IN_CONTACT
from holdfast.io.importers.table import (
    CsvFormat,
    Table,
    errors_named,
    read_table,
    with_integer_type,
)
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor
from holdfast.sensors.types import Array

HINT = f"grasps of the second gripper begin with an open hand; {IF_IN_CONTACT}"
N_NODES = 15
NODE_COLUMNS = tuple(f"mag_{axis}{node + 1}" for node in range(N_NODES) for axis in "xyz")
SERVO_PREFIX = "servo"
SERVO_POSITIONS = "servo_positions"
"""Array of the truth of the hand: (n, n_servos), in the unit of the servos."""
MILLISECOND = 1e-3
TO_TAXEL_FRAME = np.array([1, -1, -1])
"""Half a turn about x: z of the device decreases when a section is pressed, z of a taxel
increases."""


def is_header(names: tuple[str, ...]) -> bool:
    """Return whether a file with these columns is one of the gripper."""
    if set(NODE_COLUMNS) <= set(names):
        return True
    # Files without names of columns: these are 0, 1, 2, ... after an index without a name.
    numbered = tuple(str(k) for k in range(len(names) - 1))
    return len(names) > len(NODE_COLUMNS) + 2 and names == ("", *numbered)


_FORMAT = CsvFormat(is_header, "no gtac file in {}; CSV files with columns mag_x1.. expected")
can_read, parts = _FORMAT.can_read, _FORMAT.parts


def read(path: Path) -> Iterator[Recording]:
    """Yield the recording in a CSV file.

    Raises:
        RecordingError: it has another form.
    """
    table, _ = read_table(path)
    if not is_header(table.names):
        raise RecordingError(
            f"{path}: columns mag_x1,mag_y1,...,mag_z{N_NODES} expected, or a header of numbers "
            f"after an unnamed index; {', '.join(map(repr, table.names[:4]))}... given"
        )
    numbered = table.names[0] == "" and "mag_x1" not in table.names
    values = table.values[:, 1 : 1 + len(NODE_COLUMNS)] if numbered else table.columns(NODE_COLUMNS)
    clock = _clock(table)
    rotated = values[clock.n_without_time :].reshape(-1, N_NODES, 3) * TO_TAXEL_FRAME
    metadata = {"source": clock.source, "rows_without_time": clock.n_without_time}
    if clock.note:
        metadata["clock"] = clock.note
    with errors_named(path):
        modules = {"finger1": Tactile(sensor("gtac"), clock.times, with_integer_type(rotated))}
        # Without a header no column is known to be a servo.
        servos = [name for name in table.names if name.startswith(SERVO_PREFIX)]
        truth = None
        if servos:
            positions: npt.NDArray[np.generic] = with_integer_type(table.columns(servos))
            truth = Truth(clock.times, {SERVO_POSITIONS: positions[clock.n_without_time :]})
        recording = Recording(path.stem, modules, metadata, truth)
    yield recording


class _Clock(NamedTuple):
    """Times of the samples [s], where they come from, and how many first rows have none."""

    times: Array
    n_without_time: int
    source: str
    note: str = ""


def _clock(table: Table) -> _Clock:
    named = "milliseconds" in table.names
    milliseconds = table.columns(["milliseconds"])[:, 0] if named else table.values[:, -1]
    if named and "Hz" in table.names and len(milliseconds) > 1 and not np.ptp(milliseconds):
        rates = table.columns(["Hz"])[:, 0]
        wrong = np.flatnonzero(~(np.isfinite(rates) & (rates > 0)))
        if len(wrong):
            raise RecordingError(
                f"{table.path}, row {table.first_line + wrong[0]}, column 'Hz': "
                f"{rates[wrong[0]]:g} given; a rate above 0 expected, because all milliseconds "
                "are the same"
            )
        rate = float(np.median(rates))
        times = np.arange(len(milliseconds)) / rate
        return _Clock(times, 0, "roobooot/GTac_Gripper_V2", f"none; {rate:g} Hz by its column Hz")
    missing = np.isnan(milliseconds)
    # The logger writes its first row before it has a time.
    n_without_time = int(missing[0])
    if missing[1:].any():
        row = int(np.flatnonzero(missing[1:])[0]) + 1
        raise RecordingError(
            f"{table.path}, row {table.first_line + row}: no time; only the first row may have none"
        )
    times = milliseconds[n_without_time:] * MILLISECOND
    return _Clock(times, n_without_time, "roobooot/GTac_")
