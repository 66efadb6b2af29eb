"""The arrays over time that a recording is made of, and the recording that they make."""

from collections.abc import Mapping
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
    label_of,
    sensors_of,
)
from holdfast.recordings import Label, Recording, Tactile, Truth
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

Samples = Mapping[str, tuple[Array, npt.NDArray[Any]]]
"""Times (n,) and values (n, ...) by topic."""


_EMPTY_CUT = "is cut so early that nothing can be recovered: it has no samples"


class Series(NamedTuple):
    """One array over time.

    Attributes:
        topic: its name in an MCAP file.
        column: its name in a Parquet file; its components append theirs.
        track: whose times it shares: the module's column name, or "truth".
        number: its number type; None where that is not known yet.
        shape: of one value.
        n: how many values; None where that is not known yet.
    """

    topic: str
    column: str
    track: str
    number: str | None
    shape: tuple[int, ...]
    n: int | None


def series_of(header: Header) -> list[Series]:
    """Every array over time that the header names."""
    every = [
        Series(
            f"/tactile/{name}",
            name,
            name,
            module.number,
            (len(module.sensor["positions"]), 3),
            module.n_samples,
        )
        for name, module in header.modules.items()
    ]
    if header.truth is not None:
        every += _truth_series(header.truth)
    return every


def samples_of(recording: Recording) -> dict[str, tuple[Array, npt.NDArray[Any]]]:
    """Times and values of every array over time, by topic."""
    samples = {f"/tactile/{name}": (m.times, m.readings) for name, m in recording.modules.items()}
    truth = recording.truth
    if truth is not None:
        samples["/truth/time"] = (truth.times, truth.times)
        for name, array in truth.hand.items():
            samples[f"/truth/hand/{name}"] = (truth.times, array)
        for finger, arrays in truth.fingers.items():
            for name, array in arrays.items():
                samples[f"/truth/finger/{finger}/{name}"] = (truth.times, array)
    return samples


def recording_from(
    header: Header, samples: Samples, path: Path, *, complete: bool = True
) -> Recording:
    """The recording of these samples, with its labels cut to them where they are a part.

    Args:
        header: as `decode` gives it.
        samples: by topic; a topic without samples may be missing.
        path: of the file, which lends its name where it has been renamed.
        complete: False where the end of the file was cut off.

    Raises:
        RecordingError: the samples contradict the header or each other.
    """
    sensors = sensors_of(header)
    if not any(len(samples[topic][0]) for topic in samples if topic.startswith("/tactile/")):
        state = "has no samples" if complete else _EMPTY_CUT
        raise RecordingError(f"{path} {state}")
    try:
        modules = {
            name: _tactile(module, sensors[name], samples.get(f"/tactile/{name}"))
            for name, module in header.modules.items()
        }
        return Recording(
            header.name if path.stem == header.file else path.stem,
            modules,
            header.metadata,
            _truth(header, samples),
            tuple(header.markers),
            tuple(header.media),
            complete=header.complete and complete,
        )
    except (RecordingError, ValueError) as cause:
        raise RecordingError(f"{path}: {cause}") from cause


def cut_labels(labels: tuple[Label, ...], module: Tactile) -> tuple[Label, ...]:
    """The labels over the samples of a module, cut to them."""
    if module.n_samples == 0:
        return ()
    first, last = float(module.times[0]), float(module.times[-1]) + module.period
    return tuple(
        replace(label, start=max(label.start, first), end=min(label.end, last))
        for label in labels
        if label.start < last and label.end > first
    )


def empty(series: Series) -> npt.NDArray[Any]:
    """No values of a series, in its number type and shape."""
    return np.empty((0, *series.shape), dtype=series.number or "float64")


def n_components(series: Series) -> int:
    """How many numbers one value has."""
    return prod(series.shape)


def _truth_series(truth: TruthData) -> list[Series]:
    named = [("/truth/time", "truth.time", ArrayData("float64", []))]
    named += [
        (f"/truth/hand/{name}", f"truth.hand.{name}", data) for name, data in truth.hand.items()
    ]
    named += [
        (f"/truth/finger/{finger}/{name}", f"truth.{finger}.{name}", data)
        for finger, arrays in truth.fingers.items()
        for name, data in arrays.items()
    ]
    return [
        Series(topic, column, "truth", data.number, tuple(data.shape), truth.n_rows)
        for topic, column, data in named
    ]


def _tactile(
    data: ModuleData, sensor: Sensor, samples: tuple[Array, npt.NDArray[Any]] | None
) -> Tactile:
    if samples is None:
        samples = (np.empty(0), np.empty((0, sensor.n_taxels, 3), data.number or "float64"))
    bare = Tactile(sensor, *samples, unit=data.unit)
    labels = tuple(label_of(label) for label in data.labels)
    whole = data.n_samples in (None, bare.n_samples)
    return replace(bare, labels=labels if whole and bare.n_samples else cut_labels(labels, bare))


def _truth(header: Header, samples: Samples) -> Truth | None:
    if header.truth is None:
        return None
    times, _ = samples.get("/truth/time", (np.empty(0), np.empty(0)))
    every = {
        series.topic: samples[series.topic][1] if series.topic in samples else empty(series)
        for series in _truth_series(header.truth)
    }
    return Truth(
        times,
        {name: every[f"/truth/hand/{name}"] for name in header.truth.hand},
        {
            finger: {name: every[f"/truth/finger/{finger}/{name}"] for name in arrays}
            for finger, arrays in header.truth.fingers.items()
        },
    )
