import json

import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.detection import Debounce, Model
from holdfast.io import load_dataset, save_recording
from holdfast.synthetic import synthetic_recording
from holdfast.training import Setting, train
from holdfast.training.classifiers import RECIPES

pytestmark = pytest.mark.slow

FINGERS = ("thumb", "index")
TWIN = "builtin:twin"


@pytest.fixture
def data(grasps):
    return grasps / "seen"


@pytest.fixture
def model(tmp_path):
    return tmp_path / "model.json"


run = Verb("train").run


def test_json_has_the_fields_of_the_contract(capsys, data, model):
    code, out, err = run(capsys, data, "-o", model, "--trials", 0, "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert report["model"] == str(model)
    assert report["split"] == "recording"
    assert [r["name"] for r in report["cross_validation"]["recordings"]] == ["grasp-0", "grasp-1"]
    assert list(model.parent.iterdir()) == [model]
    model.write_text("mine")
    _, out, _ = run(capsys, data, "-o", model, "--trials", 0, "--force")
    *tables, last = out.splitlines()
    assert max(map(len, tables)) <= 80
    assert last.startswith(f"{model}: trained on 2 recordings")
    assert Model.load(model).training.recordings.keys() == {"grasp-0", "grasp-1"}


def test_it_is_the_library_that_trains(capsys, data, model):
    words = ["--window", 8, "--features", "F_a,sigma", "--classifier", "svm", "--tare", "0.4",
             "--split", "object", "--seed", 3, "--shared",
             "--contact-threshold", 9.5, "--max-samples", 900, "--jobs", 1]  # fmt: skip
    assert run(capsys, data, "-o", model, *words)[0] == 0
    from holdfast.detection import Tare, parse_features

    setting = Setting(
        classifier="svm",
        features=parse_features("F_a,sigma", 8),
        window=8,
        tare=Tare.parse("0.4"),
        split="object",
        seed=3,
        shared=True,
        contact_threshold=9.5,
        max_samples=900,
        hold=0.1,
        hysteresis=0.1,
    )
    assert Model.load(model) == train(load_dataset(data), setting).model


def test_data_that_cannot_train_leave_everything_as_it_was(capsys, tmp_path, model):
    model.write_text("mine")
    bare = synthetic_recording("bare", 0, ("thumb",)).with_labels({})
    (tmp_path / "data").mkdir()
    save_recording(bare, tmp_path / "data" / "one.parquet")
    assert run(capsys, tmp_path / "data", "-o", model, "--force")[0] == 2
    assert model.read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data", "model.json"]


def test_a_model_is_adapted(capsys, data, model):
    code, out, err = run(capsys, data, "-o", model, "--trials", 0, "--init", TWIN, "--json")
    assert (code, err) == (0, "")
    assert tuple(json.loads(out)["cross_validation"]["fingers"]) == FINGERS
    adapted, twin = Model.load(model), Model.load(TWIN)
    assert tuple(adapted.fingers) == FINGERS
    assert (adapted.debounce, adapted.window, adapted.tare) == (twin.debounce, 14, "0.5")
    setting = Setting.adapting(twin, trials=0)
    assert adapted.fingers == train(load_dataset(data), setting).model.fingers


def test_hold_and_our_own_features(capsys, data, model):
    words = ["--features", "holdfast", "--hold", 0.2, "--trials", 0, "--own-slip-features"]
    code, _, err = run(capsys, data, "-o", model, *words)
    assert (code, err.count("\n")) == (0, 1)  # no slips are known
    made = Model.load(model)
    assert made.debounce == Debounce(0.0, 0.1, 0.2)  # the hysteresis by default
    assert made.fingers["thumb"].features == Model.load(TWIN).fingers["*"].stable.features
    assert made.fingers["index"].slip is None


def test_the_classifiers_are_listed(capsys):
    assert main(["train", "--classifier", "list"]) == 0
    out, err = capsys.readouterr()
    assert (out.split(), err) == (list(RECIPES), "")
