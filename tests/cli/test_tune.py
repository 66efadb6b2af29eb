import json

import pytest

from command_line import Verb
from holdfast.detection import Model, parse_features
from holdfast.io import save_recording
from holdfast.training import Setting, train
from training.build import sliding_recording

pytestmark = pytest.mark.slow


run = Verb().run


def tune(capsys, folder, out, *words, data="data"):
    return run(capsys, "tune", folder / "model.json", folder / data, "-o", out, *words)


def check_table(printed):
    """A table that fits has the chosen threshold in one row, and a last line without a limit."""
    *lines, last = printed.splitlines()
    assert sum(line.rstrip().endswith("chosen") for line in lines) == 1
    assert all(len(line) <= 80 for line in lines)
    return last


def test_json_the_table_and_info(capsys, grasps, tmp_path):
    out = tmp_path / "tuned.json"
    code, printed, err = tune(capsys, grasps, out, "--false-alarms", 30, "--json", data="new")
    report = json.loads(printed)
    assert (code, err) == (0, "")
    assert set(report) == {
        "model", "verdict", "threshold", "chosen", "before", "around", "trained_on"
    }  # fmt: skip
    assert report["chosen"]["events"]["false_alarms_per_minute"] <= 30
    stable = Model.load(out).finger("thumb").stable
    assert stable.threshold == report["threshold"]
    assert stable.choice.false_alarms_per_minute <= 30
    document = json.loads(run(capsys, "info", out, "--json")[1])
    for finger in document["fingers"].values():
        choice = finger["heads"]["stable"]["choice"]
        assert choice["recordings"] == ["grasp-2", "grasp-3"]
    assert document["training"]["recordings"] == ["grasp-0", "grasp-1"]
    _, printed, _ = tune(capsys, grasps, out, "--false-alarms", 30, "--force", data="new")
    assert check_table(printed).startswith(f"{out}: STABLE from ")
    # The verdict is in sample, also in that of `evaluate` on the same recordings.
    assert "in sample): " in report["verdict"]
    _, printed, _ = run(capsys, "evaluate", out, grasps / "new", "--json")
    assert json.loads(printed)["verdict"] == report["verdict"]


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


def test_json_the_table_and_info_of_slips(capsys, sliding, tmp_path):
    out = tmp_path / "tuned.json"
    words = ["--false-alarms", 5, "--for", "slip"]
    code, printed, err = tune(capsys, sliding, out, *words, "--json")
    report = json.loads(printed)
    assert (code, err) == (0, "")
    assert list(report) == [
        "model", "verdict", "for", "threshold", "chosen", "before", "around", "trained_on"
    ]  # fmt: skip
    assert report["for"] == "slip"
    assert report["chosen"]["false_alarms_per_minute"]["held"] <= 5
    chosen = next(p for p in report["around"] if p["threshold"] == report["threshold"])
    assert chosen == {"threshold": report["threshold"], **report["chosen"]}
    _, printed, _ = tune(capsys, sliding, out, *words, "--force")
    assert check_table(printed).startswith(f"{out}: a slip from ")
    rule = json.loads(run(capsys, "info", out, "--json")[1])["fingers"]["thumb"]["heads"]["slip"]
    assert rule["threshold"] == report["threshold"]
    assert rule["choice"]["recordings"] == [f"slips-{seed}" for seed in range(20, 24)]
    text = " ".join(run(capsys, "info", out)[1].split())
    assert "(slips-20, slips-21, slips-22, ...) for slip" in text
    assert "out of fold" in run(capsys, "info", sliding / "model.json")[1]


def test_evaluate_and_train_print_slips(capsys, sliding, grasps, tmp_path):
    _, printed, _ = run(capsys, "evaluate", sliding / "model.json", sliding / "data")
    lines = printed.splitlines()
    place = next(k for k, line in enumerate(lines) if line.startswith("slips of fingers"))
    rows = {line.split()[0]: line.split() for line in lines[place:] if line.strip()}
    assert rows["all"][1] == "32"
    assert rows["thumb"][1] == rows["index"][1] == "16"
    assert rows["never"][1:] == ["32", rows["all"][2], *["0"] * 4, "0.00", "0.00", "0.500"]
    assert all(len(line) <= 80 for line in lines[:-1])
    words = ["-o", tmp_path / "m.json", "--trials", "0", "--shared"]
    assert "slips of fingers (by the truth)" in run(capsys, "train", sliding / "data", *words)[1]
    _, printed, _ = run(capsys, "evaluate", grasps / "model.json", grasps / "new")
    assert "slips of fingers: the model has no slip rule\n" in printed
