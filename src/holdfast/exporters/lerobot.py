"""Export of recordings as a LeRobot data set (v3.0), by pyarrow alone."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from holdfast.errors import RecordingError
from holdfast.exporters.output import whole_folder
from holdfast.io.header import Header, encode_header, header_of
from holdfast.io.lerobot import (
    DATA_PATH,
    EPISODES_PATH,
    FILES_PER_FOLDER,
    HEADER_COLUMN,
    INFO_PATH,
    STATS_PATH,
    TASKS_PATH,
    TEXTS_COLUMN,
    VERSION,
    count_name,
    feature_name,
    frame_ends,
    frame_numbers,
    stored_type,
    text_codes,
    time_name,
    track_name,
    value_specs,
    window_rows,
    windows,
)
from holdfast.io.timed_arrays import TRUTH_TIME, ArraySpec, TimedArray, array_specs, arrays_of
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Integers

DEFAULT_FPS = 30
"""Frames per second; that of most cameras [Hz]."""
MAX_FPS = 1000
MAX_FILE_SIZE = 100
"""Size from which the next episode begins a new file [MB]."""
MAX_VIDEO_SIZE = 200
"""LeRobot's limit for files of videos, of which there are none [MB]."""
MAX_GROUP_FRAMES = 4096
"""Maximum number of frames in a row group; shorter episodes are one row group."""
MAX_FRAMES_PER_SAMPLE = 100
"""Number of frames for a sample from which on a recording is refused: it is mostly gaps."""
MAX_SHORT_FRAMES = 100_000
"""Number of frames that every recording may have."""
LABEL_PREFIX = "label."
"""Beginning of the names of the columns of labels; the rest is the name of the module."""
UNKNOWN_TASK = "tactile recording"
_LIMIT_AXES = 5
"""LeRobot's maximum number of axes of a feature."""

_CARD = """---
license: other
task_categories:
- robotics
tags:
- LeRobot
- tactile
configs:
- config_name: default
  data_files: data/*/*.parquet
---
Tactile recordings in the LeRobot format {version}, written by holdfast. The newest samples of a
module up to each frame are `observation.tactile.MODULE`, their times `.time`, and the number of
them, at the end, that are later than the frame before `.new`. `holdfast import` makes recordings
of it again.
"""


class ColumnSpec(NamedTuple):
    """Column of the data set: number type, and shape of the value of a frame."""

    number: str
    shape: tuple[int, ...]


@dataclass
class SharedColumns:
    """Columns that all recordings of a data set share.

    Attributes:
        fps: frames per second.
        values: number type and shape of one sample, by column.
        widths: number of samples in a window, by track.
        units: unit of the readings, by column.
        labelled: columns of labels.
    """

    fps: int
    values: dict[str, ColumnSpec] = field(default_factory=dict)
    widths: dict[str, int] = field(default_factory=dict)
    tracks: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    labelled: dict[str, str] = field(default_factory=dict)

    def add(self, recording: Recording) -> None:
        """Add the columns of a recording.

        Raises:
            RecordingError: it does not fit to those before, or to the format.
        """
        header = header_of(recording, recording.name)
        specs = array_specs(header)
        _check_names(recording.name, specs)
        span = _Span.of(recording, self.fps)
        arrays = arrays_of(recording)
        for spec in specs:
            times = arrays[spec.topic][0]
            track = track_name(spec)
            self.widths[track] = max(self.widths.get(track, 1), span.width(times))
        for spec in value_specs(specs):
            self._add_values(recording.name, spec)
        for name, module in recording.modules.items():
            feature = feature_name(_module_spec(specs, name))
            unit = str(module.unit)
            if self.units.setdefault(feature, unit) != unit:
                raise RecordingError(
                    f"{recording.name}: {name} is in {unit}, in the recordings before in "
                    f"{self.units[feature]}; export them apart"
                )
            self.labelled[feature] = f"{LABEL_PREFIX}{name}".replace("/", ".")

    def _add_values(self, recording: str, spec: ArraySpec) -> None:
        name, number = feature_name(spec), stored_type(spec)
        known = self.values.get(name, ColumnSpec(number, spec.shape))
        common = _common_type(known.number, number)
        if known.shape != spec.shape or common is None:
            raise RecordingError(
                f"{recording}: {name} has {number} of shape {spec.shape}, in the recordings "
                f"before {known.number} of {known.shape}; a data set has one shape: export "
                "them apart"
            )
        if len(spec.shape) >= _LIMIT_AXES:
            raise RecordingError(f"{recording}: {name} has {len(spec.shape)} axes; at most 4")
        self.values[name] = ColumnSpec(common, spec.shape)
        self.tracks[name] = track_name(spec)

    def features(self) -> dict[str, ColumnSpec]:
        """Return all columns of the data, in their order."""
        columns = {
            name: ColumnSpec(spec.number, (self.widths[self.tracks[name]], *spec.shape))
            for name, spec in self.values.items()
        }
        for track, width in self.widths.items():
            columns[time_name(track)] = ColumnSpec("float64", (width,))
            columns[count_name(track)] = ColumnSpec("int64", (1,))
        columns |= dict.fromkeys(self.labelled.values(), ColumnSpec("int64", (1,)))
        columns["timestamp"] = ColumnSpec("float32", (1,))
        for name in ("frame_index", "episode_index", "index", "task_index"):
            columns[name] = ColumnSpec("int64", (1,))
        return columns


