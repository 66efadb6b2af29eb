import json
import re

import pytest

from command_line import Verb
from holdfast.features import parse_features
from holdfast.io import save_recording
from holdfast.model import Model
from holdfast.synthetic import synthetic_recording
from holdfast.training import Setting, train
from training.build import sliding_recording, tiny_recording

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


run = Verb().run


def tune(capsys, folder, out, *words):
    return run(capsys, "tune", folder / "model.json", folder / "data", "-o", out, *words)


def test_a_model_is_written_with_a_table(capsys, folder, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    out = tmp_path / "tuned.json"
    code, printed, err = tune(capsys, folder, out, "--false-alarms", 30)
    assert (code, err) == (0, "")
    model = Model.load(out)
    stable = model.finger("thumb").stable
    assert stable.choice.false_alarms_per_minute <= 30
    lines = printed.splitlines()
    assert "false alarms a minute" in " ".join(lines[:3])
    assert sum(line.rstrip().endswith("chosen") for line in lines) == 1
    assert lines[-1].startswith(f"{out}: STABLE from a probability of {stable.threshold:.3g}")
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
    for finger in document["fingers"].values():
        stable = finger["heads"]["stable"]
        assert stable["threshold"] == report["threshold"]
        assert stable["choice"]["recordings"] == ["grasp-0", "grasp-1"]
    assert document["training"]["recordings"] == ["grasp-2", "grasp-3"]
    assert set(document["fingers"]) == set(FINGERS)


def test_the_verdict_is_in_sample(capsys, folder, tmp_path):
    """It stands in the sentence of `tune`, and in that of `evaluate` on the same recordings."""
    out = tmp_path / "tuned.json"
    _, printed, _ = tune(capsys, folder, out, "--false-alarms", 30, "--json")
    found = json.loads(printed)["verdict"]
    assert " (in sample): " in found
    _, printed, _ = run(capsys, "evaluate", out, folder / "data", "--json")
    assert json.loads(printed)["verdict"] == found


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
    assert "sensor any; contact from " in printed
    assert " stable: linear, 31 features; STABLE from " in printed
    assert "tuned on    nothing" in printed
    assert all(len(line) <= 80 for line in printed.splitlines())
    code, printed, _ = run(capsys, "info", "builtin:noise-floor")
    assert "the noise of the tare" in " ".join(printed.split())
    assert "trained on  nothing" in printed


def test_info_of_a_model_has_no_plot(capsys, tmp_path):
    code, _, err = run(capsys, "info", "builtin:any", "--plot", tmp_path / "a.png")
    assert code == 2
    assert err == "holdfast: --plot draws one recording; the model builtin:any given\n"


# --- slips ------------------------------------------------------------------------------------

SLIP_SETTING = Setting(window=6, features=parse_features("F_a,F_x,F_y,F_z,sigma", 6), trials=0)


@pytest.fixture(scope="module")
def sliding(tmp_path_factory):
    """Recordings of fingers that slide, and a model of other ones with a slip rule."""
    place = tmp_path_factory.mktemp("slips")
    (place / "data").mkdir()
    for seed in range(20, 24):
        made = sliding_recording(seed)
        save_recording(made, place / "data" / f"{made.name}.parquet")
    others = [sliding_recording(seed) for seed in range(6)]
    train(others, SLIP_SETTING).model.save(place / "model.json")
    return place


def test_the_threshold_of_slips(capsys, sliding, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    out = tmp_path / "tuned.json"
    code, printed, err = tune(capsys, sliding, out, "--false-alarms", 5, "--for", "slip")
    assert (code, err) == (0, "")
    rules = [part.slip for part in Model.load(out).fingers.values()]
    assert all(rule.choice.false_alarms_per_minute <= 5 for rule in rules)
    lines = printed.splitlines()
    assert " Slips: " in " ".join(printed.split())
    assert sum(line.endswith("chosen") for line in lines) == 1
    assert lines[-1].startswith(f"{out}: a slip from a probability of ")
    assert all(len(line) <= 80 for line in lines[:-1])


def test_json_and_info_of_slips(capsys, sliding, tmp_path):
    out = tmp_path / "tuned.json"
    words = ["--false-alarms", 5, "--for", "slip", "--json"]
    code, printed, _ = tune(capsys, sliding, out, *words)
    report = json.loads(printed)
    assert code == 0
    assert list(report) == [
        "model",
        "verdict",
        "for",
        "threshold",
        "chosen",
        "before",
        "around",
        "trained_on",
    ]
    assert report["for"] == "slip"
    assert report["chosen"]["false_alarms_per_minute"]["held"] <= 5
    chosen = next(p for p in report["around"] if p["threshold"] == report["threshold"])
    assert chosen == {"threshold": report["threshold"], **report["chosen"]}
    rule = json.loads(run(capsys, "info", out, "--json")[1])["fingers"]["thumb"]["heads"]["slip"]
    assert rule["threshold"] == report["threshold"]
    assert rule["choice"]["recordings"] == [f"slips-{seed}" for seed in range(20, 24)]
    text = " ".join(run(capsys, "info", out)[1].split())
    assert f"slides from a probability of {rule['threshold']:.3g} on" in text
    assert "threshold from 4 recordings (slips-20, " in text
    assert "tuned on 4 recordings (slips-20, slips-21, slips-22, ...) for slip, see above" in text
    text = " ".join(run(capsys, "info", sliding / "model.json")[1].split())
    assert "threshold from the training, out of fold: " in text
    assert text.endswith("tuned on nothing")
    assert "no slip rule" in run(capsys, "info", "builtin:noise-floor")[1]


def test_info_of_a_model_that_is_tuned_for_both(capsys, sliding, tmp_path):
    first, second = tmp_path / "slip.json", tmp_path / "both.json"
    tune(capsys, sliding, first, "--false-alarms", 5, "--for", "slip")
    run(capsys, "tune", first, sliding / "data", "-o", second, "--false-alarms", 1000)
    lines = run(capsys, "info", second)[1].splitlines()
    place = next(k for k, line in enumerate(lines) if line.startswith("tuned on "))
    text = " ".join(" ".join(lines[place:]).split())
    assert text.startswith("tuned on 4 recordings (slips-20, ")
    assert ") for stable, see above 4 recordings (slips-20, " in text
    assert text.endswith(") for slip, see above")
    above = " ".join(" ".join(lines[:place]).split())
    for head, wanted in (("stable", "1000 wanted"), ("slip", "5 wanted")):
        assert re.search(
            rf" {head}: [^:]* threshold from 4 recordings \(slips-20, [^:]*: \S+ false alarms a "
            rf"minute \(at most {wanted}\)",
            above,
        )


def refused(capsys, model, data, out, rate="1"):
    code, printed, err = run(
        capsys, "tune", model, data, "-o", out, "--false-alarms", rate, "--for", "slip"
    )
    assert (code, printed, err.count("\n")) == (2, "", 1)
    assert not out.exists()
    return err


def test_refusals_of_slips(capsys, sliding, folder, tmp_path):
    out, model, data = tmp_path / "t.json", sliding / "model.json", sliding / "data"
    assert "false alarms per minute above 0 expected, 0 given" in refused(
        capsys, model, data, out, "0"
    )
    assert "has no slip rule" in refused(capsys, "builtin:noise-floor", data, out)
    assert "of held time given; 0.01 false alarms a minute need at least 1e+02 min" in refused(
        capsys, model, data, out, "0.01"
    )
    bare = tiny_recording(1, states=(None,) * 4)
    save_recording(bare, tmp_path / "bare.parquet")
    assert "1 recordings without slips that are known" in refused(
        capsys, model, tmp_path / "bare.parquet", out
    )


def test_evaluate_prints_slips(capsys, sliding, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, printed, _ = run(capsys, "evaluate", sliding / "model.json", sliding / "data")
    assert code == 0
    lines = printed.splitlines()
    place = lines.index("slips of fingers (by the truth)")
    rows = {line.split()[0]: line.split() for line in lines[place:] if line.strip()}
    assert rows["all"][1] == "32"
    assert rows["thumb"][1] == rows["index"][1] == "16"
    assert rows["never"][1:] == ["32", rows["all"][2], *["0"] * 6, "0.00", "0.00", "0.500"]
    assert "without a choice of the threshold" in " ".join(printed.split())
    assert "Slips: " in " ".join(lines[:6])
    assert all(len(line) <= 80 for line in lines[:-1])


def test_train_and_evaluate_without_a_slip_rule(capsys, folder):
    _, printed, _ = run(capsys, "evaluate", folder / "model.json", folder / "data")
    assert "slips of fingers: the model has no slip rule\n" in printed


def test_train_prints_slips(capsys, sliding, tmp_path):
    words = ["-o", tmp_path / "m.json", "--trials", "0", "--shared"]
    _, printed, _ = run(capsys, "train", sliding / "data", *words)
    assert "slips of fingers (by the truth)" in printed
    assert "95 % intervals of all slips, with the choice of the threshold: " in " ".join(
        printed.split()
    )
