"""ONNX files that would take all memory or never end are refused before onnxruntime sees them."""

import numpy as np
import pytest

pytest.importorskip("onnx", reason="it needs the package onnx")
pytest.importorskip("onnxruntime", reason="it needs the extra onnx")

import onnxruntime
from onnx import TensorProto, helper, numpy_helper

from holdfast.classifiers import Onnx
from holdfast.errors import ModelError

FLOAT = TensorProto.FLOAT
BEGIN = "the ONNX file of the model "
TREE = {
    "nodes_treeids": [0] * 3, "nodes_nodeids": [0, 1, 2], "nodes_featureids": [0] * 3,
    "nodes_modes": ["BRANCH_LEQ", "LEAF", "LEAF"], "nodes_values": [0.5, 0.0, 0.0],
    "nodes_truenodeids": [1, 0, 0], "nodes_falsenodeids": [2, 0, 0], "target_treeids": [0, 0],
    "target_nodeids": [1, 2], "target_ids": [0, 0], "target_weights": [0.2, 0.8], "n_targets": 1,
}  # fmt: skip


def classifier(*nodes, change=lambda model: None, n_features=2, **constants):
    """A classifier from the input x to the output y."""
    graph = helper.make_graph(
        nodes,
        "test",
        [helper.make_tensor_value_info("x", FLOAT, ["n", n_features])],
        [helper.make_tensor_value_info("y", FLOAT, None)],
        [numpy_helper.from_array(np.asarray(array), name) for name, array in constants.items()],
    )
    opsets = [helper.make_opsetid("", 17), helper.make_opsetid("ai.onnx.ml", 3)]
    model = helper.make_model(graph, opset_imports=opsets, ir_version=9)
    change(model)
    return Onnx.of(model.SerializeToString(), n_features)


def node(operator, *inputs, output="y", **attributes):
    return helper.make_node(operator, inputs, [output], **attributes)


def trees(**changes):
    return node("TreeEnsembleRegressor", "x", domain="ai.onnx.ml", **{**TREE, **changes})


def chain(n):
    """A path of n branches, each leaf of which is the right branch."""
    ids = list(range(2 * n + 1))
    leaf = [0] * (2 * n + 1)
    return trees(
        nodes_treeids=leaf, nodes_nodeids=ids, nodes_featureids=leaf,
        nodes_modes=["BRANCH_LEQ", "LEAF"] * n + ["LEAF"], nodes_values=[0.5] * len(ids),
        nodes_truenodeids=[i + 2 if i % 2 == 0 and i < 2 * n else 0 for i in ids],
        nodes_falsenodeids=[i + 1 if i % 2 == 0 and i < 2 * n else 0 for i in ids],
    )  # fmt: skip


def loop():
    body = helper.make_graph(
        [node("Identity", "c", output="d"), node("Identity", "a", output="b")],
        "body",
        [helper.make_tensor_value_info("i", TensorProto.INT64, []),
         helper.make_tensor_value_info("c", TensorProto.BOOL, []),
         helper.make_tensor_value_info("a", FLOAT, None)],
        [helper.make_tensor_value_info("d", TensorProto.BOOL, []),
         helper.make_tensor_value_info("b", FLOAT, None)],
    )  # fmt: skip
    return node("Loop", "n", "", "x", body=body)


def external(model):
    model.graph.initializer[0].data_location = TensorProto.EXTERNAL


def function(model):
    own = helper.make_function("own", "F", ["a"], ["b"], [], [helper.make_opsetid("", 17)])
    model.functions.append(own)


def sparse(model):
    values = numpy_helper.from_array(np.ones(1, np.float32), "s")
    places = numpy_helper.from_array(np.zeros(1, np.int64))
    array = helper.make_sparse_tensor(values, places, [1 << 40])
    model.graph.sparse_initializer.append(array)


def stated(model):
    model.graph.initializer[0].dims[:] = [1 << 20, 1 << 20]


def negative(model):
    model.graph.initializer[0].dims[:] = [-1]


def twice(model):
    model.graph.node[0].attribute.extend([helper.make_attribute("a", 1)] * 2)


