"""Model files of JSON."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec
import numpy as np

from holdfast.detection.heads import Head
from holdfast.errors import ModelError, OutputError
from holdfast.files import check_keys, read_input, write_whole
from holdfast.removed import removal
from holdfast.sensors import Sensor
from holdfast.sensors.types import with_range

if TYPE_CHECKING:
    from holdfast.detection.model import Model

ModelT = TypeVar("ModelT", bound="Model")

MODEL_SCHEMA = "holdfast.model/2"
MAX_MODEL_SIZE = 1 << 24
"""Maximum size of a model file; one of all 18 modules of a hand has 2 MB [bytes]."""
ONNX_RULE = re.compile(rb'"type"\s*:\s*"onnx"')
"""What a model file has where the rule of a head is an ONNX file."""


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
        found = msgspec.json.decode(data)
        sensors = found.get("sensors") if isinstance(found, dict) else None
        if isinstance(sensors, dict):
            for name, fields in sensors.items():
                # A sensor is a dataclass, in which msgspec would ignore unknown fields.
                sensors[name] = with_range(fields if isinstance(fields, dict) else {})
                Sensor.from_dict(sensors[name])
            data = msgspec.json.encode(found)
        return decode(data, kind)
    except (ModelError, TypeError, ValueError, ArithmeticError, RecursionError) as cause:
        if ONNX_RULE.search(data):
            text = removal("rules", "onnx", "the ONNX classifier of this model")
            raise ModelError(f"{path}: {text}") from cause
        raise ModelError(f"{path} is not a model of {MODEL_SCHEMA}: {cause}") from cause


def facts_of(model: "Model") -> dict[str, Any]:
    """Return what a model is for, how it decides and what it was made from, as JSON has it.

    Means, scales and weights, and the location and scale of own handling, are in the file only.
    """
    fingers = {}
    for name, part in model.fingers.items():
        sensor = None if part.sensor is None else model.sensors[part.sensor]
        fingers[name] = {
            "sensor": part.sensor,
            "unit": None if sensor is None else sensor.unit,
            "heads": {head.name: _facts_of_head(head) for head in part.heads},
            "contact_threshold": part.contact_threshold,
            "contact_noise": part.contact_noise,
            "contact_load": part.contact_load,
            "normalised": part.normalised,
            "handling": {
                sensor_name: {
                    "seconds": handling.seconds,
                    "thresholds": handling.thresholds,
                    "recordings": list(handling.recordings),
                }
                for sensor_name, handling in part.handling.items()
            },
        }
    training = None
    if model.training is not None:
        training = msgspec.to_builtins(model.training)
        training["recordings"] = list(model.training.recordings)
        training.pop("blocks", None)
    return {
        "name": model.name,
        "rate": model.rate,
        "tare": model.tare,
        "debounce": msgspec.to_builtins(model.debounce),
        "fingers": fingers,
        "training": training,
    }


def _facts_of_head(head: Head) -> dict[str, Any]:
    fields: dict[str, Any] = msgspec.to_builtins(head)
    rule, n = fields.pop("rule"), head.rule.n_features
    fields["rule"] = f"{rule['type']}, {n} feature{'s' * (n > 1)}"
    fields["features"] = [str(spec) for spec in head.features]
    if head.choice is not None:
        fields["choice"] |= {"recordings": list(head.choice.recordings)}
    if head.link != "logit":
        del fields["threshold"]
    return fields


def write_model(path: str | Path, model: "Model", *, force: bool) -> None:
    """Write a model.

    Raises:
        OutputError: the file exists and `force` is not given, or it cannot be written.
    """
    if str(path).startswith("builtin:"):
        raise OutputError(f"{path} is the name of a built-in model; a file expected")
    write_whole(path, file_text(model), force=force)


def file_text(model: "Model") -> bytes:
    """Return the text of a model file."""
    return msgspec.json.format(encode(model), indent=1) + b"\n"


def encode(model: "Model") -> bytes:
    """Return the JSON of a model."""
    fields = msgspec.to_builtins(model, enc_hook=_encode_array)
    sensors = {name: sensor.to_dict() for name, sensor in model.sensors.items()}
    return msgspec.json.encode(fields | {"sensors": sensors})


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
