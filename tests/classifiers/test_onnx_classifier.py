"""A classifier in an ONNX file beside its model."""

import json
import subprocess
import sys

import msgspec
import numpy as np
import pytest

from holdfast.classifiers import Linear
from holdfast.classifiers.onnx_classifier import MAX_ONNX_SIZE, Onnx
from holdfast.contact import STABLE, UNKNOWN
from holdfast.detector import Detector, detect
from holdfast.errors import MissingExtra, ModelError, OutputError
from holdfast.features import FeatureSpec
from holdfast.model import ANY_FINGER, Debounce, FingerModel, Head, Model
from holdfast.synthetic import synthetic_recording
from holdfast.training import evaluate

WHY = "it needs the extra onnx (onnxruntime) and, to make files, the package onnx"
FEATURES = (
    FeatureSpec("F_a", transform="log", floor=1.0),
    FeatureSpec("sigma", 14, "log", floor=1.0),
)
UNREAD = Onnx.of(b"not read", 2)


def content(outputs=1, output="p"):
    """p = sigmoid(2 - |x_0 - x_1|): not linear."""
    onnx = pytest.importorskip("onnx", reason=WHY)
    pytest.importorskip("onnxruntime", reason=WHY)
    helper, real = onnx.helper, onnx.TensorProto.DOUBLE
    weights = {"w": np.array([[1.0], [-1.0]]), "two": np.array([2.0])}
    nodes = [
        helper.make_node("MatMul", ["x", "w"], ["z"]),
        helper.make_node("Abs", ["z"], ["a"]),
        helper.make_node("Sub", ["two", "a"], ["odds"]),
        helper.make_node("Sigmoid", ["odds"], ["p"]),
    ]
    graph = helper.make_graph(
        nodes,
        "test",
        [helper.make_tensor_value_info("x", real, ["n", 2])],
        [helper.make_tensor_value_info(output, real, ["n", 1])],
        [onnx.numpy_helper.from_array(array, name) for name, array in weights.items()],
    )
    opset = [helper.make_opsetid("", 17)]
    return helper.make_model(graph, opset_imports=opset, ir_version=9).SerializeToString()


def expected(rows):
    return 1 / (1 + np.exp(np.abs(rows[:, 0] - rows[:, 1]) - 2))


def hand_model(rule, threshold=0.4):
    stable = Head(name="stable", link="logit", features=FEATURES, rule=rule, threshold=threshold)
    finger = FingerModel(heads=(stable,), contact_noise=5.0)
    return Model(fingers={ANY_FINGER: finger}, debounce=Debounce(hold=0.05))


@pytest.fixture(scope="module")
def fitted():
    return Onnx.of(content(), 2)


def test_the_probability(fitted):
    rows = np.random.default_rng(0).normal(size=(50, 2))
    assert fitted.probability(rows) == pytest.approx(expected(rows))
    rows[3, 1] = np.nan
    assert np.isnan(fitted.probability(rows)).nonzero()[0].tolist() == [3]
    assert fitted.probability(np.empty((0, 2))).shape == (0,)
    with pytest.raises(ValueError) as raised:
        fitted.probability(rows[:, :1])
    assert str(raised.value) == "features of shape (n, 2) expected, (50, 1) given"


def test_a_saved_and_loaded_model_is_the_same(fitted, tmp_path):
    model = hand_model(fitted)
    model.save(tmp_path / "m.json")
    assert sorted(path.name for path in tmp_path.iterdir()) == [fitted.file, "m.json"]
    assert (tmp_path / fitted.file).read_bytes() == fitted.content
    found = Model.load(tmp_path / "m.json")
    assert (found, found.digest) == (model, model.digest)
    (head,) = json.loads((tmp_path / "m.json").read_text())["fingers"]["*"]["heads"]
    assert head["threshold"] == 0.4
    assert head["rule"] == {
        "type": "onnx", "file": fitted.file, "sha256": fitted.sha256, "n_features": 2
    }  # fmt: skip
    model.save(tmp_path / "other.json")  # the same ONNX file serves both


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


