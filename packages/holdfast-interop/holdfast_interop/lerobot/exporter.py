"""Export of recordings as a LeRobot data set (v3.0), by pyarrow alone: files and statistics."""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from holdfast.exporters.output import whole_folder
from holdfast.io.header import Header, encode_header, header_of
from holdfast.io.timed_arrays import array_specs, arrays_of
from holdfast.recordings import Recording
from holdfast.sensors.types import Array
from holdfast_interop.lerobot.columns import FrameSpan, SharedColumns, arrow_schema, nested
from holdfast_interop.lerobot.layout import (
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
    text_codes,
    time_name,
    track_name,
    value_specs,
    window_rows,
    windows,
)

DEFAULT_FPS = 30
"""Frames per second; that of most cameras [Hz]."""
MAX_FPS = 1000
MAX_FILE_SIZE = 100
"""Size from which the next episode begins a new file [MB]."""
MAX_VIDEO_SIZE = 200
"""LeRobot's limit for files of videos, of which there are none [MB]."""
MAX_GROUP_FRAMES = 4096
"""Maximum number of frames in a row group; shorter episodes are one row group."""
MARKER_PATH = "meta/holdfast.json"
"""File that marks a data set of holdfast: `--force` deletes no folder without it."""
OWN_FILES = re.compile(
    r"README\.md|meta/(info|stats|holdfast)\.json|meta/tasks\.parquet"
    r"|(data|meta/episodes)/chunk-\d{3,}/file-\d{3,}\.parquet"
)
"""Paths of all files of a data set."""
UNKNOWN_TASK = "tactile recording"

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
    with whole_folder(out, force=force, is_replaceable=is_data_set) as folder:
        layout = SharedColumns(fps)
        for recording in recordings:
            layout.add(recording)
        with _Writer(folder, layout) as writer:
            for recording in progress(recordings):
                writer.append(recording)
        return writer.write_meta()


def is_data_set(folder: Path) -> bool:
    """Return whether a folder has the marker, and no file that this export does not write."""
    marker = folder / MARKER_PATH
    # A link could lead `--force` out of the folder.
    if marker.is_symlink() or not marker.is_file():
        return False
    return all(
        path.is_dir() or OWN_FILES.fullmatch(path.relative_to(folder).as_posix())
        for path in folder.rglob("*")
        if not path.is_symlink()
    ) and not any(path.is_symlink() for path in folder.rglob("*"))


class _Writer(ExitStack):
    """Writer of the files of a data set, one episode after the other."""

    def __init__(self, folder: Path, layout: SharedColumns) -> None:
        super().__init__()
        self._folder, self._layout = folder, layout
        self._features = layout.features()
        self._schema = arrow_schema(self._features)
        self._file: pq.ParquetWriter | None = None
        # After an error as well.
        self.callback(self._close_file)
        self._path = folder  # of the file that is open; no file before the first episode
        self._n_files = 0  # begun so far; the newest has the number before it
        self._n_frames = 0  # of the episodes before, whose rows precede in the data set
        self._episodes: list[dict[str, object]] = []  # rows of the table of episodes
        self._tasks: dict[str, int] = {}  # number of each task, in the order of their episodes
        self._stats = {name: ColumnStatistics(spec.shape) for name, spec in self._features.items()}

    def append(self, recording: Recording) -> None:
        """Write the data of an episode."""
        header = header_of(recording, recording.name)
        file = self._file_for_next()
        frames = EpisodeFrames(recording, header, self._layout)
        name = task_name(recording)
        task = self._tasks.setdefault(name, len(self._tasks))
        # In parts: windows repeat samples, so that frames are larger than their recording.
        for start in range(0, frames.n, MAX_GROUP_FRAMES):
            part = frames.columns(start, min(start + MAX_GROUP_FRAMES, frames.n))
            n = len(part["frame_index"])
            part["episode_index"] = np.full(n, len(self._episodes), dtype=np.int64)
            part["index"] = part["frame_index"] + self._n_frames
            part["task_index"] = np.full(n, task, dtype=np.int64)
            for column, values in part.items():
                self._stats[column].add(values)
            arrays = [nested(part[column], spec) for column, spec in self._features.items()]
            file.write_table(pa.Table.from_arrays(arrays, schema=self._schema))
        chunk, number = divmod(self._n_files - 1, FILES_PER_FOLDER)
        self._episodes.append(
            {
                "episode_index": len(self._episodes),
                "tasks": [name],
                "length": frames.n,
                "data/chunk_index": chunk,
                "data/file_index": number,
                "dataset_from_index": self._n_frames,
                "dataset_to_index": self._n_frames + frames.n,
                # All episodes are in one file of the table.
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                # What LeRobot has no place for; its readers ignore other columns.
                HEADER_COLUMN: encode_header(header).decode(),
                TEXTS_COLUMN: msgspec.json.encode(frames.texts).decode(),
            }
        )
        self._n_frames += frames.n

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
        # Small row groups: the importer reads headers of a few recordings at a time.
        pq.write_table(table, str(episodes), compression="zstd", row_group_size=64)
        write_tasks(self._folder / TASKS_PATH, self._tasks)
        totals = {
            "episodes": len(self._episodes), "frames": self._n_frames, "tasks": len(self._tasks)
        }  # fmt: skip
        info = {
            "codebase_version": VERSION,
            "robot_type": None,
            **{f"total_{name}": n for name, n in totals.items()},
            "chunks_size": FILES_PER_FOLDER,
            "data_files_size_in_mb": MAX_FILE_SIZE,
            "video_files_size_in_mb": MAX_VIDEO_SIZE,
            "fps": self._layout.fps,
            "splits": {"train": f"0:{totals['episodes']}"},
            "data_path": DATA_PATH,
            "video_path": None,
            "features": {
                name: {"dtype": spec.number, "shape": list(spec.shape), "names": None}
                for name, spec in self._features.items()
            },
        }
        write_json(self._folder / INFO_PATH, info)
        write_json(self._folder / MARKER_PATH, {"writer": "holdfast"})
        stats = {name: stats.result() for name, stats in self._stats.items()}
        write_json(self._folder / STATS_PATH, stats)
        (self._folder / "README.md").write_text(_CARD.format(version=VERSION), "utf-8")
        return totals


