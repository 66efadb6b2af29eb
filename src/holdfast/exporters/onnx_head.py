"""The linear classifiers of a model as an ONNX file of basic operators.

Each output is 1 / (1 + exp(-z)) with z = w . phi + w_0, of MatMul, Add and Sigmoid, which every
runtime has. Features, tare and decision rule are not in it. The squares of a slip rule are
Sub, Mul, Abs and Min.
"""

from importlib import import_module
from typing import Any

import numpy as np

from holdfast.classifiers import Linear, Onnx
from holdfast.classifiers.linear import MAX_DEVIATION
from holdfast.errors import MissingExtra, ModelError
from holdfast.model import Model
from holdfast.sensors.types import Array

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
