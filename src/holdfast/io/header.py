"""What a file says of its recording besides the numbers: one JSON, checked when read."""

from collections.abc import Mapping
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.recordings import Label, Recording, Tactile, Truth
from holdfast.sensors import Sensor
from holdfast.sensors.values import Array, Unit

NUMBERS = (
    *("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float32", "float64", "bool", "str"),
)
"""Number types that a file can hold."""

Samples = Mapping[str, tuple[Array, npt.NDArray[Any]]]
"""Times (n,) and values (n, ...) by topic."""


_EMPTY_CUT = "is cut so early that nothing can be recovered: it has no samples"


class LabelData(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A label as a file holds it; fields as in `Label`, states in lower case."""

    start: float
    end: float
    state: Literal["stable", "unstable", "no_contact"]
    cause: Cause | None = None
    evidence: str = ""
    confidence: float = 1.0
    author: str = ""


class ModuleData(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is known of a module; `number` and `n_samples` are None while recording."""

    sensor: dict[str, Any]
    unit: Unit
    number: str | None = None
    n_samples: int | None = None
    labels: list[LabelData] = []


class ArrayData(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Number type and shape of one value of a truth array."""

    number: str
    shape: list[int]


class TruthData(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which truth arrays there are, and how many rows each has."""

    n_rows: int
    hand: dict[str, ArrayData]
    fingers: dict[str, dict[str, ArrayData]]


class Header(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All of a recording but its numbers.

    Attributes:
        schema: which kind and version of header it is.
        name: of the recording.
        file: stem of the file's name as written; a file renamed since lends its new name.
        modules: by name, in the order of the recording.
        truth: the layout of the truth arrays.
        metadata: as in `Recording`.
        markers: as in `Recording`.
        media: as in `Recording`.
        complete: as in `Recording`.
        digest: `Recording.digest`; empty while recording.
    """

    schema: Literal["holdfast.recording/1"] = "holdfast.recording/1"
    name: str
    file: str
    modules: dict[str, ModuleData]
    truth: TruthData | None = None
    metadata: dict[str, Any] = {}
    markers: list[tuple[float, str]] = []
    media: list[tuple[str, float]] = []
    complete: bool = True
    digest: str = ""


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


def header_of(recording: Recording, file: str) -> Header:
    """The header of a recording that is to be written to a file with the stem `file`."""
    modules = {
        name: ModuleData(
            module.sensor.to_dict(),
            module.unit or module.sensor.unit,
            number_of(module.readings, f"readings of {name}"),
            module.n_samples,
            [label_data(label) for label in module.labels],
        )
        for name, module in recording.modules.items()
    }
    return Header(
        name=recording.name,
        file=file,
        modules=modules,
        truth=None if recording.truth is None else _truth_data(recording.truth),
        metadata=dict(recording.metadata),
        markers=list(recording.markers),
        media=list(recording.media),
        complete=recording.complete,
        digest=recording.digest,
    )


def encode(header: Header) -> bytes:
    """The header as JSON.

    Raises:
        RecordingError: the metadata hold what JSON cannot.
    """
    try:
        return msgspec.json.encode(header, enc_hook=_plain)
    except (TypeError, ValueError, UnicodeError) as cause:
        raise RecordingError(
            f"recording {header.name!r} cannot be written: its metadata, names and texts must be "
            f"plain JSON values ({cause})"
        ) from cause


def decode(data: bytes | str, path: Path) -> Header:
    """The header out of its JSON.

    Raises:
        RecordingError: it is none, or of another schema.
    """
    try:
        header = msgspec.json.decode(data, type=Header)
        sensors_of(header)
    except (msgspec.DecodeError, ValueError, TypeError, IndexError) as cause:
        raise RecordingError(f"{path}: the header of the recording is refused: {cause}") from cause
    return header


def sensors_of(header: Header) -> dict[str, Sensor]:
    """The sensor of each module.

    Raises:
        ValueError: a sensor that `Sensor` does not accept.
    """
    return {name: Sensor.from_dict(module.sensor) for name, module in header.modules.items()}


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


def label_data(label: Label) -> LabelData:
    """The label as a file holds it."""
    state: Any = label.state.value.lower()
    return LabelData(
        float(label.start),
        float(label.end),
        state,
        label.cause,
        label.evidence,
        float(label.confidence),
        label.author,
    )


def label_of(data: LabelData) -> Label:
    """The label that a file holds.

    Raises:
        ValueError: its interval or its confidence is none.
    """
    return Label(
        data.start,
        data.end,
        ContactState(data.state.upper()),
        data.cause,
        data.evidence,
        data.confidence,
        data.author,
    )


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


def number_of(array: npt.NDArray[Any], what: str) -> str:
    """The name of an array's number type.

    Raises:
        RecordingError: a file cannot hold it.
    """
    name = "str" if array.dtype.kind == "U" else array.dtype.name
    if name not in NUMBERS:
        raise RecordingError(f"{what} are {name}; a file holds {', '.join(NUMBERS)}")
    return name


def empty(series: Series) -> npt.NDArray[Any]:
    """No values of a series, in its number type and shape."""
    return np.empty((0, *series.shape), dtype=series.number or "float64")


def n_components(series: Series) -> int:
    """How many numbers one value has."""
    return prod(series.shape)


def _truth_data(truth: Truth) -> TruthData:
    steps = np.diff(truth.times)
    if not (np.isfinite(truth.times).all() and (steps > 0).all()):
        raise RecordingError("truth needs finite, strictly increasing times to be written")
    return TruthData(
        len(truth.times),
        _arrays_data(truth.hand),
        {finger: _arrays_data(arrays) for finger, arrays in truth.fingers.items()},
    )


def _arrays_data(arrays: Mapping[str, npt.NDArray[Any]]) -> dict[str, ArrayData]:
    return {
        name: ArrayData(number_of(array, f"truth {name}"), list(array.shape[1:]))
        for name, array in arrays.items()
    }


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


def _plain(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} given")
