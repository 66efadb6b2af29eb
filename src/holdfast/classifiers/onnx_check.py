"""Check of an ONNX file before onnxruntime sees it, and runs that end.

A file of 300 bytes can ask for a loop of 10^15 steps or an array of terabytes. So the operators
are those of trees, of small networks and of the exporter; none of them repeats others, and the
sizes of all values follow from the file. They are bounded here, with the operations that follow
from them, so that loading (where onnxruntime evaluates constants) and a run end as well.
"""

import os
from functools import cache
from importlib import import_module
from math import prod
from threading import Thread
from time import monotonic, sleep
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.errors import MissingExtra, ModelError

OPERATORS = frozenset({
    "Abs", "Add", "BatchNormalization", "Cast", "Clip", "Concat", "Constant", "Conv", "Div",
    "Elu", "Erf", "Exp", "Flatten", "Gather", "Gemm", "Identity", "LayerNormalization",
    "LeakyRelu", "Log", "MatMul", "Max", "Min", "Mul", "Neg", "Pad", "Pow", "ReduceMean",
    "ReduceSum", "ReduceSumSquare", "Relu", "Reshape", "Selu", "Sigmoid", "Slice", "Softmax",
    "Softplus", "Sqrt", "Squeeze", "Sub", "Tanh", "Transpose", "TreeEnsembleClassifier",
    "TreeEnsembleRegressor", "Unsqueeze",
})  # fmt: skip
"""Names of the operators that are allowed."""
MAX_ROWS = 128
"""Number of rows that are computed at once."""
MAX_NODES = 2000
"""Maximum number of operators in a file."""
MAX_COMPUTED_VALUES = 1 << 24
"""Maximum number of all values that are computed for `MAX_ROWS` rows (134 MB)."""
MAX_PRODUCTS = 1 << 31
"""Maximum number of products of all matrices and convolutions for `MAX_ROWS` rows."""
MAX_WINDOW_VALUES = 1 << 24
"""Maximum number of values that a convolution copies for a row, each as often as it is used."""
MAX_TREE_DEPTH = 500
"""Maximum depth of a tree; onnxruntime reads it by recursion."""
ROW_LIMIT, RUN_LIMIT = 1.0, 10.0
"""Maximum times of the first row, and of each `MAX_ROWS` rows [s]."""
WATCH_INTERVAL = 0.25
"""Time between two looks at the deadlines [s]."""
_running: dict[Any, float] = {}
"""Deadline by options of the runs of this process [s]."""


def checked(content: bytes, n_features: int) -> bytes:
    """Return an ONNX file without what was not checked, for rows of a number of features.

    Raises:
        MissingExtra: onnx is not installed.
        ModelError: the file is invalid, or has an operator, a size or a part that is not allowed.
    """
    try:
        onnx = import_module("onnx")
        import_module("onnx.shape_inference")
    except ImportError as cause:
        raise MissingExtra("onnx", "onnx") from cause
    try:
        model = onnx.load_model_from_string(content)
    except Exception as cause:  # protobuf has its own classes
        raise ModelError(f"the ONNX file of the model is invalid: {line(cause)}") from cause
    _check_parts(onnx, model, len(content))
    run: bytes = model.SerializeToString()
    for n_rows in (1, MAX_ROWS):
        _check_sizes(onnx, model, n_rows, n_features)
    return run


def line(cause: Exception) -> str:
    """Return the message of an exception as one short line."""
    return " ".join(str(cause).split())[:200]


