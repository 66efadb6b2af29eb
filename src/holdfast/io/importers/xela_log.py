"""Import of CSV logs of a whole hand: time, then Fx, Fy, Fz of 368 taxels in flat order."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from holdfast.errors import RecordingError
from holdfast.io.importers.table import CsvFormat, errors_named, read_table, with_integer_type
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import hand

WHOLE_HAND = "allegro-uskin"
N_COLUMNS = 368 * 3


_FORMAT = CsvFormat(
    lambda names: len(names) == N_COLUMNS + 1,
    "no CSV file in {}; xela-log files expected",
    every_file=True,
)
can_read, parts = _FORMAT.can_read, _FORMAT.parts


def read(path: Path) -> Iterator[Recording]:
    """Yield the recording in a CSV file.

    Raises:
        RecordingError: it has another form.
    """
    allegro = hand(WHOLE_HAND)
    table, _ = read_table(path)
    n_given = len(table.names) - 1
    if n_given != allegro.n_taxels * 3:
        raise RecordingError(
            f"{path}: a time column and {n_given} others given; {allegro.n_taxels * 3} expected "
            f"({allegro.n_taxels} taxels x 3 axes of {WHOLE_HAND})"
        )
    # The first column if none has a name with "time".
    index = next((k for k, name in enumerate(table.names) if "time" in name.lower()), 0)
    times = table.values[:, index]
    readings = with_integer_type(np.delete(table.values, index, axis=1))
    unit = "count" if np.issubdtype(readings.dtype, np.integer) else "N"
    with errors_named(path):
        modules = {
            name: Tactile(allegro.modules[name].sensor, times, part, unit)  # type: ignore[arg-type]
            for name, part in allegro.split(readings.reshape(-1, allegro.n_taxels, 3)).items()
        }
        recording = Recording(path.stem, modules, {"hand": WHOLE_HAND, "source": path.name})
    yield recording
