"""Model files of JSON."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from holdfast.errors import ModelError, OutputError
from holdfast.files import check_keys, read_input, write_whole
from holdfast.removed import removal
from holdfast.sensors import Sensor
from holdfast.sensors.types import with_range

ModelT = TypeVar("ModelT", bound=msgspec.Struct)

MODEL_SCHEMA = "holdfast.model/2"
MAX_MODEL_SIZE = 1 << 24
"""Maximum size of a model file; one of all 18 modules of a hand has 2 MB [bytes]."""
PARTS = re.compile(rb'"(type|kind)"\s*:\s*"(\w+)"')
"""Part of a model file with the name of the rule of a head, or of a feature."""


def read_model(path: str | Path, kind: type[ModelT]) -> ModelT:
    """Read a model.

    Raises:
        ModelError: the file cannot be read or is no model, see `Model.load`.
    """
    try:
        data = read_input(path, MAX_MODEL_SIZE)
    except OSError as cause:
        raise ModelError(f"cannot read the model {path}: {cause.strerror}") from cause
    try:
        check_keys(data)
        document = msgspec.json.decode(data)
        sensors = document.get("sensors") if isinstance(document, dict) else None
        if isinstance(sensors, dict):
            for name, fields in sensors.items():
                # A sensor is a dataclass, in which msgspec would ignore unknown fields.
                sensors[name] = with_range(fields if isinstance(fields, dict) else {})
                Sensor.from_dict(sensors[name])
            data = msgspec.json.encode(document)
        return decode(data, kind)
    except (ModelError, TypeError, ValueError, ArithmeticError, RecursionError) as cause:
        for key, name in ((key, name.decode()) for key, name in PARTS.findall(data)):
            part = "rule" if key == b"type" else "feature"
            if text := removal(f"{part}s", name, f"the {part} {name} of this model"):
                raise ModelError(f"{path}: {text}") from cause
        raise ModelError(f"{path} is not a model of {MODEL_SCHEMA}: {cause}") from cause


def write_model(path: str | Path, data: bytes, *, force: bool) -> None:
    """Write the JSON of a model.

    Raises:
        OutputError: the file exists and `force` is not given, or it cannot be written.
    """
    if str(path).startswith("builtin:"):
        raise OutputError(f"{path} is the name of a built-in model; a file expected")
    write_whole(path, file_text(data), force=force)


def file_text(data: bytes) -> bytes:
    """Return the text of a model file."""
    return msgspec.json.format(data, indent=1) + b"\n"


def encode(model: msgspec.Struct, sensors: Mapping[str, Sensor]) -> bytes:
    """Return the JSON of a model and its sensors."""
    fields = msgspec.to_builtins(model, enc_hook=_encode_array)
    documents = {name: sensor.to_dict() for name, sensor in sensors.items()}
    return msgspec.json.encode(fields | {"sensors": documents})


def decode(data: bytes, kind: type[ModelT]) -> ModelT:
    """Return the model of a JSON text.

    Raises:
        ModelError: the fields contradict each other.
        ValueError: the text is no JSON, or of another form.
    """
    return msgspec.json.decode(data, type=kind, dec_hook=_decode_array)


def _decode_array(kind: type, data: Any) -> Any:  # noqa: ANN401 (msgspec's own signature)
    return np.array(data, dtype=np.float64)  # the arrays of a sensor


def _encode_array(value: Any) -> Any:  # noqa: ANN401 (msgspec's own signature)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise NotImplementedError(type(value))