class _Span(NamedTuple):
    """Time of the frames of a recording: start [s], rate [Hz] and number."""

    start: float
    fps: int
    n_frames: int

    @classmethod
    def of(cls, recording: Recording, fps: int) -> "_Span":
        """Return the frames from the first to the last sample or truth.

        Raises:
            RecordingError: there are far more frames than samples.
        """
        tracks = [times for times, _ in arrays_of(recording).values() if len(times)]
        start = min(float(times[0]) for times in tracks)
        last = max(float(frame_numbers(times[-1:], start, fps)[0]) for times in tracks)
        n_samples = max(map(len, tracks))
        if last >= max(MAX_SHORT_FRAMES, MAX_FRAMES_PER_SAMPLE * n_samples):
            raise RecordingError(
                f"{recording.name}: {last:.3g} frames at {fps} Hz for {n_samples} samples; it is "
                "mostly gaps: cut it, or give a lower --fps"
            )
        return cls(start, fps, int(last) + 1)

    def width(self, times: Array) -> int:
        """Return the largest number of new samples in a frame."""
        return int(np.diff(self.ends(times), prepend=0).max(initial=0))

    def ends(self, times: Array) -> Integers:
        """Return the number of samples up to each frame."""
        return frame_ends(times, self.start, self.fps, self.n_frames)


def export(
    recordings: Sequence[Recording],
    out: Path,
    *,
    fps: int = DEFAULT_FPS,
    force: bool = False,
    progress: Callable[[Iterable[Recording]], Iterable[Recording]] = iter,
) -> dict[str, int]:
    """Write recordings as a LeRobot data set; each is an episode.

    They are loaded twice, one at a time: first for the columns that they share.

    Args:
        recordings: such as a `Dataset`.
        out: folder of the data set.
        fps: frames per second [Hz].
        force: replace an existing data set.
        progress: wraps the recordings while they are written.

    Returns:
        Number of `episodes`, `frames` and `tasks`.

    Raises:
        RecordingError: the recordings do not fit to each other, or to the format.
        OutputError: `out` exists or cannot be written.
        ValueError: the rate is not a whole number from 1 to 1000.
    """
    if not 1 <= fps <= MAX_FPS:
        raise ValueError(f"--fps: a whole number from 1 to {MAX_FPS} expected, {fps} given")
    with whole_folder(out, force=force, is_replaceable=_is_data_set) as folder:
        layout = SharedColumns(fps)
        for recording in recordings:
            layout.add(recording)
        with _Writer(folder, layout) as writer:
            for recording in progress(recordings):
                writer.append(recording)
        return writer.write_meta()


