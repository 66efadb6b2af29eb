"""Export of recordings as a LeRobot data set (v3.0), by pyarrow alone."""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from holdfast.exporters.output import whole_folder
from holdfast.io.header import encode_header, header_of
from holdfast.recordings import Recording
from holdfast_interop.lerobot.columns import SharedColumns, arrow_schema, nested
from holdfast_interop.lerobot.frames import ColumnStatistics, EpisodeFrames
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
    with whole_folder(out, force=force, is_replaceable=_is_data_set) as folder:
        layout = SharedColumns(fps)
        for recording in recordings:
            layout.add(recording)
        with _Writer(folder, layout) as writer:
            for recording in progress(recordings):
                writer.append(recording)
        return writer.write_meta()


def _is_data_set(folder: Path) -> bool:
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
        name = _task(recording)
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
            str(self._path),
            self._schema,
            compression="zstd",
            use_dictionary=False,
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
        _write_tasks(self._folder / TASKS_PATH, self._tasks)
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
        _write_json(self._folder / INFO_PATH, info)
        _write_json(self._folder / MARKER_PATH, {"writer": "holdfast"})
        stats = {name: stats.result() for name, stats in self._stats.items()}
        _write_json(self._folder / STATS_PATH, stats)
        (self._folder / "README.md").write_text(_CARD.format(version=VERSION), "utf-8")
        return totals


def _task(recording: Recording) -> str:
    """Return the task of an episode: `task` of the metadata, or its object."""
    task, item = recording.metadata.get("task"), recording.metadata.get("object")
    if isinstance(task, str) and task:
        return task
    return f"grasp {item}" if isinstance(item, str) and item else UNKNOWN_TASK


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


def _write_json(path: Path, value: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(msgspec.json.format(msgspec.json.encode(value)))
