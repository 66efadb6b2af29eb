"""Import of LeRobot data sets: those that `holdfast export` wrote (v3.0), without loss.

Of those of other programs (v2 and v3), any feature of numbers is read.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.files import check_regular, read_input
from holdfast.io.header import Header, decode_header
from holdfast.io.importers import IF_IN_CONTACT
from holdfast.io.importers.arrays import arrays_of_columns
from holdfast.io.importers.columns import Columns
from holdfast.io.importers.reading import ForeignFile, recordings_of
from holdfast.io.importers.stored import in_memory
from holdfast.io.importers.table import natural_order
from holdfast.io.timed_arrays import (
    TRUTH_TIME,
    ArraySpec,
    TimedArray,
    array_specs,
    recording_from,
)
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast_interop.lerobot.layout import (
    DATA_PATH,
    EPISODES_PATH,
    HEADER_COLUMN,
    INFO_PATH,
    TEXTS_COLUMN,
    VERSION,
    count_name,
    feature_name,
    joined_windows,
    texts_of,
    time_name,
    track_name,
    value_specs,
)

EXTRA = "parquet"
TAKES_SENSORS = True
HINT = f"metadata say how the recordings begin; {IF_IN_CONTACT}"
EPISODES_AT_ONCE = 64
"""Number of headers of recordings that are in memory at a time."""

_EPISODE_COLUMNS = (
    "episode_index", "length", "data/chunk_index", "data/file_index", HEADER_COLUMN, TEXTS_COLUMN
)  # fmt: skip

_FILE_PARTS = ("chunk", "file")


class _Info(msgspec.Struct, frozen=True):
    """What is read of `meta/info.json`."""

    codebase_version: str
    data_path: str
    total_episodes: int


class _Episode(NamedTuple):
    """An episode: its number and length, its data file, and the recording without its arrays."""

    number: int
    length: int
    path: Path
    header: Header
    texts: dict[str, list[str]]


def can_read(path: Path) -> bool:
    """Return whether `path` is the folder of a LeRobot data set."""
    return path.is_dir() and (path / INFO_PATH).is_file()


def parts(path: Path) -> list[Path]:
    """Return the folder of the data set; its episodes are read one at a time.

    Raises:
        RecordingError: it is none.
    """
    if not can_read(path):
        raise RecordingError(f"{path} has no {INFO_PATH}; a LeRobot data set expected")
    return [path]


def read(
    path: Path,
    sensors: Mapping[str, Sensor] | None = None,
    columns: Columns | None = None,
    report: Callable[[str], None] = lambda _: None,
    *,
    accept: bool = False,
) -> Iterator[Recording]:
    """Yield the recording of each episode.

    Args:
        path: folder of the data set.
        sensors: as in `read_foreign_set`, for a set that holdfast did not write.
        columns: the same.
        report: the same.
        accept: the same.

    Raises:
        RecordingError: the data set is damaged, or no feature fits a sensor.
    """
    import pyarrow.parquet as pq

    files = episode_files(path)
    # Only what holdfast wrote has the headers of recordings; options name columns of any set.
    is_own = bool(files) and HEADER_COLUMN in pq.read_schema(files[0]).names
    if sensors or columns or not is_own:
        yield from read_foreign_set(path, sensors or {}, columns, report, accept=accept)
        return
    for episode in read_episodes(path):
        table = _EpisodeTable(episode)
        specs = array_specs(episode.header)
        arrays = {spec.topic: table.array(spec) for spec in specs if spec.topic != TRUTH_TIME}
        if episode.header.truth is not None:
            times = table.times("truth")
            arrays[TRUTH_TIME] = (times, times)
        recording = recording_from(episode.header, arrays, path)
        # Parquet of other writers has no checksums: the digest finds what was changed since.
        if recording.digest != episode.header.digest:
            raise RecordingError(
                f"{path} is damaged: the samples of episode {episode.number} do not match their "
                "digest"
            )
        yield replace(recording, name=episode.header.name)


def episode_files(path: Path) -> list[Path]:
    """Return the files of the table of episodes."""
    pattern = EPISODES_PATH.replace("{chunk_index:03d}", "*").replace("{file_index:03d}", "*")
    files = sorted(path.glob(pattern))
    for file in files:
        check_regular(file)
    return files


def read_episodes(path: Path) -> Iterator[_Episode]:
    """Yield the episodes that holdfast wrote."""
    import pyarrow.parquet as pq

    try:
        info = msgspec.json.decode(read_input(path / INFO_PATH, MAX_INFO_SIZE), type=_Info)
    except msgspec.DecodeError as cause:
        raise RecordingError(f"{path / INFO_PATH} is not that of a data set: {cause}") from cause
    if info.codebase_version != VERSION:
        raise RecordingError(
            f"{path}: LeRobot {info.codebase_version} given, {VERSION} expected (lerobot converts "
            "older data sets)"
        )
    if info.data_path != DATA_PATH:  # no other text is used as a pattern
        raise RecordingError(
            f"{path / INFO_PATH}: data_path {info.data_path[:80]!r} given, {DATA_PATH!r} expected"
        )
    n_episodes = 0
    for file in episode_files(path):
        parquet = pq.ParquetFile(file)
        if missing := [name for name in _EPISODE_COLUMNS if name not in parquet.schema_arrow.names]:
            raise RecordingError(
                f"{path}: its episodes have no column {missing[0]!r}, which holdfast export "
                "writes; a data set of another program has no sensors and times of samples"
            )
        for batch in parquet.iter_batches(EPISODES_AT_ONCE, columns=list(_EPISODE_COLUMNS)):
            for row in batch.to_pylist():
                index = {f"{what}_index": int(row[f"data/{what}_index"]) for what in _FILE_PARTS}
                yield _Episode(
                    int(row["episode_index"]),
                    int(row["length"]),
                    path / DATA_PATH.format(**index),
                    decode_header(row[HEADER_COLUMN], path),
                    msgspec.json.decode(row[TEXTS_COLUMN], type=dict[str, list[str]]),
                )
                n_episodes += 1
    if n_episodes != info.total_episodes:
        raise RecordingError(
            f"{path} is damaged: {n_episodes} episodes, its {INFO_PATH} names {info.total_episodes}"
        )


class _EpisodeTable:
    """Columns of the frames of one episode.

    Args:
        episode: the episode.

    Raises:
        RecordingError: a column is missing, or the number of frames is another.
    """

    def __init__(self, episode: _Episode) -> None:
        import pyarrow.compute as pc
        import pyarrow.parquet as pq

        self._episode = episode
        specs = value_specs(array_specs(episode.header))
        tracks = dict.fromkeys(map(track_name, array_specs(episode.header)))
        names = [feature_name(spec) for spec in specs]
        names += [name(track) for track in tracks for name in (time_name, count_name)]
        check_regular(episode.path)
        file = pq.ParquetFile(episode.path)
        if missing := [name for name in names if name not in file.schema_arrow.names]:
            raise RecordingError(f"{episode.path}: column {missing[0]!r} is missing")
        # Without filters of pyarrow, which use the statistics in the footer: if these are damaged,
        # they abort the process.
        groups = [
            number
            for number in range(file.num_row_groups)
            for column in [file.read_row_group(number, columns=[EPISODE_COLUMN])[EPISODE_COLUMN]]
            if pc.index(column, episode.number).as_py() >= 0
        ]
        table = file.read_row_groups(groups, columns=[*names, EPISODE_COLUMN])
        self._table = table.filter(pc.equal(table[EPISODE_COLUMN], episode.number))
        if len(self._table) != episode.length:
            raise RecordingError(
                f"{episode.path} is damaged: {len(self._table)} frames of episode "
                f"{episode.number}, {episode.length} expected"
            )

    def times(self, track: str) -> npt.NDArray[Any]:
        """Return the times of the samples of a track [s]."""
        return self.joined(time_name(track), track, ())

    def array(self, spec: ArraySpec) -> TimedArray:
        """Return times and values of an array, in its own number type."""
        track = track_name(spec)
        times = self.times(track)
        if not spec.n_components:
            kind = "U1" if spec.number == "str" else spec.number or "float64"
            return times, np.empty((len(times), *spec.shape), kind)
        values = self.joined(feature_name(spec), track, spec.shape)
        if spec.number == "str":
            return times, texts_of(self._episode.texts, spec.column, values)
        with np.errstate(invalid="ignore"):  # the digest finds what does not fit
            return times, values.astype(spec.number or "float64")

    def joined(self, name: str, track: str, shape: tuple[int, ...]) -> npt.NDArray[Any]:
        """Return the values of a column at the samples of a track, each once."""
        n_new = self.flat(count_name(track)).astype(np.int64)
        values = self.flat(name).reshape(len(n_new), -1, *shape)
        return joined_windows(values, n_new)

    def flat(self, name: str) -> npt.NDArray[Any]:
        """Return all values of a column, without the nesting of its lists.

        Raises:
            ValueError: a value is missing.
        """
        import pyarrow as pa

        array = self._table.column(name).combine_chunks()
        while not (pa.types.is_primitive(array.type) or pa.types.is_boolean(array.type)):
            if array.null_count:
                raise ValueError(f"column {name!r} has missing values")
            array = array.storage if isinstance(array, pa.ExtensionArray) else array.flatten()
        if array.null_count:
            raise ValueError(f"column {name!r} has missing values")
        values: npt.NDArray[Any] = array.to_numpy(zero_copy_only=False)
        return values


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
    *,
    accept: bool,
) -> Iterator[Recording]:
    """Yield a recording for each episode of a data set.

    Args:
        path: folder of the data set.
        sensors: as in `recordings_of`, by the names of features.
        columns: the same.
        report: the same.
        accept: the same.

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
            words = [str(word) for texts in lists if isinstance(texts, list) for word in texts]
            if not len(words) == prod(feature.shape) == len(set(words)):
                words = []
            arrays[name] = array._replace(columns=tuple(words))
        if info.fps is not None:
            arrays["fps"] = in_memory(np.array(info.fps))
        # A file has rows of many episodes; they are recordings unless the user says otherwise.
        layout = columns or Columns()
        if layout.episode is None and EPISODE_COLUMN in arrays:
            layout = replace(layout, episode=EPISODE_COLUMN)
        # The other files are like the first: one report for all.
        once = report if number == 0 else lambda _: None
        source = ForeignFile(file, arrays)
        for recording in recordings_of(source, sensors, layout, once, accept=accept):
            yield replace(recording, name=f"{path.name}{recording.name.removeprefix(file.stem)}")
