import json

import pytest

from command_line import Verb
from holdfast.io import save_recording
from holdfast.model import Model
from training.build import sliding_recording

pytestmark = pytest.mark.slow

run = Verb().run


@pytest.fixture(scope="module")
def grasps(tmp_path_factory):
    """Six recordings of two fingers, each of which slides four times."""
    folder = tmp_path_factory.mktemp("grasps")
    for seed in range(6):
        recording = sliding_recording(seed)
        save_recording(recording, folder / f"{recording.name}.parquet")
    return folder


def test_a_model_is_written_with_what_it_finds(capsys, grasps, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    out = tmp_path / "mine.json"
    code, printed, err = run(capsys, "teach", "--from", grasps, "-o", out, "--false-alarms", 3)
    assert (code, err) == (0, "")
    lines = printed.splitlines()
    assert lines[0].startswith("48 slips in 6 grasps: of those that it was not taught, ")
    assert [line.split()[0] for line in lines if "0.00" in line][-1] == "never"
    assert any(line.startswith("builtin:any ") for line in lines)
    assert lines[-1] == f"{out}: taught by 6 recordings"
    assert all(len(line) <= 80 for line in lines[:-1])
    assert Model.load(out).finger("thumb").slip.choice.n == 48


def test_json(capsys, grasps, tmp_path):
    out = tmp_path / "mine.json"
    code, printed, _ = run(
        capsys, "teach", "--from", grasps, "-o", out, "--false-alarms", 3, "--json"
    )
    report = json.loads(printed)
    assert code == 0
    assert set(report) == {
        "model", "steps", "heads", "base", "hand_false_alarms_per_minute", "warnings", "verdict"
    }  # fmt: skip
    slip = report["heads"]["slip"]
    assert (slip["n"], slip["grasps"], slip["out_of_fold"]["n"]) == (48, 6, 48)
    assert slip["out_of_fold"]["onsets"] == report["base"]["onsets"] == "labels"


def test_train_for_slip_writes_the_same_model(capsys, grasps, tmp_path):
    taught, trained = tmp_path / "taught.json", tmp_path / "trained.json"
    assert run(capsys, "teach", "--from", grasps, "-o", taught)[0] == 0
    assert run(capsys, "train", grasps, "-o", trained, "--for", "slip")[0] == 0
    assert trained.read_bytes() == taught.read_bytes()


BAD = {
    "no slips": (
        ["teach", "--from", "grasps/slips-0.parquet", "-o", "new.json"],
        "holdfast: 8 slips in 1 of 1 recordings given; at least 3 in 2 expected (holdfast label, "
        "or holdfast label auto tracking with a video)",
    ),
    "a rate": (
        ["teach", "--from", "grasps", "-o", "new.json", "--false-alarms", "0"],
        "holdfast: false alarms per minute above 0 expected, 0 given",
    ),
    "no recordings": (
        ["teach", "--from", "nowhere", "-o", "new.json"],
        "holdfast: there is no folder nowhere; a folder of recordings expected",
    ),
    "a search": (
        ["train", "grasps", "-o", "new.json", "--for", "slip", "--trials", "3"],
        "holdfast: --for slip has no search and its own features: leave the others out",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(capsys, grasps, tmp_path, monkeypatch, case):
    (tmp_path / "grasps").symlink_to(grasps)
    monkeypatch.chdir(tmp_path)
    words, message = BAD[case]
    code, printed, err = run(capsys, *words)
    assert (code, printed) == (2, "")
    assert err.strip() == message
    assert not (tmp_path / "new.json").exists()


def test_a_model_is_never_overwritten(capsys, grasps, tmp_path):
    out = tmp_path / "mine.json"
    out.write_text("mine")
    code, _, err = run(capsys, "teach", "--from", grasps, "-o", out)
    assert (code, out.read_text()) == (2, "mine")
    assert err.startswith(f"holdfast: {out} ")