LINEAR = Linear((0.0, 0.0), (1.0, 1.0), ((1.0, 1.0),), (0.0,))


def test_a_model_that_is_replaced_leaves_no_onnx_file(tmp_path):
    path, again = tmp_path / "m.json", Onnx.of(b"another", 2)
    hand_model(UNREAD).save(path)
    with pytest.raises(OutputError):
        hand_model(LINEAR).save(path)
    assert names_in(tmp_path) == sorted([UNREAD.file, "m.json"])
    hand_model(again).save(path, force=True)
    assert names_in(tmp_path) == sorted([again.file, "m.json"])
    hand_model(again).save(path, force=True)
    assert names_in(tmp_path) == sorted([again.file, "m.json"])
    hand_model(LINEAR).save(path, force=True)
    assert names_in(tmp_path) == ["m.json"]


@pytest.mark.parametrize("name", ["other.json", "other.model"])
def test_the_onnx_file_of_another_model_stays(tmp_path, name):
    path = tmp_path / "m.model"
    hand_model(UNREAD).save(path)
    hand_model(UNREAD).save(tmp_path / name)
    hand_model(LINEAR).save(path, force=True)
    assert names_in(tmp_path) == sorted([UNREAD.file, "m.model", name])


def test_only_files_that_are_named_by_a_digest_are_deleted(tmp_path):
    own = tmp_path / "own.onnx"
    own.write_bytes(b"made by hand")
    (tmp_path / "m.json").write_text('{"file": "own.onnx"}')
    hand_model(LINEAR).save(tmp_path / "m.json", force=True)
    assert own.exists()


def test_an_update_gives_what_the_whole_recording_gives(fitted):
    recording = synthetic_recording("made", seed=0)
    tried = detect(hand_model(fitted), recording).fingers.values()
    known = np.concatenate([trace.stable_probability for trace in tried])
    threshold = float(np.quantile(known[known > 0], 0.3))
    model = hand_model(fitted, threshold)
    found = detect(model, recording)
    expected_p = model.predict_proba(recording)
    detector = Detector.for_recording(model, recording)
    for name, trace in found.fingers.items():
        in_contact = (trace.state != UNKNOWN) & (trace.stable_probability > 0)
        assert in_contact.sum() > 100
        assert 0 < (trace.state == STABLE).sum() < len(trace.state)
        np.testing.assert_allclose(
            trace.stable_probability[in_contact], expected_p[name][in_contact], rtol=1e-12
        )
    places = dict.fromkeys(found.fingers, 0)
    for time in found.times:
        samples = {}
        for name, module in recording.modules.items():
            if places[name] < module.n_samples and module.times[places[name]] == time:
                samples[name] = module.readings[places[name]]
        estimate = detector.update(samples, time)
        for name in samples:
            row, finger = places[name], estimate.fingers[name]
            np.testing.assert_equal(
                (finger.stable_probability, finger.instability),
                (found.fingers[name].stable_probability[row],
                 found.fingers[name].instability[row]),
            )  # fmt: skip
            places[name] += 1
    detector.reset()
    assert detector.update({n: m.readings[0] for n, m in recording.modules.items()}, 0.0)


def test_it_is_evaluated(fitted):
    assert evaluate(hand_model(fitted), [synthetic_recording("made", seed=0)]).pooled.accuracy


@pytest.mark.parametrize(
    "name", ["../a.onnx", "/a.onnx", "a/b.onnx", "a.json", ".onnx", "a:b.onnx", ""]
)
def test_a_name_with_folders_is_refused(name):
    with pytest.raises(ModelError) as raised:
        Onnx(name, "0" * 64, 2)
    assert str(raised.value) == f"the name of an .onnx file without folders expected, {name!r}"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"n_features": 0}, "at least one feature expected, 0 given"),
        ({"content": b"other"}, "{} is not the file of the model: its sha256 differs"),
        ({"content": bytes(MAX_ONNX_SIZE + 1)}, "{} has more than 16777216 bytes"),
    ],
)
def test_refusals(changes, message):
    with pytest.raises(ModelError) as raised:
        msgspec.structs.replace(UNREAD, **changes)
    assert str(raised.value) == message.format(UNREAD.file)


