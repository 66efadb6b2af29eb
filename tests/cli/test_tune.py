import json

import pytest

from holdfast.cli import main
from holdfast.io import load_dataset, save_recording
from holdfast.model import Model
from holdfast.synthetic import synthetic_recording
from holdfast.training import Setting, train

pytestmark = pytest.mark.slow

FINGERS = ("thumb", "index")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Recordings of two fingers, and a model of other ones."""
    place = tmp_path_factory.mktemp("tune")
    (place / "data").mkdir()
    for k in range(2):
        recording = synthetic_recording(f"grasp-{k}", k, FINGERS)
        save_recording(recording, place / "data" / f"grasp-{k}.parquet")
    others = [synthetic_recording(f"grasp-{k}", k, FINGERS) for k in (2, 3)]
    train(others, Setting(trials=0)).model.save(place / "model.json")
    return place


def run(capsys, *words):
    code = main([*map(str, words)])
    out, err = capsys.readouterr()
    return code, out, err


def tune(capsys, folder, out, *words):
    return run(capsys, "tune", folder / "model.json", folder / "data", "-o", out, *words)


def test_a_model_is_written_with_a_table(capsys, folder, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    out = tmp_path / "tuned.json"
    code, printed, err = tune(capsys, folder, out, "--false-alarms", 30)
    assert (code, err) == (0, "")
    model = Model.load(out)
    assert model.tuning.false_alarms_per_minute <= 30
    lines = printed.splitlines()
    assert "false alarms a minute" in " ".join(lines[:3])
    assert sum(line.rstrip().endswith("chosen") for line in lines) == 1
    assert lines[-1].startswith(f"{out}: STABLE from a probability of {model.tuning.threshold:.3g}")
    assert all(len(line) <= 80 for line in lines[:-1])


def test_json_and_info(capsys, folder, tmp_path):
    out = tmp_path / "tuned.json"
    code, printed, _ = tune(capsys, folder, out, "--false-alarms", 30, "--json")
    report = json.loads(printed)
    assert code == 0
    assert set(report) == {
        "model", "verdict", "threshold", "chosen", "before", "around", "trained_on"
    }  # fmt: skip
    assert report["chosen"]["events"]["false_alarms_per_minute"] <= 30
    code, printed, _ = run(capsys, "info", out, "--json")
    document = json.loads(printed)
    assert code == 0
    assert document["tuning"]["threshold"] == report["threshold"]
    assert document["tuning"]["recordings"] == ["grasp-0", "grasp-1"]
    assert document["training"]["recordings"] == ["grasp-2", "grasp-3"]
    assert set(document["fingers"]) == set(FINGERS)


def test_no_verdict_on_training_recordings(capsys, folder, tmp_path):
    model, data = tmp_path / "model.json", folder / "data"
    train(load_dataset(data), Setting(trials=0)).model.save(model)
    words = ["tune", model, data, "--false-alarms", 30, "-o"]
    assert json.loads(run(capsys, *words, tmp_path / "a.json", "--json")[1])["verdict"] is None
    _, out, err = run(capsys, *words, tmp_path / "b.json")
    assert out.startswith("No verdict: the model was trained on 2 of these 2 recordings.")
    assert "their metrics are optimistic" in err


def test_what_exists_is_kept(capsys, folder, tmp_path):
    out = tmp_path / "tuned.json"
    out.write_text("mine")
    code, printed, err = tune(capsys, folder, out, "--false-alarms", 30)
    assert (code, printed, err.count("\n")) == (2, "", 1)
    assert "exists" in err
    assert out.read_text() == "mine"


@pytest.mark.parametrize(
    ("rate", "message"),
    [
        (-1, "holdfast: false alarms per minute of at least 0 expected, -1 given\n"),
        ("many", "holdfast: Invalid value for '--false-alarms': "),
    ],
)
def test_a_rate_that_is_none(capsys, folder, tmp_path, rate, message):
    code, printed, err = tune(capsys, folder, tmp_path / "t.json", "--false-alarms", rate)
    assert (code, printed) == (2, "")
    assert err.startswith(message)
    assert not (tmp_path / "t.json").exists()


def test_info_of_built_in_models(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, printed, _ = run(capsys, "info", "builtin:any")
    assert code == 0
    assert "sensor any; linear, " in printed
    assert "tuned on    nothing" in printed
    assert all(len(line) <= 80 for line in printed.splitlines())
    code, printed, _ = run(capsys, "info", "builtin:noise-floor")
    assert "the noise of the tare" in " ".join(printed.split())
    assert "trained on  nothing" in printed


def test_info_of_a_model_has_no_plot(capsys, tmp_path):
    code, _, err = run(capsys, "info", "builtin:any", "--plot", tmp_path / "a.png")
    assert code == 2
    assert err == "holdfast: --plot draws one recording; the model builtin:any given\n"
