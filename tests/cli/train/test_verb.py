import json
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from command_line import Verb
from holdfast.classifiers import RECIPES
from holdfast.cli import main
from holdfast.io import labels_path, load_dataset, load_recording, save_labels, save_recording
from holdfast.model import Debounce, Model
from holdfast.synthetic import synthetic_recording
from holdfast.training import Setting, train

pytestmark = pytest.mark.slow

FINGERS = ("thumb", "index")
TWIN = "builtin:twin"


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for k in range(3):
        recording = synthetic_recording(f"grasp-{k}", k, FINGERS)
        save_recording(recording, folder / f"grasp-{k}.parquet")
    return folder


@pytest.fixture
def model(tmp_path):
    return tmp_path / "model.json"


VERB = Verb("train")
run, refusal = VERB.run, VERB.refusal


def test_json_has_the_fields_of_the_contract(capsys, data, model):
    code, out, err = run(capsys, data, "-o", model, "--trials", 0, "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert report["model"] == str(model)
    assert report["split"] == "recording"
    assert [r["name"] for r in report["cross_validation"]["recordings"]] == [
        "grasp-0", "grasp-1", "grasp-2"
    ]  # fmt: skip
    assert list(model.parent.iterdir()) == [model]


def test_it_is_the_library_that_trains(capsys, data, model):
    words = ["--window", 8, "--features", "F_a,sigma", "--classifier", "svm", "--tare", "0.4",
             "--split", "object", "--trials", 2, "--seed", 3, "--shared",
             "--contact-threshold", 9.5, "--max-samples", 900, "--jobs", 1]  # fmt: skip
    assert run(capsys, data, "-o", model, *words)[0] == 0
    from holdfast.features import Tare, parse_features

    setting = Setting(
        classifier="svm",
        features=parse_features("F_a,sigma", 8),
        window=8,
        tare=Tare.parse("0.4"),
        split="object",
        trials=2,
        seed=3,
        shared=True,
        contact_threshold=9.5,
        max_samples=900,
        hold=0.1,
        hysteresis=0.1,
    )
    assert Model.load(model) == train(load_dataset(data), setting).model


def test_the_table(capsys, data, model):
    code, out, _ = run(capsys, data, "-o", model, "--trials", 0)
    assert code == 0
    assert "accuracy %" in out
    assert re.search(r"0\.2 s % .* alarms/min$", out, re.MULTILINE)
    *tables, last = out.splitlines()
    assert max(map(len, tables)) <= 80
    assert (
        f"{model}: trained on 3 recordings; cross-validation leaves out one recording at a time"
        == last
    )


def test_a_model_is_not_overwritten(capsys, data, model):
    model.write_text("mine")
    assert refusal(capsys, data, "-o", model, "--trials", 0) == (
        f"{model} exists already: choose another name, or give --force"
    )
    assert model.read_text() == "mine"
    assert run(capsys, data, "-o", model, "--trials", 0, "--force")[0] == 0
    assert Model.load(model).training.recordings.keys() == {"grasp-0", "grasp-1", "grasp-2"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--classifier", "magic"], "unknown classifier 'magic'; there are logreg, svm"),
        (["--hold", "-1"], "a hold of at least 0 s expected, -1.0 given"),
        (["--init", "builtin:twin", "--hold", "nan"], "a hold of at least 0 s expected, nan given"),
        (
            ["--init", "builtin:twin", "--features", "F_a"],
            "--init uses the classifier, window and features of its model; leave out --features",
        ),
        (
            ["--init", "builtin:twin", "--window", "14", "--classifier", "logreg"],
            "--init uses the classifier, window and features of its model; leave out "
            "--classifier and --window",
        ),
    ],
)
def test_wrong_options(capsys, data, model, words, message):
    assert refusal(capsys, data, "-o", model, *words) == message
    assert not list(model.parent.iterdir())


def test_data_that_cannot_train_leave_everything_as_it_was(capsys, tmp_path, model):
    model.write_text("mine")
    folder = tmp_path / "data"
    assert refusal(capsys, folder, "-o", model, "--force") == (
        f"there is no folder {folder}; a folder of recordings expected"
    )
    folder.mkdir()
    assert "no recording in" in refusal(capsys, folder, "-o", model, "--force")
    bare = synthetic_recording("bare", 0, ("thumb",)).with_labels({})
    for name in ("one", "two"):
        save_recording(bare, folder / f"{name}.parquet")
    assert refusal(capsys, folder, "-o", model, "--force") == (
        "none of the 2 recordings has labels to train from"
    )
    assert model.read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data", "model.json"]


def test_the_search_journal_is_removed_when_the_model_is_written(capsys, data, model):
    assert run(capsys, data, "-o", model, "--trials", 2)[0] == 0
    assert list(model.parent.iterdir()) == [model]


def test_a_search_left_over_is_refused_without_resume(capsys, data, model):
    journal = model.with_name("model.json.search")
    journal.write_text("")
    assert refusal(capsys, data, "-o", model) == (
        f"{journal} holds a search that was stopped: continue it with --resume, "
        "or start again with --force"
    )
    assert run(capsys, data, "-o", model, "--trials", 0, "--force")[0] == 0
    assert not journal.exists()


def test_nothing_to_resume(capsys, data, model):
    assert refusal(capsys, data, "-o", model, "--resume") == (
        f"nothing to resume: {model}.search does not exist"
    )