def _is_data_set(folder: Path) -> bool:
    return (folder / INFO_PATH).is_file()


class _Writer(ExitStack):
    """Writer of the files of a data set, one episode after the other."""

    def __init__(self, folder: Path, layout: SharedColumns) -> None:
        super().__init__()
        self._folder, self._layout = folder, layout
        self._features = layout.features()
        self._schema = _schema(self._features)
        self._file: pq.ParquetWriter | None = None
        self.callback(self._close_file)
        self._path = folder
        self._n_files = 0
        self._n_frames = 0
        self._episodes: list[dict[str, object]] = []
        self._tasks: dict[str, int] = {}
        self._stats = {name: _Stats(spec.shape) for name, spec in self._features.items()}

    def append(self, recording: Recording) -> None:
        """Write the data of an episode."""
        header = header_of(recording, recording.name)
        file = self._file_for_next()
        frames = _Frames(recording, header, self._layout)
        task = self._tasks.setdefault(_task(recording), len(self._tasks))
        for start in range(0, frames.n, MAX_GROUP_FRAMES):
            part = frames.columns(start, min(start + MAX_GROUP_FRAMES, frames.n))
            n = len(part["frame_index"])
            part["episode_index"] = np.full(n, len(self._episodes), dtype=np.int64)
            part["index"] = part["frame_index"] + self._n_frames
            part["task_index"] = np.full(n, task, dtype=np.int64)
            for name, values in part.items():
                self._stats[name].add(values)
            arrays = [_nested(part[name], spec) for name, spec in self._features.items()]
            file.write_table(pa.Table.from_arrays(arrays, schema=self._schema))
        self._episodes.append(self._episode(recording, header, frames))
        self._n_frames += frames.n

    def _episode(self, recording: Recording, header: Header, frames: "_Frames") -> dict[str, Any]:
        chunk, number = divmod(self._n_files - 1, FILES_PER_FOLDER)
        return {
            "episode_index": len(self._episodes),
            "tasks": [_task(recording)],
            "length": frames.n,
            "data/chunk_index": chunk,
            "data/file_index": number,
            "dataset_from_index": self._n_frames,
            "dataset_to_index": self._n_frames + frames.n,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
            HEADER_COLUMN: encode_header(header).decode(),
            TEXTS_COLUMN: msgspec.json.encode(frames.texts).decode(),
        }

    def _file_for_next(self) -> pq.ParquetWriter:
        """Return the file of the next episode; a large file is closed."""
        if self._file is not None and self._path.stat().st_size < MAX_FILE_SIZE * 1e6:
            return self._file
        self._close_file()
        chunk, number = divmod(self._n_files, FILES_PER_FOLDER)
        self._path = self._folder / DATA_PATH.format(chunk_index=chunk, file_index=number)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._file = pq.ParquetWriter(
            str(self._path), self._schema, compression="zstd", use_dictionary=False
        )
        self._n_files += 1
        return self._file

    def _close_file(self) -> None:
        if self._file is not None:
            self._file.close()

    def write_meta(self) -> dict[str, int]:
        """Write all files but the data; return the numbers of what there is."""
        episodes = self._folder / EPISODES_PATH.format(chunk_index=0, file_index=0)
        episodes.parent.mkdir(parents=True)
        table = pa.Table.from_pylist(self._episodes)
        pq.write_table(table, str(episodes), compression="zstd", row_group_size=64)
        _write_tasks(self._folder / TASKS_PATH, self._tasks)
        totals = {
            "episodes": len(self._episodes), "frames": self._n_frames, "tasks": len(self._tasks)
        }  # fmt: skip
        _write_json(self._folder / INFO_PATH, _info(self._layout.fps, self._features, totals))
        stats = {name: stats.result() for name, stats in self._stats.items()}
        _write_json(self._folder / STATS_PATH, stats)
        (self._folder / "README.md").write_text(_CARD.format(version=VERSION), "utf-8")
        return totals


