"""Frames of the episodes of a LeRobot data set, and statistics of its columns."""

from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.io.header import Header
from holdfast.io.timed_arrays import array_specs, arrays_of
from holdfast.recordings import Recording
from holdfast.sensors.types import Array
from holdfast_interop.lerobot.columns import FrameSpan, SharedColumns
from holdfast_interop.lerobot.layout import (
    count_name,
    feature_name,
    text_codes,
    time_name,
    track_name,
    value_specs,
    window_rows,
    windows,
)


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