ONE = np.ones(1, np.float32)
LONG = np.array([1, 1 << 30], np.int64)
IDENTITY = node("Sigmoid", "x")
HOSTILE = {
    "a loop of 10^15": (lambda: classifier(loop(), n=10**15), "has the operator 'Loop'; Abs, Add,"),
    "expand": (
        lambda: classifier(node("Expand", "one", "long"), one=ONE, long=LONG),
        "has the operator 'Expand'; Abs, Add,",
    ),
    "constant of shape": (
        lambda: classifier(node("ConstantOfShape", "long"), long=LONG),
        "has the operator 'ConstantOfShape'; Abs, Add,",
    ),
    "another domain": (
        lambda: classifier(node("Gemm", "x", domain="com.microsoft")),
        "has the operator 'com.microsoft.Gemm'; Abs, Add,",
    ),
    "a graph in an attribute": (
        lambda: classifier(node("Sigmoid", "x", body=loop().attribute[0].g)),
        "has the attribute 'body' of Sigmoid; numbers, text and arrays are allowed, no graphs",
    ),
    "a function": (
        lambda: classifier(IDENTITY, change=function),
        "has functions; operators in one graph expected",
    ),
    "a sparse array": (
        lambda: classifier(IDENTITY, change=sparse),
        "has sparse_initializer; arrays with all values expected",
    ),
    "another file": (
        lambda: classifier(IDENTITY, change=external, one=ONE),
        "keeps data in other files; a single file expected",
    ),
    "a constant without content": (
        lambda: classifier(IDENTITY, change=stated, one=ONE),
        "states constants of 1099511627776 values and has ",
    ),
    "a negative length": (
        lambda: classifier(IDENTITY, change=negative, one=ONE),
        "has the constant 'one' of type 1 and shape (-1,); float, double, int32, int64 and bool",
    ),
    "a cast to text": (
        lambda: classifier(node("Cast", "x", to=TensorProto.STRING)),
        "has a Cast to type 8; numbers are allowed",
    ),
    "an attribute twice": (
        lambda: classifier(IDENTITY, change=twice),
        "has a Sigmoid with an attribute twice",
    ),
    "a name twice": (
        lambda: classifier(IDENTITY, y=ONE),
        "gives two values one name",
    ),
    "too many operators": (
        lambda: classifier(*[node("Abs", "x", output=f"y{i}") for i in range(2000)], IDENTITY),
        "has 2001 operators; at most 2000 expected",
    ),
    "broadcasting": (
        lambda: classifier(
            node("MatMul", "a", "b"),
            a=np.ones((1 << 13, 1), np.float32),
            b=np.ones((1, 1 << 13), np.float32),
        ),
        "computes 67108864 values for 1 rows; at most 16777216 are allowed",
    ),
    "padding": (
        lambda: classifier(node("Pad", "x", "p"), p=np.array([0, 0, 0, 1 << 40], np.int64)),
        "computes 1099511627778 values for 1 rows; at most 16777216 are allowed",
    ),
    "doubling": (
        lambda: classifier(
            *[node("Concat", p, p, output=q, axis=1) for p, q in zip(
                ["x", *(f"c{i}" for i in range(40))], [*(f"c{i}" for i in range(40)), "y"],
                strict=True,
            )]
        ),
        "computes 8796093022204 values for 1 rows; at most 16777216 are allowed",
    ),
    "products": (
        lambda: classifier(
            *[node("MatMul", "a", "a", output=f"p{i}") for i in range(20)],
            IDENTITY,
            a=np.ones((512, 512), np.float32),
        ),
        "computes 2684354560 products for 1 rows; at most 2147483648 are allowed",
    ),
    "windows of a convolution": (
        lambda: classifier(
            node("Unsqueeze", "x", "axis", output="u"),
            node("Conv", "u", "w", pads=[1 << 16, 1 << 16]),
            axis=np.array([1], np.int64),
            w=np.ones((1, 1, 1 << 16), np.float32),
        ),
        "has a Conv that copies more than 16777216 values a row",
    ),
    "a size by the data": (
        lambda: classifier(
            node("Cast", "x", output="i", to=TensorProto.INT64),
            node("Squeeze", "i", output="s"),
            node("Reshape", "x", "s"),
        ),
        "has a Reshape whose size is known only when it runs",
    ),
    "two inputs": (
        lambda: classifier(
            IDENTITY, change=lambda model: model.graph.input.append(
                helper.make_tensor_value_info("z", FLOAT, ["n", 1])
            )
        ),
        "has 2 inputs; one expected",
    ),
    "a tree that is a ring": (
        lambda: classifier(trees(nodes_truenodeids=[0, 0, 0])),
        "has a tree whose node 0 leads to 0, not a later one",
    ),
    "a deep tree": (lambda: classifier(chain(501)), "has a tree deeper than 500 branches"),
    "columns of a tree": (
        lambda: classifier(trees(nodes_treeids=[0])),
        "has a TreeEnsembleRegressor whose columns differ in length",
    ),
    "many targets": (
        lambda: classifier(trees(n_targets=1 << 40)),
        "computes 1099511627776 values for 1 rows; at most 16777216 are allowed",
    ),
}  # fmt: skip