class _Frames:
    """Frames of a recording, as arrays by column."""

    def __init__(self, recording: Recording, header: Header, layout: SharedColumns) -> None:
        self._layout = layout
        self._span = _Span.of(recording, layout.fps)
        self.n = self._span.n_frames
        self.texts: dict[str, list[str]] = {}
        self._values: dict[str, npt.NDArray[Any]] = {}
        self._times: dict[str, Array] = {}
        arrays = arrays_of(recording)
        for spec in array_specs(header):
            self._times[track_name(spec)] = arrays[spec.topic][0]
        for spec in value_specs(array_specs(header)):
            self._add(spec, arrays[spec.topic])
        self._labels = {
            feature_name(spec): recording.modules[spec.track].label_states
            for spec in array_specs(header)
            if spec.track != "truth"
        }
        self._ends = {track: self._span.ends(times) for track, times in self._times.items()}

    def _add(self, spec: ArraySpec, array: TimedArray) -> None:
        values = array[1]
        if spec.number == "str":
            self.texts[spec.column], values = text_codes(values)
        name = feature_name(spec)
        self._values[name] = values.astype(self._layout.values[name].number)

    def columns(self, start: int, stop: int) -> dict[str, npt.NDArray[Any]]:
        """Return the columns of the frames from `start` up to `stop`."""
        columns: dict[str, npt.NDArray[Any]] = {}
        for track, width in self._layout.widths.items():
            ends = self._ends.get(track, np.zeros(self.n, dtype=np.int64))
            rows = window_rows(ends[start:stop], width)
            times = self._times.get(track, np.empty(0))
            columns[time_name(track)] = windows(times, rows)
            columns[count_name(track)] = np.diff(ends, prepend=0)[start:stop]
            for name, spec in self._layout.values.items():
                if self._layout.tracks[name] == track:
                    empty = np.empty((0, *spec.shape), dtype=spec.number)
                    columns[name] = windows(self._values.get(name, empty), rows)
            if track in self._layout.labelled:
                states = self._labels.get(track, np.empty(0, dtype=np.int8))
                label = windows(states.astype(np.int64), rows[:, -1:])
                columns[self._layout.labelled[track]] = label[:, 0]
        columns["frame_index"] = np.arange(start, stop)
        columns["timestamp"] = (columns["frame_index"] / self._layout.fps).astype(np.float32)
        return columns


