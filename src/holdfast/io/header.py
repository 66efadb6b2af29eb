"""Header of a recording's file: all of the recording but its arrays, as JSON."""

from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.recordings import Label, Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import Unit

NumberType = Literal[
    "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64",
    "float32", "float64", "bool", "str",
]  # fmt: skip
NUMBER_TYPES: tuple[str, ...] = get_args(NumberType)
"""Number types that a file can store."""

MAX_VALUES = 1 << 20
"""Maximum number of values of an array at one time."""
MAX_HEADER_SIZE = 1 << 25
"""Maximum size of a header [bytes]; in memory, its JSON takes up to 32 times as much."""
Count = Annotated[int, msgspec.Meta(ge=0, lt=1 << 48)]
Shape = Annotated[
    list[Annotated[int, msgspec.Meta(ge=0, le=MAX_VALUES)]], msgspec.Meta(max_length=8)
]


class LabelData(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A label in a file. Fields as in `Label`; states in lower case."""

    start: float
    end: float
    state: Literal["stable", "unstable", "no_contact"]
    cause: Cause | None = None
    evidence: str = ""
    confidence: float = 1.0
    author: str = ""


_STATE_NAMES: Mapping[ContactState, Any] = {x: x.value.lower() for x in ContactState}
"""One text for all labels of a state."""


class ModuleData(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A module in a file; `number` and `n_samples` are None while recording."""

    sensor: dict[str, Any]
    unit: Unit
    number: NumberType | None = None
    n_samples: Count | None = None
    labels: list[LabelData] = []


class ArrayData(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Number type of a truth array, and shape of one of its values."""

    number: NumberType
    shape: Shape

    def __post_init__(self) -> None:
        # The schema limits each size, not their product.
        if prod(self.shape) > MAX_VALUES:
            raise ValueError(f"at most {MAX_VALUES} values expected, shape {self.shape} given")


class TruthData(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Truth arrays in a file, and the number of their rows."""

    n_rows: Count
    hand: dict[str, ArrayData]
    fingers: dict[str, dict[str, ArrayData]]


class Header(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All of a recording but its arrays.

    Attributes:
        schema: kind and version of the header.
        name: name of the recording.
        file: stem of the file's name when it was written. If the file is renamed, its stem is
            the name of the recording.
        modules: modules by name, in the order of the recording.
        truth: layout of the truth arrays.
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
    """Return the header of a recording, for a file with the stem `file`."""
    modules = {
        name: ModuleData(
            module.sensor.to_dict(),
            module.unit or module.sensor.unit,
            number_type(module.readings, f"readings of {name}"),
            module.n_samples,
            [label_data(label) for label in module.labels],
        )
        for name, module in recording.modules.items()
    }
    truth = None
    if (arrays := recording.truth) is not None:
        # A `Truth` takes any times; row groups and messages are cut by them, so they must increase.
        steps = np.diff(arrays.times)
        if not (np.isfinite(arrays.times).all() and (steps > 0).all()):
            raise RecordingError("truth needs finite, strictly increasing times to be written")
        fingers = {finger: _array_data(by_name) for finger, by_name in arrays.fingers.items()}
        truth = TruthData(len(arrays.times), _array_data(arrays.hand), fingers)
    return Header(
        name=recording.name,
        file=file,
        modules=modules,
        truth=truth,
        metadata=dict(recording.metadata),
        markers=list(recording.markers),
        media=list(recording.media),
        complete=recording.complete,
        digest=recording.digest,
    )


def encode_header(header: Header) -> bytes:
    """Encode a header as JSON.

    Raises:
        RecordingError: the metadata have values that JSON cannot store.
    """
    try:
        return msgspec.json.encode(header, enc_hook=_json_value)
    except (TypeError, ValueError, UnicodeError) as cause:
        raise RecordingError(
            f"recording {header.name!r} cannot be written: its metadata, names and texts must be "
            f"plain JSON values ({cause})"
        ) from cause


def decode_header(data: bytes | str, path: Path) -> Header:
    """Decode the JSON of a header.

    Args:
        data: JSON text.
        path: path of the file, for the error message.

    Raises:
        RecordingError: the JSON is not a header, has another schema, or is too large.
    """
    if len(data) > MAX_HEADER_SIZE:
        raise RecordingError(
            f"{path}: a header of {len(data)} bytes given, at most {MAX_HEADER_SIZE} expected"
        )
    try:
        header = msgspec.json.decode(data, type=Header)
        # Only to refuse it here: what a sensor accepts is checked by `Sensor`, not by the schema.
        header_sensors(header)
    except (
        msgspec.DecodeError, ValueError, TypeError, LookupError, ArithmeticError, RecursionError
    ) as cause:  # fmt: skip
        raise RecordingError(f"{path}: the header of the recording is refused: {cause}") from cause
    return header


def header_sensors(header: Header) -> dict[str, Sensor]:
    """Return the sensor of each module.

    Raises:
        ValueError: `Sensor` does not accept one.
    """
    return {name: Sensor.from_dict(module.sensor) for name, module in header.modules.items()}


def label_data(label: Label) -> LabelData:
    """Convert a label to its form in a file."""
    return LabelData(
        float(label.start), float(label.end), _STATE_NAMES[label.state], label.cause,
        label.evidence, float(label.confidence), label.author,
    )  # fmt: skip


def label_of(data: LabelData) -> Label:
    """Convert a label in a file to a `Label`.

    Raises:
        ValueError: its interval or its confidence is not valid.
    """
    return Label(**{**msgspec.structs.asdict(data), "state": data.state.upper()})


def number_type(array: npt.NDArray[Any], name: str) -> NumberType:
    """Return the name of an array's number type.

    Args:
        array: the array.
        name: name of the array, for the error message.

    Raises:
        RecordingError: a file cannot store it.
    """
    number = "str" if array.dtype.kind == "U" else array.dtype.name
    if number not in NUMBER_TYPES:
        raise RecordingError(f"{name} are {number}; a file stores {', '.join(NUMBER_TYPES)}")
    return number  # type: ignore[return-value]


def _array_data(arrays: Mapping[str, npt.NDArray[Any]]) -> dict[str, ArrayData]:
    return {
        name: ArrayData(number_type(array, f"truth {name}"), list(array.shape[1:]))
        for name, array in arrays.items()
    }


def _json_value(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} given")