def test_a_killed_search_goes_on_to_the_same_end(capsys, data, model, tmp_path):
    whole = tmp_path / "whole.json"
    words = ["--trials", "4", "--json"]
    expected = json.loads(run(capsys, data, "-o", whole, *words)[1])
    program = "import sys; from holdfast.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "train", str(data), "-o", str(model), *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    journal = model.with_name("model.json.search")
    while process.poll() is None and not (journal.exists() and journal.stat().st_size > 300):
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert not model.exists()
    n_lines = len(journal.read_bytes().split(b"\n\n"))
    code, out, _ = run(capsys, data, "-o", model, "--resume", *words)
    assert code == 0
    assert json.loads(out)["cross_validation"] == expected["cross_validation"]
    assert Model.load(model) == Model.load(whole)
    assert n_lines < 4 * 8
    assert not journal.exists()


def test_an_interrupt_names_resume(capsys, data, model, monkeypatch):
    from holdfast.training import tuning

    add, n_trials = tuning.Journal.add, []

    def stops(*given):
        n_trials.append(1)
        if len(n_trials) == 3:
            raise KeyboardInterrupt
        add(*given)

    monkeypatch.setattr(tuning.Journal, "add", stops)
    code, out, err = run(capsys, data, "-o", model, "--trials", 4)
    assert (code, out) == (130, "")
    assert err == (
        f"the trials so far are in {model}.search: continue with --resume\nholdfast: interrupted\n"
    )


def test_a_model_is_adapted(capsys, data, model):
    code, out, err = run(capsys, data, "-o", model, "--trials", 0, "--init", TWIN, "--json")
    assert (code, err) == (0, "")
    assert tuple(json.loads(out)["cross_validation"]["fingers"]) == FINGERS
    adapted, twin = Model.load(model), Model.load(TWIN)
    assert tuple(adapted.fingers) == FINGERS
    assert adapted.fingers["thumb"].features == twin.fingers["*"].features
    assert (adapted.debounce, adapted.window, adapted.tare) == (twin.debounce, 14, "0.5")
    assert adapted.name == ""
    setting = Setting.adapting(twin, trials=0)
    assert adapted.fingers == train(load_dataset(data), setting).model.fingers


def test_tare_and_hold_override_the_model_to_adapt(capsys, data, model):
    words = ["--init", TWIN, "--trials", 0, "--tare", 0.3, "--hold", 0.25, "--hysteresis", 0.2]
    words += ["--shared"]
    assert run(capsys, data, "-o", model, *words)[0] == 0
    adapted = Model.load(model)
    assert list(adapted.fingers) == ["*"]
    assert (adapted.tare, adapted.debounce) == ("0.3", Debounce(0.0, 0.2, 0.25))


def test_hold_and_our_own_features(capsys, data, model):
    words = ["--features", "holdfast", "--hold", 0.2, "--trials", 0]
    assert run(capsys, data, "-o", model, *words)[0] == 0
    made = Model.load(model)
    assert made.debounce == Debounce(0.0, 0.1, 0.2)  # the hysteresis by default
    assert made.fingers["thumb"].features == Model.load(TWIN).fingers["*"].stable.features


def test_own_slip_features(capsys, data, model):
    code, _, err = run(capsys, data, "-o", model, "--trials", 0, "--own-slip-features")
    assert code == 0
    assert "no slips are known in the recordings: the model gets no slip rule" in err
    assert Model.load(model).fingers["index"].slip is None
    before = model.read_bytes()
    words = ["--init", TWIN, "--own-slip-features", "--force"]
    code, _, err = run(capsys, data, "-o", model, *words)
    assert (code, model.read_bytes()) == (2, before)
    assert err == (
        "holdfast: own slip features given with a model to adapt, which keeps its slip rule; leave "
        "one of them out\n"
    )


def test_a_missing_model_to_adapt(capsys, data, model, tmp_path):
    missing = tmp_path / "none.json"
    assert refusal(capsys, data, "-o", model, "--init", missing) == (
        f"cannot read the model {missing}: No such file or directory"
    )
    missing.write_text("{}")
    assert f"{missing} is not a model of" in refusal(capsys, data, "-o", model, "--init", missing)
    assert list(tmp_path.iterdir()) == [missing]


def test_warnings_about_the_model_to_adapt(capsys, data, model, tmp_path):
    """Adapt a model to its own training recordings, and to another sensor."""
    first = tmp_path / "first.json"
    assert run(capsys, data, "-o", first, "--trials", 0)[0] == 0
    code, _, err = run(capsys, data, "-o", model, "--trials", 0, "--init", first)
    assert (code, err) == (
        0,
        f"{first} was trained on 3 of these 3 recordings (grasp-0, grasp-1, grasp-2): "
        "the metrics on them are too good\n",
    )
    others = tmp_path / "others"
    others.mkdir()
    for path in data.iterdir():
        save_recording(with_flat_skin(load_recording(path)), others / path.name)
    words = ["--trials", 0, "--init", TWIN, "--force"]
    code, _, err = run(capsys, others, "-o", model, *words)
    assert (code, err) == (
        0,
        "thumb, index: the sensor is flat (count), builtin:twin was trained on uskin-curved "
        "(count); its features are used unchanged, its weights may not fit\n",
    )


def with_flat_skin(recording):
    modules = {
        name: replace(module, sensor=replace(module.sensor, name="flat"))
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules)


def test_labels_of_a_rule_that_hide_others_are_reported(capsys, data, model):
    path = data / "grasp-0.parquet"
    save_labels(load_recording(path), path, author="rule:signal")
    try:
        code, _, err = run(capsys, data, "-o", model, "--trials", 0)
    finally:
        labels_path(path).unlink()
    assert code == 0
    assert err.startswith("labels of a rule outrank the labels that came with 1 of 3 recordings")


def test_the_classifiers_are_listed(capsys):
    assert main(["train", "--classifier", "list"]) == 0
    out, err = capsys.readouterr()
    assert (out.split(), err) == (list(RECIPES), "")
