"""Arrays over time that a recording consists of, and the recording that they make."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.io.header import (
    ArrayData,
    Header,
    ModuleData,
    TruthData,
    header_sensors,
    label_of,
)
from holdfast.recordings import Recording, Tactile, Truth, cut_labels
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

TimedArray = tuple[Array, npt.NDArray[Any]]
"""Times (n,) [s] and values (n, ...)."""
TimedArrays = Mapping[str, TimedArray]
"""Times and values by topic."""

TACTILE, TRUTH = "/tactile/", "/truth/"
"""Beginnings of the topics of modules and of truth arrays."""
TRUTH_TIME = f"{TRUTH}time"
"""Topic of the times of the truth arrays."""


class ArraySpec(NamedTuple):
    """Names, type and size of one array over time.

    Attributes:
        topic: name in an MCAP file.
        column: name in a Parquet file; the names of its components begin with it.
        track: arrays of one track have the same times: the module's name, or "truth".
        number: number type; None if it is not known yet.
        shape: shape of one value.
        n: number of values; None if it is not known yet.
    """

    topic: str
    column: str
    track: str
    number: str | None
    shape: tuple[int, ...]
    n: int | None

    @property
    def n_components(self) -> int:
        """Number of components of one value."""
        return prod(self.shape)

    def empty(self) -> npt.NDArray[Any]:
        """Return an array without values, of the right number type and shape."""
        return np.empty((0, *self.shape), dtype=self.number or "float64")


def array_specs(header: Header) -> list[ArraySpec]:
    """Return the specification of every array over time that the header names."""
    specs = [
        ArraySpec(
            f"{TACTILE}{name}",
            name,
            name,
            module.number,
            (len(module.sensor["positions"]), 3),
            module.n_samples,
        )
        for name, module in header.modules.items()
    ]
    return specs if header.truth is None else specs + _truth_specs(header.truth)


def arrays_of(recording: Recording) -> dict[str, TimedArray]:
    """Return times and values of every array over time, by topic."""
    arrays = {f"{TACTILE}{name}": (m.times, m.readings) for name, m in recording.modules.items()}
    truth = recording.truth
    if truth is not None:
        arrays[TRUTH_TIME] = (truth.times, truth.times)
        for name, values in truth.hand.items():
            arrays[f"{TRUTH}hand/{name}"] = (truth.times, values)
        for finger, by_name in truth.fingers.items():
            for name, values in by_name.items():
                arrays[f"{TRUTH}finger/{finger}/{name}"] = (truth.times, values)
    return arrays


def recording_from(
    header: Header, arrays: TimedArrays, path: Path, *, complete: bool = True
) -> Recording:
    """Make a recording of a header and arrays; labels are cut to the samples.

    Args:
        header: header of the recording.
        arrays: arrays by topic; a topic without samples may be missing.
        path: path of the file. If it was renamed, its stem is the name of the recording.
        complete: False if the end of the file was cut off.

    Raises:
        RecordingError: the arrays contradict the header or each other.
    """
    sensors = header_sensors(header)
    if not any(len(arrays[topic][0]) for topic in arrays if topic.startswith(TACTILE)):
        raise RecordingError(
            f"{path} has no samples"
            if complete
            else f"{path} is cut so early that nothing can be recovered: it has no samples"
        )
    try:
        modules = {
            name: _tactile(module, sensors[name], arrays.get(f"{TACTILE}{name}"))
            for name, module in header.modules.items()
        }
        return Recording(
            header.name if path.stem == header.file else path.stem,
            modules,
            header.metadata,
            _truth(header, arrays),
            tuple(header.markers),
            tuple(header.media),
            complete=header.complete and complete,
        )
    except (RecordingError, ValueError) as cause:
        raise RecordingError(f"{path}: {cause}") from cause


def time_spans(
    times: Mapping[str, Array],
    seconds: float,
    max_samples: int = 1 << 62,
    limited: Collection[str] | None = None,
) -> Iterator[dict[str, slice]]:
    """Divide arrays into consecutive spans of time.

    A span begins at the next sample of any array, so that gaps give no empty spans.

    Args:
        times: (n,) strictly increasing [s], by key.
        seconds: maximum duration of a span [s].
        max_samples: maximum number of samples of one array in a span.
        limited: keys of the arrays that `max_samples` applies to; all if it is None.

    Yields:
        For each key the slice of its samples, which may be empty.

    Example:
        >>> for span in time_spans({"a": np.arange(5.0), "b": np.array([3.0])}, 3.0):
        ...     print(span["a"], span["b"])
        slice(0, 3, None) slice(0, 0, None)
        slice(3, 5, None) slice(0, 1, None)
    """
    first = dict.fromkeys(times, 0)
    while left := [key for key in times if first[key] < len(times[key])]:
        start = min(float(times[key][first[key]]) for key in left)
        # At times so large that the sum is rounded to `start`, a span still has one sample.
        end = max(start + seconds, float(np.nextafter(start, np.inf)))
        for key in left:
            if key in (limited or times) and first[key] + max_samples < len(times[key]):
                end = min(end, float(times[key][first[key] + max_samples]))
        last = {key: int(np.searchsorted(times[key], end)) for key in times}
        yield {key: slice(first[key], max(first[key], last[key])) for key in times}
        first = last


def _truth_specs(truth: TruthData) -> list[ArraySpec]:
    named = [(TRUTH_TIME, "truth.time", ArrayData("float64", []))]
    named += [
        (f"{TRUTH}hand/{name}", f"truth.hand.{name}", data) for name, data in truth.hand.items()
    ]
    named += [
        (f"{TRUTH}finger/{finger}/{name}", f"truth.{finger}.{name}", data)
        for finger, arrays in truth.fingers.items()
        for name, data in arrays.items()
    ]
    return [
        ArraySpec(topic, column, "truth", data.number, tuple(data.shape), truth.n_rows)
        for topic, column, data in named
    ]


def _tactile(data: ModuleData, sensor: Sensor, samples: TimedArray | None) -> Tactile:
    if samples is None:
        samples = (np.empty(0), np.empty((0, sensor.n_taxels, 3), data.number or "float64"))
    module = Tactile(sensor, *samples, unit=data.unit)
    if module.n_samples and data.n_samples in (None, module.n_samples):
        return replace(module, labels=tuple(map(label_of, data.labels)))
    if not module.n_samples:
        return module
    # Of a part: the others are not made, which would take longer than to read its samples.
    first, last = float(module.times[0]), float(module.times[-1]) + module.period
    near = [label for label in data.labels if label.start < last and label.end > first]
    return replace(module, labels=cut_labels(tuple(map(label_of, near)), module))


def _truth(header: Header, arrays: TimedArrays) -> Truth | None:
    if header.truth is None:
        return None
    times, _ = arrays.get(TRUTH_TIME, (np.empty(0), np.empty(0)))
    values = {
        spec.topic: arrays[spec.topic][1] if spec.topic in arrays else spec.empty()
        for spec in _truth_specs(header.truth)
    }
    return Truth(
        times,
        {name: values[f"{TRUTH}hand/{name}"] for name in header.truth.hand},
        {
            finger: {name: values[f"{TRUTH}finger/{finger}/{name}"] for name in by_name}
            for finger, by_name in header.truth.fingers.items()
        },
    )