def run_rows(
    session: Any,  # noqa: ANN401 (of onnxruntime)
    name: str,
    rows: npt.NDArray[np.floating[Any]],
    limit: float = RUN_LIMIT,
) -> npt.NDArray[Any]:
    """Return the output for rows; at the deadline, onnxruntime ends between two operators.

    Args:
        session: of a checked file.
        name: of the input.
        rows: (n, n_features), n > 0.
        limit: maximum time for each `MAX_ROWS` rows [s].

    Raises:
        ModelError: it takes longer, or fails.
    """
    options = import_module("onnxruntime").RunOptions()
    options.log_severity_level = 4
    parts = np.split(rows, range(MAX_ROWS, len(rows), MAX_ROWS))
    # By process: a thread does not go on in a process that is forked.
    _start_watch(os.getpid())
    _running[options] = monotonic() + limit * len(parts)
    try:
        return np.concatenate([session.run(None, {name: part}, options)[0] for part in parts])
    except Exception as cause:  # the classes of onnxruntime derive from Exception alone
        if options.terminate:
            raise _refusal(
                f"takes more than {limit * len(parts):g} s for {len(rows)} rows"
            ) from cause
        raise _refusal(f"cannot be run: {line(cause)}") from cause
    finally:
        del _running[options]


@cache
def _start_watch(_: int) -> None:
    """Start the thread of deadlines of a process; one for each run takes 0.15 ms."""
    Thread(target=_watch, daemon=True, name="holdfast-onnx").start()


def _watch() -> None:
    while True:
        sleep(WATCH_INTERVAL)
        # Of a copy: runs of other threads begin and end at any time.
        for options, deadline in list(_running.items()):
            if monotonic() > deadline:
                options.terminate = True


def _check_parts(onnx: Any, model: Any, size: int) -> None:  # noqa: ANN401 (a module)
    """Check operators, attributes and constants, which are read but not evaluated."""
    graph = model.graph
    for part in ("functions", "training_info"):
        if getattr(model, part):
            raise _refusal(f"has {part}; operators in one graph expected")
    if graph.sparse_initializer:
        raise _refusal("has sparse_initializer; arrays with all values expected")
    if len(graph.node) > MAX_NODES:
        raise _refusal(f"has {len(graph.node)} operators; at most {MAX_NODES} expected")
    types = [getattr(onnx.TensorProto, n) for n in ("FLOAT", "DOUBLE", "INT32", "INT64", "BOOL")]
    for node in graph.node:
        _check_node(onnx, node, types)
    constants = [part.t for node in graph.node for part in node.attribute if part.HasField("t")]
    for array in (*graph.initializer, *constants):
        if array.data_location == onnx.TensorProto.EXTERNAL or array.external_data:
            raise _refusal("keeps data in other files; a single file expected")
        if array.data_type not in types or any(length < 0 for length in array.dims):
            raise _refusal(
                f"has the constant {array.name!r} of type {array.data_type} and shape "
                f"{tuple(array.dims)}; float, double, int32, int64 and bool are allowed"
            )
    n_values = sum(prod(array.dims) for array in (*graph.initializer, *constants))
    if n_values > size:  # each value takes a byte or more
        raise _refusal(f"states constants of {n_values} values and has {size} bytes")


def _check_node(onnx: Any, node: Any, types: list[int]) -> None:  # noqa: ANN401 (a module)
    kinds = onnx.AttributeProto
    is_tree = str(node.op_type).startswith("Tree")  # it is bytes if it is not UTF-8
    plain = {kinds.FLOAT, kinds.INT, kinds.STRING, kinds.FLOATS, kinds.INTS, kinds.STRINGS}
    domains = ("ai.onnx.ml",) if is_tree else ("", "ai.onnx")
    if node.op_type not in OPERATORS or node.domain not in domains:
        name = f"{node.domain}.{node.op_type}".lstrip(".")
        raise _refusal(f"has the operator {name!r}; {', '.join(sorted(OPERATORS))} are allowed")
    names = [attribute.name for attribute in node.attribute]
    if len(set(names)) < len(names):
        raise _refusal(f"has a {node.op_type} with an attribute twice")
    for attribute in node.attribute:
        is_plain = attribute.type in plain | {kinds.TENSOR}
        if not is_plain or attribute.HasField("g") or attribute.graphs:
            raise _refusal(
                f"has the attribute {attribute.name!r} of {node.op_type}; numbers, text and "
                "arrays are allowed, no graphs"
            )
        if node.op_type == "Cast" and attribute.name == "to" and attribute.i not in types:
            raise _refusal(f"has a Cast to type {attribute.i}; numbers are allowed")
    if is_tree:
        _check_trees(node)