def task_name(recording: Recording) -> str:
    """Return the task of an episode: `task` of the metadata, or its object."""
    task, item = recording.metadata.get("task"), recording.metadata.get("object")
    if isinstance(task, str) and task:
        return task
    return f"grasp {item}" if isinstance(item, str) and item else UNKNOWN_TASK


def write_tasks(path: Path, tasks: Mapping[str, int]) -> None:
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


def write_json(path: Path, value: object) -> None:
    """Write a value as JSON for people to read."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(msgspec.json.format(msgspec.json.encode(value)))


class EpisodeFrames:
    """Frames of a recording, as arrays by column."""

    def __init__(self, recording: Recording, header: Header, layout: SharedColumns) -> None:
        self._layout = layout
        self._span = FrameSpan.of(recording, layout.fps)
        self.n = self._span.n_frames
        self.texts: dict[str, list[str]] = {}
        self._values: dict[str, npt.NDArray[Any]] = {}
        self._times: dict[str, Array] = {}
        arrays = arrays_of(recording)
        for spec in array_specs(header):
            self._times[track_name(spec)] = arrays[spec.topic][0]
        for spec in value_specs(array_specs(header)):
            values = arrays[spec.topic][1]
            if spec.number == "str":  # a data set of numbers has the number of each text
                self.texts[spec.column], values = text_codes(values)
            name = feature_name(spec)
            self._values[name] = values.astype(self._layout.values[name].number)
        self._labels = {
            feature_name(spec): recording.modules[spec.track].label_states
            for spec in array_specs(header)
            if spec.track != "truth"
        }
        self._ends = {track: self._span.ends(times) for track, times in self._times.items()}

    def columns(self, start: int, stop: int) -> dict[str, npt.NDArray[Any]]:
        """Return the columns of the frames from `start` up to `stop`."""
        columns: dict[str, npt.NDArray[Any]] = {}
        # All columns of the data set, also those of modules that this recording lacks.
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
                # One label a frame: that of the newest sample, which a policy acts on.
                label = windows(states.astype(np.int64), rows[:, -1:])
                columns[self._layout.labelled[track]] = label[:, 0]
        columns["frame_index"] = np.arange(start, stop)
        columns["timestamp"] = (columns["frame_index"] / self._layout.fps).astype(np.float32)
        return columns


class ColumnStatistics:
    """Mean, standard deviation and extremes of a column over all frames, without NaN."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._n_frames = 0
        self._n = np.zeros(shape)  # finite numbers of each component
        self._sum = np.zeros(shape)
        self._squares = np.zeros(shape)
        self._shift: Array | None = None
        self._min = np.full(shape, np.inf)
        self._max = np.full(shape, -np.inf)

    def add(self, values: npt.NDArray[Any]) -> None:
        """Add the values of consecutive frames."""
        with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one
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
        # JSON has neither NaN nor infinity.
        is_filled, n = self._n > 0, np.maximum(self._n, 1)
        shift = 0.0 if self._shift is None else self._shift
        with np.errstate(over="ignore", invalid="ignore"):
            mean = self._sum / n
            std = np.sqrt(np.maximum(self._squares / n - np.square(mean), 0.0))
        return {
            "min": np.where(is_filled, self._min, 0.0).tolist(),
            "max": np.where(is_filled, self._max, 0.0).tolist(),
            "mean": np.nan_to_num(np.where(is_filled, mean + shift, 0.0)).tolist(),
            "std": np.nan_to_num(std).tolist(),
            "count": [self._n_frames],
        }
