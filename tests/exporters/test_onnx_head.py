"""The exported ONNX file gives the probabilities of the classifiers, by onnxruntime."""

import numpy as np
import pytest
from msgspec.structs import replace

from detector.build import z_of
from exporters.models import HAND, built_in, paper, rich
from holdfast.classifiers import Onnx
from holdfast.errors import ModelError
from holdfast.exporters import export
from holdfast.exporters.model_export import onnx_of

pytest.importorskip("onnx", reason="onnx is not installed")
onnxruntime = pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")


def session(content):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])


@pytest.mark.parametrize("make", [paper, rich, lambda: built_in("twin"), lambda: built_in("any")])
def test_probabilities_are_those_of_the_classifiers(make):
    model = make()
    content, outputs = onnx_of(model)
    run, rng = session(content), np.random.default_rng(0)
    rows = {x.name: rng.normal(0.0, 3.0, (50, x.shape[1])) for x in run.get_inputs()}
    got = dict(zip(outputs, run.run(list(outputs), rows), strict=True))
    n_checked = 0
    for name, part in model.fingers.items():
        own = "any" if name == "*" else name
        expected = part.stable.rule.probability(rows[f"{own}_features"])
        np.testing.assert_allclose(got[f"{own}_stable"][:, 0], expected, atol=1e-12)
        n_checked += 1
        if part.slip is not None:
            rule = part.slip.linear
            z = z_of(rule, rows[f"{own}_slip_features"])
            expected = 1.0 / (1.0 + np.exp(-z))
            np.testing.assert_allclose(got[f"{own}_slip"][:, 0], expected, atol=1e-9)
            n_checked += 1
    assert n_checked == len(outputs)


def test_only_basic_operators_are_used():
    import onnx

    file = onnx.load_from_string(onnx_of(built_in("twin"))[0])
    assert {node.op_type for node in file.graph.node} <= {
        "MatMul", "Add", "Sigmoid", "Sub", "Mul", "Abs", "Min"
    }  # fmt: skip
    assert {x.key: x.value for x in file.metadata_props} == {
        "holdfast_model_digest": built_in("twin").digest
    }


def test_a_classifier_that_is_onnx_already_is_named(tmp_path):
    model = paper()
    other = replace(model.finger("*").stable, rule=Onnx.of(b"content", 5))
    model = model.changed(lambda part: part.with_heads(other))
    with pytest.raises(ModelError, match=r"ONNX file '.*' beside the model already; linear"):
        export(model, tmp_path / "model.onnx")
    with pytest.raises(ModelError, match="ONNX file, which has no form as C; a header holds"):
        export(model, tmp_path / "model.h", fingers=HAND)
    assert list(tmp_path.iterdir()) == []