def _check_trees(node: Any) -> None:  # noqa: ANN401 (of onnx)
    """Check that each branch leads to a node of a higher number, and thus to a leaf."""
    given = {part.name: [*part.ints, *part.strings] for part in node.attribute}
    names = ("treeids", "nodeids", "truenodeids", "falsenodeids", "modes")
    columns = [given.get(f"nodes_{name}", []) for name in names]
    if len({len(column) for column in columns}) > 1:
        raise _refusal(f"has a {node.op_type} whose columns differ in length")
    depths: dict[tuple[int, int], int] = {}
    for tree, number, *branches, mode in sorted(zip(*columns, strict=True)):
        depth = depths.get((tree, number), 0)
        for branch in () if mode == b"LEAF" else branches:
            if branch <= number:
                raise _refusal(f"has a tree whose node {number} leads to {branch}, not a later one")
            depths[tree, branch] = max(depths.get((tree, branch), 0), depth + 1)
        if depth > MAX_TREE_DEPTH:
            raise _refusal(f"has a tree deeper than {MAX_TREE_DEPTH} branches")


def _check_sizes(onnx: Any, model: Any, n_rows: int, n_features: int) -> None:  # noqa: ANN401
    """Check the sizes of all values for a number of rows; the shapes in the model are lost."""
    graph = model.graph
    constants = {array.name: tuple(array.dims) for array in graph.initializer}
    inputs = [value for value in graph.input if value.name not in constants]
    if len(inputs) != 1:
        raise _refusal(f"has {len(inputs)} inputs; one expected")
    del graph.value_info[:]
    for value in graph.output:
        value.type.tensor_type.ClearField("shape")
    inputs[0].type.tensor_type.ClearField("shape")
    for length in (n_rows, n_features):
        inputs[0].type.tensor_type.shape.dim.add().dim_value = length
    try:
        found = onnx.shape_inference.infer_shapes(model, strict_mode=True).graph
    except Exception as cause:  # onnx has its own classes
        raise ModelError(f"the ONNX file of the model is invalid: {line(cause)}") from cause
    shapes = constants | {
        value.name: tuple(dim.dim_value if dim.HasField("dim_value") else -1 for dim in shape.dim)
        for value in (*inputs, *found.value_info, *found.output)
        if (shape := value.type.tensor_type.shape) is not None
        and value.type.tensor_type.HasField("shape")
    }
    names = [array.name for array in graph.initializer] + [inputs[0].name]
    names += [name for node in graph.node for name in node.output if name]
    if len(set(names)) < len(names):
        raise _refusal("gives two values one name")
    n_values = n_products = 0
    for node in graph.node:
        outputs = [shapes.get(name, (-1,)) for name in node.output if name]
        if any(length < 0 for shape in outputs for length in shape):
            raise _refusal(f"has a {node.op_type} whose size is known only when it runs")
        n_values += sum(map(prod, outputs))
        if node.op_type in ("MatMul", "Gemm", "Conv"):
            n_products += _n_products(node, shapes)
    for number, limit, what in (
        (n_values, MAX_COMPUTED_VALUES, "values"), (n_products, MAX_PRODUCTS, "products")
    ):  # fmt: skip
        if number > limit:
            raise _refusal(
                f"computes {number} {what} for {n_rows} rows; at most {limit} are allowed"
            )


def _n_products(node: Any, shapes: dict[str, tuple[int, ...]]) -> int:  # noqa: ANN401 (of onnx)
    """Return an upper bound of the number of products of a node."""
    first, second, output = (shapes[name] for name in (*node.input[:2], node.output[0]))
    if node.op_type != "Conv":
        return prod(output) * max(first[-2:], default=1)
    if prod(second[1:]) * prod(output[2:]) > MAX_WINDOW_VALUES:
        raise _refusal(f"has a Conv that copies more than {MAX_WINDOW_VALUES} values a row")
    return prod(output) * prod(second[1:])


def _refusal(text: str) -> ModelError:
    return ModelError(f"the ONNX file of the model {text}")
