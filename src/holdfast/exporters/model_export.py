"""Export of a model to a file that other programs use: a C99 header or an ONNX file."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from holdfast.classifiers import Linear, Onnx
from holdfast.classifiers.linear import MAX_DEVIATION
from holdfast.errors import MissingExtra, ModelError
from holdfast.exporters.c_header import CHeader, header_of
from holdfast.features.start import Start
from holdfast.files import refuse_overwrite, write_whole
from holdfast.model import ANY_FINGER, Model
from holdfast.recordings import Recording
from holdfast.sensors import Sensor, sensor
from holdfast.sensors.types import Array

HEADER_SUFFIX, ONNX_SUFFIX = ".h", ".onnx"


class ExportedModel(NamedTuple):
    """What was written.

    Attributes:
        path: of the file.
        fingers: their names, in the order of the readings; of an ONNX file, its outputs.
        size: of the file [bytes].
        header: the header, if it is one.
    """

    path: Path
    fingers: tuple[str, ...]
    size: int
    header: CHeader | None = None


def export(
    model: Model,
    path: str | Path,
    like: Recording | None = None,
    *,
    fingers: Mapping[str, Sensor] | None = None,
    single: bool = False,
    in_contact: bool | None = None,
    force: bool = False,
) -> ExportedModel:
    """Write a model as a C99 header (`.h`) or its linear classifiers as an ONNX file (`.onnx`).

    The header has tare, features, faults and decision rule: it gives what `Detector` gives. The
    ONNX file expects features that something else has computed.

    Args:
        model: the model.
        path: of the output.
        like: recording with the fingers, sensors and rate of the hand. An ONNX file needs it only
            for a model with own handling.
        fingers: sensor of each finger instead of a recording; by default those that the model
            names.
        single: numbers of the header are of single precision; times stay double.
        in_contact: the first samples are load; None if the metadata of the recording say it.
        force: replace an existing file.

    Raises:
        ModelError: a part of the model cannot be exported, or the fingers do not fit.
        OutputError: the file exists and `force` is not given, or it cannot be written.
        ValueError: the suffix is none of these.
    """
    target = Path(path)
    refuse_overwrite(target, force=force)
    if target.suffix == ONNX_SUFFIX:
        sensors = _fingers_like(model, like) if like is not None else dict(fingers or {})
        content, outputs = onnx_of(model.with_handling_of(sensors) if sensors else model)
        write_whole(target, content, force=force)
        return ExportedModel(target, outputs, len(content))
    if target.suffix != HEADER_SUFFIX:
        raise ValueError(f"{target}: a model is exported as {HEADER_SUFFIX} (C99) or {ONNX_SUFFIX}")
    if like is None:
        sensors = named_fingers(model) if fingers is None else dict(fingers)
        rate, start = next(iter(model.fingers_of(sensors).values())).rate, Start(in_contact is True)
    else:
        sensors, rate = _fingers_like(model, like), like.rate
        start = Start.of(like.with_start(loaded=in_contact).metadata, sensors)
    header = header_of(model, sensors, rate, single=single, start=start)
    data = header.text.encode()
    write_whole(target, data, force=force)
    return ExportedModel(target, tuple(model.fingers_of(sensors)), len(data), header)


def named_fingers(model: Model) -> dict[str, Sensor]:
    """Return the fingers that a model names, with their sensors.

    Raises:
        ModelError: the model is for any finger or sensor.
    """
    if ANY_FINGER in model.fingers or any(f.sensor is None for f in model.fingers.values()):
        raise ModelError(
            "the model is for any finger: a recording of the hand (--like), or its sensor and its "
            "fingers (--sensor NAME --fingers N), are expected"
        )
    return {name: model.sensors[str(part.sensor)] for name, part in model.fingers.items()}


def fingers_of_sensor(name: str, fingers: str) -> dict[str, Sensor]:
    """Return fingers of one sensor: so many, or with names.

    Args:
        name: of the sensor.
        fingers: a number, or names with commas between them.

    Raises:
        ValueError: the sensor is unknown, or the fingers are neither of these.

    Example:
        >>> list(fingers_of_sensor("uskin-curved", "2"))
        ['finger1', 'finger2']
    """
    used = sensor(name)
    names: Sequence[str] = [word.strip() for word in fingers.split(",")]
    if fingers.strip().isdecimal() and int(fingers) > 0:
        names = [f"finger{n + 1}" for n in range(int(fingers))]
    if not all(names) or len(set(names)) < len(names) or names == ["0"]:
        raise ValueError(
            f"fingers: a number from 1 on or different names with commas expected; {fingers!r} "
            "given"
        )
    return dict.fromkeys(names, used)


def _fingers_like(model: Model, like: Recording) -> dict[str, Sensor]:
    """Return the fingers of the model on the hand of a recording, which must have all of them."""
    sensors = model.fingers_of({name: m.sensor for name, m in like.modules.items()})
    missing = [name for name in sensors if name not in like.modules]
    if missing:
        raise ModelError(
            f"recording {like.name!r} has {', '.join(like.modules)}; the model is for "
            f"{', '.join(sensors)}: a recording with all of them expected"
        )
    if not model.rate_fits(like.rate):
        raise ModelError(
            f"recording {like.name!r} has {like.rate:.4g} Hz, the model expects {model.rate:.4g} "
            "Hz: a header does not resample; a recording at the rate of the model expected"
        )
    return sensors


OPSET, IR_VERSION = 13, 8
"""Versions that runtimes of 2021 and later read."""


class _Graph:
    """Nodes and constants of a graph.

    Args:
        onnx: the package.
    """

    def __init__(self, onnx: Any) -> None:  # noqa: ANN401 (a module)
        self.onnx = onnx
        self.nodes: list[Any] = []
        self.constants: list[Any] = []
        self.inputs: list[Any] = []
        self.outputs: list[Any] = []

    def constant(self, name: str, values: Array) -> str:
        """Add an array of constants, and return its name."""
        array = np.asarray(values, dtype=np.float64)
        self.constants.append(self.onnx.numpy_helper.from_array(array, name))
        return name

    def node(self, operator: str, inputs: list[str], output: str) -> str:
        """Add an operator, and return the name of its output."""
        self.nodes.append(self.onnx.helper.make_node(operator, inputs, [output]))
        return output

    def linear(self, name: str, rule: Linear) -> str:
        """Add w . phi + w_0 with its input, and return its name."""
        # Scale and calibration are inside the weights: the input is features as they are computed.
        weights = rule.raw_weights()[0]
        self.inputs.append(self.value(f"{name}_features", rule.n_features))
        factors = self.constant(f"{name}_weights", weights[1:, None])
        product = self.node("MatMul", [f"{name}_features", factors], f"{name}_product")
        offset = self.constant(f"{name}_offset", weights[:1])
        return self.node("Add", [product, offset], f"{name}_log_odds")

    def with_squares(self, name: str, value: str, rule: Linear) -> str:
        """Add sum_j q_j min(|u_j|, 5)^2 with u_j = (phi_j - mean_j) / scale_j; return its name."""
        mean, scale, weight = rule.raw_squares()
        means = self.constant(f"{name}_mean", mean)
        apart = self.node("Sub", [f"{name}_features", means], f"{name}_apart")
        scales = self.constant(f"{name}_scale", scale)
        deviation = self.node("Mul", [apart, scales], f"{name}_deviation")
        size = self.node("Abs", [deviation], f"{name}_size")
        limit = self.constant(f"{name}_limit", np.array([MAX_DEVIATION]))
        bounded = self.node("Min", [size, limit], f"{name}_bounded")
        square = self.node("Mul", [bounded, bounded], f"{name}_square")
        weights = self.constant(f"{name}_square_weights", weight[:, None])
        squares = self.node("MatMul", [square, weights], f"{name}_squares")
        return self.node("Add", [value, squares], f"{name}_with_squares")

    def finish(self, name: str, value: str) -> None:
        """Add the logistic function as an output."""
        self.node("Sigmoid", [value], name)
        self.outputs.append(self.value(name, 1))

    def value(self, name: str, width: int) -> Any:  # noqa: ANN401 (of onnx)
        """Return the description of (n, width) numbers."""
        double = self.onnx.TensorProto.DOUBLE
        return self.onnx.helper.make_tensor_value_info(name, double, ["n", width])


def onnx_of(model: Model) -> tuple[bytes, tuple[str, ...]]:
    """Return an ONNX file of the classifiers of a model, and the names of its outputs.

    Each output is 1 / (1 + exp(-z)) with z = w . phi + w_0, of MatMul, Add and Sigmoid, which every
    runtime has. Features, tare and decision rule are not in it. The squares of a slip rule are Sub,
    Mul, Abs and Min.

    For each finger there is an input `FINGER_features`, (n, n_features) float64, and an output
    `FINGER_stable`, (n, 1); with a slip rule `FINGER_slip_features` and `FINGER_slip`, before
    smoothing. `*` is `any` in these names.

    Raises:
        MissingExtra: onnx is not installed.
        ModelError: a classifier is an ONNX file already, or own handling is not folded in.
    """
    try:
        onnx = import_module("onnx")
    except ImportError as cause:
        raise MissingExtra("onnx", "onnx") from cause
    graph = _Graph(onnx)
    for finger, part in model.fingers.items():
        name = "any" if finger == "*" else finger
        if isinstance(part.stable.rule, Onnx):
            raise ModelError(
                f"the classifier of {name} is the ONNX file {part.stable.rule.file!r} beside the "
                "model already; linear classifiers are exported"
            )
        if part.handling:
            raise ModelError(
                f"the model has own handling of {', '.join(part.handling)}; a recording of the "
                "hand (--like) or its sensor and fingers expected, so that one of them is used"
            )
        graph.finish(f"{name}_stable", graph.linear(name, part.stable.linear))
        if part.slip is not None:
            rule, slip = part.slip.linear, f"{name}_slip"
            value = graph.linear(slip, rule)
            graph.finish(slip, graph.with_squares(slip, value, rule) if rule.squares else value)
    made = onnx.helper.make_graph(
        graph.nodes, "holdfast", graph.inputs, graph.outputs, graph.constants
    )
    file = onnx.helper.make_model(
        made, opset_imports=[onnx.helper.make_opsetid("", OPSET)], ir_version=IR_VERSION
    )
    onnx.helper.set_model_props(file, {"holdfast_model_digest": model.digest})
    onnx.checker.check_model(file)
    content: bytes = file.SerializeToString()
    return content, tuple(output.name for output in graph.outputs)
