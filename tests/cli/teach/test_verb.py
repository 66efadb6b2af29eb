import json
import os
from contextlib import contextmanager
from functools import partial

import pytest

from command_line import Verb
from holdfast.cli.teach import verb
from holdfast.cli.teach.options import GuideOptions
from holdfast.cli.teach.report import NO_SLIPS
from holdfast.io import save_recording
from holdfast.live.teaching.folder import TeachingFolder
from holdfast.live.teaching.protocol import GraspResult
from holdfast.live.teaching.steps import STEPS
from holdfast.model import Model
from holdfast.synthetic import synthetic_recording
from holdfast.twin import webcam
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
    first = [line.split()[0] for line in lines if line.strip()]
    assert first.index("taught") < first.index("builtin:any") < first.index("never")
    rates = lines.index(next(line for line in lines if line.startswith("--false-alarms")))
    assert [line.split()[0] for line in lines[rates + 1 : rates + 6]] == [
        *("0.5", "1", "1.5", "3", "6")
    ]
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
        "model", "steps", "heads", "base", "hand_false_alarms_per_minute", "curve", "warnings",
        "verdict",
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


GUIDED = {
    "neither": (
        ["teach", "-o", "new.json"],
        "holdfast: a SOURCE, or recordings with --from, expected; neither given",
    ),
    "both": (
        ["teach", "twin:", "--from", "grasps", "-o", "new.json"],
        "holdfast: a SOURCE, or recordings with --from, expected; twin: and --from grasps given",
    ),
    "a folder of --from": (
        ["teach", "--from", "grasps", "-o", "new.json", "--resume"],
        "holdfast: --camera, --to, --resume and --unattended need a SOURCE",
    ),
    "a camera of the twin": (
        ["teach", "twin:", "-o", "new.json", "--camera", "0"],
        "holdfast: twin: has its own camera: leave out --camera",
    ),
    "a device without a person": (
        ["teach", "xela://127.0.0.1:1", "-o", "new.json", "--unattended"],
        "holdfast: --unattended is for twin:; a robot sends the lines next, repeat, skip or quit "
        "on stdin",
    ),
    "a camera": (
        ["teach", "xela://127.0.0.1:1", "-o", "new.json", "--camera", "none.mp4"],
        "holdfast: no camera none.mp4: the number of a camera (0 is the first), or a video file "
        "or stream expected",
    ),
    "a folder of something else": (
        ["teach", "twin:", "-o", "new.json", "--to", "grasps", "--unattended"],
        "holdfast: grasps has no teach.json and is not empty: another folder expected",
    ),
    "a protocol that never began": (
        ["teach", "twin:", "-o", "new.json", "--resume", "--unattended"],
        "holdfast: new-grasps has no teach.json: there is nothing to resume",
    ),
}


@pytest.mark.parametrize("case", GUIDED)
def test_a_wrong_protocol_is_one_line(capsys, grasps, tmp_path, monkeypatch, case):
    (tmp_path / "grasps").symlink_to(grasps)
    monkeypatch.chdir(tmp_path)
    words, message = GUIDED[case]
    code, printed, err = run(capsys, *words)
    assert (code, printed) == (2, "")
    assert err.strip() == message
    assert not (tmp_path / "new.json").exists()


