"""Columns of a LeRobot data set: what recordings share, frames of a recording, Arrow types."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from holdfast.errors import RecordingError
from holdfast.io.header import header_of
from holdfast.io.timed_arrays import TRUTH_TIME, ArraySpec, array_specs, arrays_of
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Integers
from holdfast_interop.lerobot.layout import (
    count_name,
    feature_name,
    frame_ends,
    frame_numbers,
    stored_type,
    time_name,
    track_name,
    value_specs,
)

MAX_FRAMES_PER_SAMPLE = 100
"""Number of frames for a sample from which on a recording is refused: it is mostly gaps."""
MAX_SHORT_FRAMES = 100_000
"""Number of frames that every recording may have."""
LABEL_PREFIX = "label."
"""Beginning of the names of the columns of labels; the rest is the name of the module."""
_LIMIT_AXES = 5
"""LeRobot's maximum number of axes of a feature."""


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
        check_columns(recording.name, specs)
        span = FrameSpan.of(recording, self.fps)
        arrays = arrays_of(recording)
        for spec in specs:
            times = arrays[spec.topic][0]
            track = track_name(spec)
            # A window holds all new samples of a frame, or the joined windows would lack some.
            self.widths[track] = max(self.widths.get(track, 1), span.width(times))
        for spec in value_specs(specs):
            name, number = feature_name(spec), stored_type(spec)
            column = self.values.get(name, ColumnSpec(number, spec.shape))
            pair = {column.number, number}
            # The type that holds the values of both exactly; only floats have one besides equals.
            common = number if len(pair) == 1 else "float64"
            if column.shape != spec.shape or (len(pair) > 1 and pair != {"float32", "float64"}):
                raise RecordingError(
                    f"{recording.name}: {name} has {number} of shape {spec.shape}, in the "
                    f"recordings before {column.number} of {column.shape}; a data set has one "
                    "shape: export them apart"
                )
            if len(spec.shape) >= _LIMIT_AXES:
                raise RecordingError(
                    f"{recording.name}: {name} has {len(spec.shape)} axes; at most 4"
                )
            self.values[name] = ColumnSpec(common, spec.shape)
            self.tracks[name] = track_name(spec)
        for name, module in recording.modules.items():
            feature = feature_name(next(spec for spec in specs if spec.track == name))
            unit = str(module.unit)
            if self.units.setdefault(feature, unit) != unit:
                raise RecordingError(
                    f"{recording.name}: {name} is in {unit}, in the recordings before in "
                    f"{self.units[feature]}; export them apart"
                )
            self.labelled[feature] = f"{LABEL_PREFIX}{name}".replace("/", ".")

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


class FrameSpan(NamedTuple):
    """Time of the frames of a recording: start [s], rate [Hz] and number."""

    start: float
    fps: int
    n_frames: int

    @classmethod
    def of(cls, recording: Recording, fps: int) -> "FrameSpan":
        """Return the frames from the first to the last sample or truth.

        Raises:
            RecordingError: there are far more frames than samples.
        """
        tracks = [times for times, _ in arrays_of(recording).values() if len(times)]
        # Frame 0 has the first sample of all tracks, so that no track begins before it.
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


def check_columns(recording: str, specs: Sequence[ArraySpec]) -> None:
    """Check that no two arrays share a column."""
    names = [feature_name(spec) for spec in specs if spec.topic != TRUTH_TIME]
    tracks = list(dict.fromkeys(map(track_name, specs)))
    names += [name(track) for track in tracks for name in (time_name, count_name)]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise RecordingError(
            f"{recording}: two arrays would share the column {repeated[0]!r} of LeRobot, which "
            "allows no '/' in a name; rename a module"
        )


def nested(values: npt.NDArray[Any], spec: ColumnSpec) -> pa.Array:
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


def arrow_schema(features: Mapping[str, ColumnSpec]) -> pa.Schema:
    """Return the schema of the tables of frames, as the library `datasets` writes it."""
    types = {}
    for name, spec in features.items():
        kind = pa.bool_() if spec.number == "bool" else pa.from_numpy_dtype(np.dtype(spec.number))
        if len(spec.shape) == 1:
            types[name] = kind if spec.shape == (1,) else pa.list_(kind, spec.shape[0])
        else:
            # Of several axes: lists of no fixed length inside each other.
            for _ in spec.shape:
                kind = pa.list_(kind)
            types[name] = kind
    return pa.schema(list(types.items()))
