"""Model files: one of JSON, and the ONNX files that it names beside it."""

import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec
import numpy as np

from holdfast.classifiers import Onnx
from holdfast.classifiers.onnx_classifier import MAX_ONNX_SIZE
from holdfast.errors import ModelError, OutputError
from holdfast.files import check_keys, read_input, whole_file, write_whole
from holdfast.model.heads import Head
from holdfast.model.parts import FingerModel
from holdfast.sensors import Sensor
from holdfast.sensors.types import with_range

if TYPE_CHECKING:
    from holdfast.model.model import Model

ModelT = TypeVar("ModelT", bound="Model")
Fingers = Mapping[str, FingerModel]

MODEL_SCHEMA = "holdfast.model/2"
MAX_MODEL_SIZE = 1 << 24
"""Maximum size of a model file; one of all 18 modules of a hand has 2 MB [bytes]."""
ONNX_NAME = re.compile(r'"([0-9a-f]{16}\.onnx)"')
"""Name of an ONNX file in a model file, by the digest of its content."""


def read_model(path: str | Path, kind: type[ModelT]) -> ModelT:
    """Read a model and its ONNX files.

    Raises:
        ModelError: a file cannot be read or is no model, see `Model.load`.
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
        model = decode(data, kind)
        if any(rule.content for rule in _onnx_rules(model.fingers)):
            raise ModelError("a model file names its ONNX file; it does not hold the content")
        folder = Path(path).parent
        return _with_contents(model, lambda rule: _read_onnx(folder / rule.file))
    except (ModelError, TypeError, ValueError, ArithmeticError, RecursionError) as cause:
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
    """Write a model and its ONNX files: all of them or none.

    The ONNX files of a model that is replaced are deleted, unless a model beside it names them.

    Raises:
        OutputError: the file exists and `force` is not given, or it cannot be written.
    """
    if str(path).startswith("builtin:"):
        raise OutputError(f"{path} is the name of a built-in model; a file expected")
    # Read before the file is replaced: its ONNX files are deleted afterwards.
    replaced = _onnx_names(Path(path))
    written: list[Path] = []
    try:
        with whole_file(path, force=force) as part:
            part.write_bytes(msgspec.json.format(encode(model), indent=1) + b"\n")
            for rule in _onnx_rules(model.fingers):
                file = Path(path).with_name(rule.file)
                is_new = not file.exists()
                if is_new or file.read_bytes() != rule.content:
                    write_whole(file, rule.content, force=force)
                if is_new:
                    written.append(file)
    except BaseException:  # also Ctrl-C: all files or none
        for file in written:
            file.unlink(missing_ok=True)
        raise
    # Those that no model file beside it names.
    if replaced:
        folder, end = Path(path).parent, Path(path).suffix
        for other in {Path(path), *folder.glob("*.json"), *folder.glob(f"*{end}")}:
            replaced -= _onnx_names(other)
    for name in replaced:
        with suppress(OSError):  # a file too many does no harm
            Path(path).with_name(name).unlink(missing_ok=True)


def encode(model: "Model") -> bytes:
    """Return the JSON of a model, without the contents of ONNX files; their digests are in it."""
    fields = msgspec.to_builtins(_with_contents(model, lambda _: b""), enc_hook=_encode_array)
    sensors = {name: sensor.to_dict() for name, sensor in model.sensors.items()}
    return msgspec.json.encode(fields | {"sensors": sensors})


def decode(data: bytes, kind: type[ModelT]) -> ModelT:
    """Return the model of a JSON text, without the contents of ONNX files.

    Raises:
        ModelError: the fields contradict each other.
        ValueError: the text is no JSON, or of another form.
    """
    return msgspec.json.decode(data, type=kind, dec_hook=_decode_array)


def _onnx_rules(fingers: Fingers) -> list[Onnx]:
    rules = (head.rule for finger in fingers.values() for head in finger.heads)
    return [rule for rule in rules if isinstance(rule, Onnx)]


def _with_contents(model: ModelT, content_of: Callable[[Onnx], bytes]) -> ModelT:
    """Return the model with other contents of its ONNX files."""

    def changed(part: FingerModel) -> FingerModel:
        replace = msgspec.structs.replace
        heads = [
            replace(head, rule=replace(head.rule, content=content_of(head.rule)))
            for head in part.heads
            if isinstance(head.rule, Onnx)
        ]
        return part.with_heads(*heads)

    return model.changed(changed) if _onnx_rules(model.fingers) else model


def _read_onnx(path: Path) -> bytes:
    try:
        content = read_input(path, MAX_ONNX_SIZE)
    except OSError as cause:
        raise ModelError(f"cannot read {path.name} beside it: {cause.strerror}") from cause
    if not content:
        raise ModelError(f"{path.name} beside it is empty")
    return content


def _onnx_names(path: Path) -> set[str]:
    """Return the names of ONNX files in a model file; none if it cannot be read."""
    try:
        return set(ONNX_NAME.findall(read_input(path, MAX_MODEL_SIZE).decode(errors="replace")))
    except OSError:
        return set()


def _decode_array(kind: type, data: Any) -> Any:  # noqa: ANN401 (msgspec's own signature)
    return np.array(data, dtype=np.float64)  # the arrays of a sensor


def _encode_array(value: Any) -> Any:  # noqa: ANN401 (msgspec's own signature)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise NotImplementedError(type(value))
