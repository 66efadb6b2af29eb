"""Import of LeRobot data sets (v2 and v3) of other programs: any feature of numbers."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from holdfast.errors import RecordingError
from holdfast.files import check_regular, read_input
from holdfast.io.importers.array_tables import in_memory, recordings_of_arrays
from holdfast.io.importers.arrays import arrays_of_columns
from holdfast.io.importers.csv_columns import Columns
from holdfast.io.importers.table import natural_order
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast_interop.lerobot.layout import INFO_PATH

MAX_INFO_SIZE = 1 << 24
"""Maximum size of the description of a data set [bytes]."""
EPISODE_COLUMN = "episode_index"


class _Feature(msgspec.Struct, frozen=True):
    """Description of a column: its type, its shape and the names of its values."""

    dtype: str
    shape: tuple[int, ...]
    names: Any = None


class _SetInfo(msgspec.Struct, frozen=True):
    """What is read of `meta/info.json` of any version."""

    features: dict[str, _Feature]
    fps: float | None = None


def read_foreign_set(
    path: Path,
    sensors: Mapping[str, Sensor],
    columns: Columns | None,
    report: Callable[[str], None],
) -> Iterator[Recording]:
    """Yield a recording for each episode of a data set.

    Args:
        path: folder of the data set.
        sensors: as in `recordings_of_arrays`, by the names of features.
        columns: the same.
        report: the same.

    Raises:
        RecordingError: it is no data set, or no feature fits.
    """
    import pyarrow.parquet as pq

    try:
        info = msgspec.json.decode(read_input(path / INFO_PATH, MAX_INFO_SIZE), type=_SetInfo)
    except msgspec.DecodeError as cause:
        raise RecordingError(f"{path / INFO_PATH} is not that of a data set: {cause}") from cause
    files = sorted(path.glob("data/*/*.parquet"), key=natural_order)
    if not files:
        raise RecordingError(f"{path} has no files data/*/*.parquet; a LeRobot data set expected")
    for number, file in enumerate(files):
        check_regular(file)
        parquet = pq.ParquetFile(file)
        names = [name for name in info.features if name in parquet.schema_arrow.names]
        arrays = arrays_of_columns(file, parquet, names)
        for name, array in arrays.items():
            feature = info.features[name]
            # Names are a list, or lists by kind of value; they count if each value has its own.
            lists = feature.names.values() if isinstance(feature.names, dict) else [feature.names]
            words = [str(word) for one in lists if isinstance(one, list) for word in one]
            if not len(words) == prod(feature.shape) == len(set(words)):
                words = []
            arrays[name] = array._replace(columns=tuple(words))
        if info.fps is not None:
            arrays["fps"] = in_memory(np.array(info.fps))
        # A file has rows of many episodes; they are recordings unless the user says otherwise.
        own = columns or Columns()
        if own.episode is None and EPISODE_COLUMN in arrays:
            own = replace(own, episode=EPISODE_COLUMN)
        # The other files are like the first: one report for all.
        once = report if number == 0 else lambda _: None
        for recording in recordings_of_arrays(file, arrays, sensors, own, once):
            yield replace(recording, name=f"{path.name}{recording.name.removeprefix(file.stem)}")
