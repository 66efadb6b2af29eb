"""Layout of a LeRobot data set (v3.0) of recordings: names, types and windows of its columns.

A frame k is at k/fps after the first sample. For each array of a recording it has the newest
samples up to that time, a window of a fixed number of samples, so that several rates fit into
one table. `new` counts the samples at the end of the window that are later than the frame
before; these, joined, are the array again. All else is the header of the recording, in a column
of the table of episodes.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.io.timed_arrays import TRUTH_TIME, ArraySpec
from holdfast.sensors.types import Array, Integers

VERSION = "v3.0"
"""Version of the format."""
INFO_PATH, TASKS_PATH, STATS_PATH = "meta/info.json", "meta/tasks.parquet", "meta/stats.json"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
FILES_PER_FOLDER = 1000
"""Maximum number of files in a folder."""

HEADER_COLUMN, TEXTS_COLUMN = "holdfast.header", "holdfast.texts"
"""Columns of the table of episodes: the header of the recording, and the different texts of each
array of texts by its column; the data have their numbers."""

FRAME_TOLERANCE = 1e-6
"""Share of a frame by which a sample may be late for it; covers rounding errors of times."""

_FLOAT32 = ("int8", "uint8", "int16", "uint16", "float32")
"""Number types of readings that float32 holds without loss, which is what policies train on."""
_FLOAT64 = ("int32", "uint32", "float64")


def feature_name(spec: ArraySpec) -> str:
    """Return the name of the column of an array; LeRobot allows no `/` in it.

    Example:
        >>> feature_name(ArraySpec("/tactile/index/1", "index/1", "index/1", "uint16", (5, 3), 9))
        'observation.tactile.index.1'
    """
    prefix = "" if spec.track == "truth" else "observation.tactile."
    return f"{prefix}{spec.column}".replace("/", ".")


def track_name(spec: ArraySpec) -> str:
    """Return the beginning of the names of the columns of times and counts of an array."""
    return "truth" if spec.track == "truth" else feature_name(spec)


def time_name(track: str) -> str:
    """Return the name of the column of the times of a track."""
    return f"{track}.time"


def count_name(track: str) -> str:
    """Return the name of the column of the number of new samples of a track."""
    return f"{track}.new"


def stored_type(spec: ArraySpec) -> str:
    """Return the number type of an array in the data set, which holds its values exactly."""
    # The data sets of LeRobot are tables of numbers: a text becomes its number in a list.
    number = spec.number or "float64"
    if number == "str":
        return "int64"
    if spec.track == "truth":
        return number
    return "float32" if number in _FLOAT32 else "float64" if number in _FLOAT64 else number


def value_specs(specs: Sequence[ArraySpec]) -> list[ArraySpec]:
    """Return the arrays that have a column of their own: all but times and empty values."""
    return [spec for spec in specs if spec.topic != TRUTH_TIME and spec.n_components]


def frame_ends(times: Array, start: float, fps: int, n_frames: int) -> Integers:
    """Return the number of samples up to each frame, (n_frames,).

    Args:
        times: (n,) strictly increasing [s].
        start: time of frame 0 [s].
        fps: frames per second.
        n_frames: number of frames.
    """
    return np.searchsorted(frame_numbers(times, start, fps), np.arange(n_frames), side="right")


def frame_numbers(times: Array, start: float, fps: int) -> Array:
    """Return the first frame that is not before each sample, (n,)."""
    # Up, not to the nearest: a frame never has a sample of its future.
    return np.maximum(np.ceil((times - start) * fps - FRAME_TOLERANCE), 0.0)


def window_rows(ends: Integers, width: int) -> Integers:
    """Return the samples in the window of each frame, (n_frames, width).

    A window that is longer than the samples so far repeats the first one; -1 marks a frame before
    it.

    Example:
        >>> window_rows(np.array([0, 1, 4]), 2).tolist()
        [[-1, -1], [0, 0], [2, 3]]
    """
    rows = ends[:, None] - width + np.arange(width)
    return np.where(ends[:, None] > 0, np.maximum(rows, 0), -1)


def windows(values: npt.NDArray[Any], rows: Integers) -> npt.NDArray[Any]:
    """Return the samples of each window, NaN (or 0) where there is none yet."""
    missing = np.nan if values.dtype.kind == "f" else 0
    # The row -1 of a frame before the first sample is the value that is added at the end.
    padded = np.concatenate([values, np.full((1, *values.shape[1:]), missing, values.dtype)])
    return padded[rows]


def joined_windows(values: npt.NDArray[Any], n_new: Integers) -> npt.NDArray[Any]:
    """Return the samples that `windows` has divided into frames.

    Args:
        values: (n_frames, width, ...) windows.
        n_new: (n_frames,) number of new samples of each frame.

    Raises:
        ValueError: a frame has more new samples than its window.

    Example:
        >>> joined_windows(np.array([[0, 0], [1, 2]]), np.array([1, 2])).tolist()
        [0, 1, 2]
    """
    width = values.shape[1]
    if ((n_new < 0) | (n_new > width)).any():
        raise ValueError(f"0 to {width} new samples in a frame expected")
    return np.asarray(values[np.arange(width) >= width - n_new[:, None]])


def text_codes(array: npt.NDArray[Any]) -> tuple[list[str], Integers]:
    """Return the different texts of an array, and the number of the text of each value."""
    texts, codes = np.unique(array, return_inverse=True)
    return texts.tolist(), codes.reshape(array.shape).astype(np.int64)


def texts_of(texts: Mapping[str, Sequence[str]], column: str, codes: Integers) -> npt.NDArray[Any]:
    """Return the array of texts that `text_codes` has numbered.

    Raises:
        ValueError: there is no text of a number.
    """
    words = np.array(texts.get(column, ()), dtype=str)
    if codes.size and not (codes.min() >= 0 and codes.max() < len(words)):
        raise ValueError(f"{column}: a number without a text; there are {len(words)} texts")
    return words[codes] if len(words) else np.empty(codes.shape, dtype="U1")
