"""Import of CSV logs of a whole hand: time, then Fx, Fy, Fz of 368 taxels in flat order."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from holdfast.errors import RecordingError
from holdfast.io.importers.table import csv_files, header_line, read_table, with_integer_type
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import hand

WHOLE_HAND = "allegro-uskin"
N_COLUMNS = 368 * 3


def can_read(path: Path) -> bool:
    """Return whether `path` is such a CSV file, or a folder with one."""
    return any(len(header_line(file)) == N_COLUMNS + 1 for file in csv_files(path))


def parts(path: Path) -> list[Path]:
    """Return the file, or the CSV files of a folder.

    Raises:
        RecordingError: there is none.
    """
    files = csv_files(path)
    if not files:
        raise RecordingError(f"no CSV file in {path}; xela-log files expected")
    return files


def read(path: Path) -> Iterator[Recording]:
    """Read the recording in a CSV file, or those in the CSV files of a folder.

    Raises:
        RecordingError: there is no CSV file, or one has another form.
    """
    return (_recording(file) for file in parts(path))


def _recording(path: Path) -> Recording:
    allegro = hand(WHOLE_HAND)
    table, _ = read_table(path)
    n_given = len(table.names) - 1
    if n_given != allegro.n_taxels * 3:
        raise RecordingError(
            f"{path}: a time column and {n_given} others given; {allegro.n_taxels * 3} expected "
            f"({allegro.n_taxels} taxels x 3 axes of {WHOLE_HAND})"
        )
    place = _time_column(table.names)
    times = table.values[:, place]
    readings = with_integer_type(np.delete(table.values, place, axis=1))
    unit = "count" if np.issubdtype(readings.dtype, np.integer) else "N"
    try:
        modules = {
            name: Tactile(allegro.modules[name].sensor, times, part, unit)  # type: ignore[arg-type]
            for name, part in allegro.split(readings.reshape(-1, allegro.n_taxels, 3)).items()
        }
        return Recording(path.stem, modules, {"hand": WHOLE_HAND, "source": path.name})
    except RecordingError as cause:
        raise RecordingError(f"{path}: {cause}") from cause


def _time_column(names: tuple[str, ...]) -> int:
    """Return the place of the first column with "time" in its name; 0 if there is none."""
    return next((k for k, name in enumerate(names) if "time" in name.lower()), 0)