def test_a_name_that_is_no_text_is_one_line():
    damaged = classifier(IDENTITY).content.replace(b"Sigmoid", b"Sigmoi\xff")
    with pytest.raises(ModelError) as raised:
        Onnx.of(damaged, 2).probability(np.zeros((1, 2)))
    assert "\n" not in str(raised.value)
    assert "Sigmoi" in str(raised.value)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_refused_before_onnxruntime_sees_it(name, monkeypatch):
    def see(*given, **more):
        raise RuntimeError("onnxruntime sees it")

    monkeypatch.setattr(onnxruntime, "InferenceSession", see)
    make, message = HOSTILE[name]
    hostile = make()
    with pytest.raises(ModelError) as raised:
        hostile.probability(np.zeros((1, 2)))
    assert str(raised.value).startswith(BEGIN + message)
    assert "\n" not in str(raised.value)


def test_shapes_that_do_not_fit_are_one_line():
    with pytest.raises(ModelError) as raised:
        classifier(node("MatMul", "x", "w"), w=np.ones((3, 1), np.float32)).probability(
            np.zeros((1, 2))
        )
    assert str(raised.value).startswith(f"{BEGIN}is invalid: ")
    assert "\n" not in str(raised.value)


def test_trees_and_networks_are_allowed():
    rows = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert classifier(trees()).probability(rows) == pytest.approx([0.2, 0.8])
    steps = classifier(  # a causal convolution, as in the network of the study
        node("Reshape", "x", "shape", output="r"),
        node("Pad", "r", "pads", output="p"),
        node("Conv", "p", "w", output="c"),
        node("Transpose", "c", output="t", perm=[0, 2, 1]),
        node("LayerNormalization", "t", "gain", output="l"),
        node("Selu", "l", output="s"),
        node("Gather", "s", "last", output="g", axis=1),
        node("Gemm", "g", "dense", output="d", transB=1),
        node("Softmax", "d", output="m"),
        node("Gather", "m", "last", axis=1),
        shape=np.array([-1, 3, 4]), pads=np.array([0, 0, 2, 0, 0, 0]), gain=np.ones(5, np.float32),
        w=np.ones((5, 3, 3), np.float32), last=np.array(1), dense=np.ones((2, 5), np.float32),
        n_features=12,
    )  # fmt: skip
    assert steps.probability(np.ones((300, 12))) == pytest.approx(np.full(300, 0.5))


def slow():
    """A file with nearly as many values as are allowed, of which 1000 runs take many seconds."""
    parts = [node("Tanh", f"t{i}", output=f"t{i + 1}") for i in range(59)]
    return classifier(
        node("MatMul", "x", "wide", output="t0"), *parts,
        node("ReduceMean", "t59", output="y", axes=[1], keepdims=0),
        wide=np.ones((2, 2000), np.float32),
    )  # fmt: skip


def test_a_run_ends_at_its_deadline(monkeypatch):
    from holdfast.classifiers import onnx_check

    model = slow()
    assert model.probability(np.zeros((1, 2))) == [0.0]
    monkeypatch.setattr(onnx_check.run_rows, "__defaults__", (0.0,))
    with pytest.raises(ModelError) as raised:
        model.probability(np.zeros((1000 * 128, 2)))
    assert str(raised.value) == f"{BEGIN}takes more than 0 s for 128000 rows"


def test_the_first_row_is_timed(monkeypatch):
    from holdfast.classifiers import onnx_check

    limits, run = [], onnx_check.run_rows
    monkeypatch.setattr(
        "holdfast.classifiers.onnx_classifier.run_rows",
        lambda session, name, rows, *limit: (
            limits.append((len(rows), *limit)) or run(session, name, rows, *limit)
        ),
    )
    classifier(node("Sigmoid", "x", output="s"), node("ReduceMean", "s", axes=[1], keepdims=0)
    ).probability(np.zeros((3, 2)))  # fmt: skip
    assert limits == [(1, onnx_check.ROW_LIMIT), (3,)]
