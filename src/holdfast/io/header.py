"""What a file says of its recording besides the numbers: one JSON, checked when read."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.recordings import Label, Recording, Truth
from holdfast.sensors import Sensor
from holdfast.sensors.types import Unit

NUMBERS = (
    *("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float32", "float64", "bool", "str"),
)
"""Number types that a file can hold."""


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


def number_of(array: npt.NDArray[Any], what: str) -> str:
    """The name of an array's number type.

    Raises:
        RecordingError: a file cannot hold it.
    """
    name = "str" if array.dtype.kind == "U" else array.dtype.name
    if name not in NUMBERS:
        raise RecordingError(f"{what} are {name}; a file holds {', '.join(NUMBERS)}")
    return name


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


def _plain(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} given")