def test_data_in_another_file_is_refused():
    with pytest.raises(ModelError) as raised:
        Onnx.of(b"x\x0a\x08location\x12\x0b/etc/passwd", 2)
    assert str(raised.value).endswith("keeps data in other files; a single file expected")


def test_a_file_that_is_no_onnx_is_one_line():
    pytest.importorskip("onnxruntime", reason=WHY)
    with pytest.raises(ModelError) as raised:
        UNREAD.probability(np.zeros((1, 2)))
    assert str(raised.value).startswith("the ONNX file of the model is invalid: ")
    assert "\n" not in str(raised.value)


def test_an_output_that_is_no_probability_is_refused():
    unbounded = Onnx.of(content(output="odds"), 2)
    with pytest.raises(ModelError) as raised:
        unbounded.probability(np.zeros((1, 2)))
    assert str(raised.value) == f"{unbounded.file}: probabilities from 0 to 1 expected"


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda file: file.unlink(), "cannot read {} beside it: No such file or directory"),
        (lambda file: file.write_bytes(b""), "{} beside it is empty"),
        (
            lambda file: file.write_bytes(b"else"),
            "{} is not the file of the model: its sha256 differs",
        ),
        (
            lambda file: file.write_bytes(bytes(MAX_ONNX_SIZE + 1)),
            "cannot read {} beside it: it has more than 16777216 bytes",
        ),
    ],
)
def test_a_file_that_is_missing_or_another_is_refused(damage, message, tmp_path):
    path = tmp_path / "m.json"
    hand_model(UNREAD).save(path)
    damage(tmp_path / UNREAD.file)
    with pytest.raises(ModelError) as raised:
        Model.load(path)
    text = message.format(UNREAD.file)
    assert str(raised.value) == f"{path} is not a model of holdfast.model/2: {text}"


def test_a_content_in_the_model_file_is_refused(tmp_path):
    path = tmp_path / "m.json"
    path.write_bytes(msgspec.json.encode(hand_model(UNREAD)))
    with pytest.raises(ModelError) as raised:
        Model.load(path)
    assert str(raised.value).endswith(
        "a model file names its ONNX file; it does not hold the content"
    )


def test_it_is_saved_whole_or_not_at_all(tmp_path):
    (tmp_path / UNREAD.file).write_bytes(b"of somebody else")
    with pytest.raises(OutputError):
        hand_model(UNREAD).save(tmp_path / "m.json")
    assert [path.name for path in tmp_path.iterdir()] == [UNREAD.file]
    assert (tmp_path / UNREAD.file).read_bytes() == b"of somebody else"
    hand_model(UNREAD).save(tmp_path / "m.json", force=True)
    assert Model.load(tmp_path / "m.json") == hand_model(UNREAD)


def test_a_second_file_that_fails_takes_the_first_with_it(tmp_path):
    second = Onnx.of(b"second", 2)
    models = {"a": hand_model(UNREAD), "b": hand_model(second)}
    fingers = {name: model.fingers[ANY_FINGER] for name, model in models.items()}
    (tmp_path / second.file).write_bytes(b"of somebody else")
    with pytest.raises(OutputError):
        Model(fingers=fingers).save(tmp_path / "m.json")
    assert [path.name for path in tmp_path.iterdir()] == [second.file]


def test_without_the_extra_a_line_names_it():
    program = (
        "import sys; sys.modules['onnxruntime'] = None\n"
        "from holdfast.classifiers import Onnx\n"
        "try: Onnx.of(b'x', 1).probability([[1.0]])\n"
        "except Exception as cause: print(type(cause).__name__, cause)"
    )
    command = [sys.executable, "-c", program]
    shown = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout
    assert shown.startswith(f"{MissingExtra.__name__} this needs the package onnxruntime")
    assert "onnx]" in shown or "extra onnx" in shown