class _Stats:
    """Mean, standard deviation and extremes of a column over all frames, without NaN."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._n_frames = 0
        self._n = np.zeros(shape)
        self._sum = np.zeros(shape)
        self._squares = np.zeros(shape)
        self._shift: Array | None = None
        self._min = np.full(shape, np.inf)
        self._max = np.full(shape, -np.inf)

    def add(self, values: npt.NDArray[Any]) -> None:
        """Add the values of consecutive frames."""
        numbers = values.reshape(len(values), *self._n.shape).astype(np.float64)
        finite = np.isfinite(numbers)
        kept = np.where(finite, numbers, 0.0)
        if self._shift is None:  # variances of large numbers need it
            self._shift = np.where(finite.any(axis=0), kept.max(axis=0, initial=0.0), 0.0)
        self._n_frames += len(numbers)
        self._n += finite.sum(axis=0)
        with np.errstate(over="ignore", invalid="ignore"):
            off = np.where(finite, kept - self._shift, 0.0)
            self._sum += off.sum(axis=0)
            self._squares += np.square(off).sum(axis=0)
        self._min = np.minimum(self._min, np.where(finite, numbers, np.inf).min(axis=0))
        self._max = np.maximum(self._max, np.where(finite, numbers, -np.inf).max(axis=0))

    def result(self) -> dict[str, object]:
        """Return the statistics; 0 where there is no number."""
        known, n = self._n > 0, np.maximum(self._n, 1)
        shift = 0.0 if self._shift is None else self._shift
        with np.errstate(over="ignore", invalid="ignore"):
            mean = self._sum / n
            std = np.sqrt(np.maximum(self._squares / n - np.square(mean), 0.0))
        return {
            "min": np.where(known, self._min, 0.0).tolist(),
            "max": np.where(known, self._max, 0.0).tolist(),
            "mean": np.nan_to_num(np.where(known, mean + shift, 0.0)).tolist(),
            "std": np.nan_to_num(std).tolist(),
            "count": [self._n_frames],
        }


def _check_names(recording: str, specs: Sequence[ArraySpec]) -> None:
    """Check that no two arrays share a column."""
    names = [feature_name(spec) for spec in specs if spec.topic != TRUTH_TIME]
    tracks = list(dict.fromkeys(map(track_name, specs)))
    names += [name(track) for track in tracks for name in (time_name, count_name)]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise RecordingError(
            f"{recording}: two arrays would share the column {repeated[0]!r} of LeRobot, which "
            "allows no '/' in a name; rename a module"
        )


def _module_spec(specs: Sequence[ArraySpec], module: str) -> ArraySpec:
    return next(spec for spec in specs if spec.track == module)


def _common_type(first: str, second: str) -> str | None:
    """Return the number type that holds the values of both exactly; None if there is none."""
    if first == second:
        return first
    return "float64" if {first, second} == {"float32", "float64"} else None


def _task(recording: Recording) -> str:
    """Return the task of an episode: `task` of the metadata, or its object."""
    task, item = recording.metadata.get("task"), recording.metadata.get("object")
    if isinstance(task, str) and task:
        return task
    return f"grasp {item}" if isinstance(item, str) and item else UNKNOWN_TASK


def _arrow_type(spec: ColumnSpec) -> pa.DataType:
    """Return the type of a column, in the form in which the library `datasets` writes it."""
    number = pa.bool_() if spec.number == "bool" else pa.from_numpy_dtype(np.dtype(spec.number))
    if spec.shape == (1,):
        return number
    if len(spec.shape) == 1:
        return pa.list_(number, spec.shape[0])
    for _ in spec.shape:
        number = pa.list_(number)
    return number


def _nested(values: npt.NDArray[Any], spec: ColumnSpec) -> pa.Array:
    """Return values (n_frames, ...) as nested lists."""
    array = pa.array(np.ascontiguousarray(values).reshape(-1))
    if spec.shape == (1,):
        return array
    if len(spec.shape) == 1:
        return pa.FixedSizeListArray.from_arrays(array, spec.shape[0])
    for size in reversed(spec.shape):
        offsets = np.arange(0, len(array) + 1, size, dtype=np.int32)
        array = pa.ListArray.from_arrays(pa.array(offsets), array)
    return array


def _schema(features: Mapping[str, ColumnSpec]) -> pa.Schema:
    return pa.schema([(name, _arrow_type(spec)) for name, spec in features.items()])


def _write_tasks(path: Path, tasks: Mapping[str, int]) -> None:
    """Write the tasks with the metadata by which pandas takes them as the index of the table."""
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_type,
         "metadata": None}
        for name, kind, numpy_type in (
            ("task_index", "int64", "int64"), ("task", "unicode", "object")
        )
    ]  # fmt: skip
    pandas = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": columns,
        "pandas_version": "2.2.0",
    }
    table = pa.table({"task_index": pa.array(tasks.values(), pa.int64()), "task": list(tasks)})
    metadata = {"pandas": json.dumps(pandas)}
    pq.write_table(table.replace_schema_metadata(metadata), str(path))


def _info(fps: int, features: Mapping[str, ColumnSpec], totals: Mapping[str, int]) -> object:
    return {
        "codebase_version": VERSION,
        "robot_type": None,
        **{f"total_{name}": n for name, n in totals.items()},
        "chunks_size": FILES_PER_FOLDER,
        "data_files_size_in_mb": MAX_FILE_SIZE,
        "video_files_size_in_mb": MAX_VIDEO_SIZE,
        "fps": fps,
        "splits": {"train": f"0:{totals['episodes']}"},
        "data_path": DATA_PATH,
        "video_path": None,
        "features": {
            name: {"dtype": spec.number, "shape": list(spec.shape), "names": None}
            for name, spec in features.items()
        },
    }


def _write_json(path: Path, value: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(msgspec.json.format(msgspec.json.encode(value)))