def test_no_hand_at_the_source_is_one_line(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pipe_of(monkeypatch, "next\n"):
        code, _, err = run(capsys, "teach", "xela://127.0.0.1:1", "-o", "new.json")
    assert code == 2
    *lines, last = err.splitlines()
    assert last.startswith("holdfast: no server listens at 127.0.0.1:1; ")
    assert any(line.startswith("Without --camera no slip is measured") for line in lines)
    # Nothing is in the way of the next attempt.
    with pipe_of(monkeypatch, "quit\n"):
        code, _, err = run(capsys, "teach", "xela://127.0.0.1:1", "-o", "new.json")
    assert err.splitlines()[-1] == "holdfast: not confirmed: nothing was recorded"


@contextmanager
def pipe_of(monkeypatch, text):
    """Let stdin be a pipe with these lines, which stays open."""
    reading, writing = os.pipe()
    os.write(writing, text.encode())
    with os.fdopen(reading) as pipe:
        monkeypatch.setattr("sys.stdin", pipe)
        yield
    os.close(writing)


SHORT = {"open": 1.0, "carry": 7.0, "pull": 9.0}


def test_from_nothing_to_a_model_with_the_twin(capsys, tmp_path, monkeypatch):
    """The whole path, with fewer and shorter grasps, and a webcam of half the rate."""
    steps = [
        step._replace(seconds=SHORT[step.name], n_actions=min(step.n_actions, 3), n_grasps=1)
        for step in STEPS
        if step.name in SHORT
    ]
    index = [step.name for step in steps].index("pull")
    steps[index] = steps[index]._replace(n_grasps=2)
    monkeypatch.setattr("holdfast.live.teaching.steps.STEPS", tuple(steps))
    film = partial(webcam.film_stickers, camera=webcam.Webcam(fps=30.0))
    monkeypatch.setattr(webcam, "film_stickers", film)
    monkeypatch.chdir(tmp_path)
    words = ("teach", "twin:?object=can&seed=3", "-o", "mine.json", "--unattended", "--json")
    code, printed, err = run(capsys, *words, "--false-alarms", "60")
    assert code == 0, err
    report = json.loads(printed)
    kept = [(x["name"], x["kept"]) for x in report["steps"] if x["kept"]]
    assert kept == [(x, True) for x in ("open", "carry", "pull", "pull")]
    assert all(x["seconds"] > 2 for x in report["steps"])
    assert report["heads"]["slip"]["out_of_fold"]["onsets"] == "rule"
    assert report["verdict"]
    assert Model.load("mine.json").finger("index").slip.choice.n >= 3
    assert "<svg" in (tmp_path / "mine-grasps" / "pulls.html").read_text()


@pytest.mark.parametrize("is_calibrated", [True, False])
def test_without_a_measured_slip_there_is_a_calibration_or_nothing(
    capsys, tmp_path, monkeypatch, is_calibrated
):
    def lead(*_):
        folder = TeachingFolder(tmp_path / "grasps", resume=(tmp_path / "grasps").exists())
        folder.save([GraspResult("carry", 1, 30.0, True, "001-carry", "held for 30 s")])
        return folder

    monkeypatch.setattr(GuideOptions, "run", lead)
    monkeypatch.setattr(verb, "calibrated", lambda model, folder: (model, is_calibrated))
    out = tmp_path / "mine.json"
    code, printed, err = run(capsys, "teach", "twin:", "-o", out, "--json")
    if not is_calibrated:
        assert (code, printed, out.exists()) == (2, "", False)
        assert err.strip() == (
            f"holdfast: nothing was learned from {tmp_path / 'grasps'}: no slip was measured"
        )
        return
    assert code == 0
    report = json.loads(printed)
    assert (report["model"], report["heads"], report["verdict"]) == (str(out), {}, NO_SLIPS)
    assert [(x["name"], x["seconds"], x["kept"]) for x in report["steps"]] == [("carry", 30, True)]
    _, printed, _ = run(capsys, "teach", "twin:", "-o", out, "--force")
    assert "no slip was measured, so its slips stay" in " ".join(printed.split())


@pytest.mark.parametrize("name", ["carry", "hold"])
def test_what_was_carried_calibrates(tmp_path, capsys, name):
    """The arm of a synthetic hand hardly moves: the model stays as it is, and says why."""
    folder = TeachingFolder(tmp_path / "grasps", resume=False)
    save_recording(synthetic_recording("hand", 1), folder.path / "001-carry.mcap")
    folder.save([GraspResult(name, 1, 30.0, True, "001-carry")])
    model = Model.load("builtin:any")
    assert verb.calibrated(model, folder) == (model, False)
    why = {
        "carry": "uskin-curved: the arm hardly moved; move the arm as it will move later",
        "hold": "nothing is held in 0 recordings; at least 5 s of ordinary handling expected, in "
        "recordings that begin with an open hand",
    }
    assert capsys.readouterr().err == f"not calibrated: {why[name]}\n"


def test_a_protocol_that_is_complete_needs_no_hand(capsys, tmp_path, monkeypatch):
    """Only the fit was stopped: --resume goes on with it."""
    folder = TeachingFolder(tmp_path / "new-grasps", resume=False)
    names = [step.name for step in STEPS if not step.in_view]
    folder.save([GraspResult(name, 1, 9.0, True, f"00{k}-{name}") for k, name in enumerate(names)])
    monkeypatch.setattr(verb, "calibrated", lambda model, folder: (model, True))
    monkeypatch.chdir(tmp_path)
    code, printed, _ = run(capsys, "teach", "xela://127.0.0.1:1", "-o", "new.json", "--resume")
    assert (code, printed.split(":")[0]) == (0, "new.json")
