import json
import os
from contextlib import contextmanager
from functools import partial

import pytest

from command_line import Verb
from holdfast.cli.teach import verb
from holdfast.cli.teach.options import GuideOptions
from holdfast.cli.teach.report import NO_SLIPS
from holdfast.detection import Model
from holdfast.io import save_recording
from holdfast.live.teaching.folder import TeachingFolder
from holdfast.live.teaching.protocol import GraspResult
from holdfast.live.teaching.steps import STEPS
from holdfast.twin import webcam
from training.build import handling_recording, normalised_model, sliding_recording

pytestmark = pytest.mark.slow

run = Verb().run


@pytest.fixture(scope="module")
def grasps(tmp_path_factory):
    """Three recordings of two fingers, each of which slides four times."""
    folder = tmp_path_factory.mktemp("grasps")
    for seed in range(3):
        recording = sliding_recording(seed)
        save_recording(recording, folder / f"{recording.name}.parquet")
    return folder


def test_a_model_is_written_with_what_it_finds(capsys, grasps, tmp_path):
    out, trained = tmp_path / "mine.json", tmp_path / "trained.json"
    words = ("teach", "--from", grasps, "-o", out, "--false-alarms", 3)
    code, printed, err = run(capsys, *words, "--json")
    report = json.loads(printed)
    warnings = report["warnings"]  # after the features that one taxel cannot have
    assert (code, err.splitlines()[-len(warnings) :]) == (0, warnings)
    assert set(report) == {
        "model", "steps", "heads", "base", "hand_false_alarms_per_minute", "curve", "warnings",
        "verdict",
    }  # fmt: skip
    slip = report["heads"]["slip"]
    assert (slip["n"], slip["grasps"], slip["out_of_fold"]["n"]) == (24, 3, 24)
    assert slip["out_of_fold"]["onsets"] == report["base"]["onsets"] == "labels"
    assert Model.load(out).finger("thumb").slip.choice.n == 24
    code, printed, _ = run(capsys, *words[:-2], "--force")
    *lines, last = printed.splitlines()
    assert (code, last) == (0, f"{out}: taught by 3 recordings")
    first = [line.split()[0] for line in lines if line.strip()]
    assert first.index("taught") < first.index("builtin:any") < first.index("never")
    assert all(len(line) <= 80 for line in lines)
    assert run(capsys, "train", grasps, "-o", trained, "--for", "slip")[0] == 0
    assert trained.read_bytes() == out.read_bytes()


def test_no_hand_at_the_source_is_one_line(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pipe_of(monkeypatch, "next\n"):
        code, _, err = run(capsys, "teach", "xela://127.0.0.1:1", "-o", "new.json")
    assert code == 2
    assert "127.0.0.1:1" in err.splitlines()[-1]
    assert "--camera" in err
    code, _, err = run(capsys, "teach", "xela:", "-o", "new.json", "--camera", "none.mp4")
    assert (code, "none.mp4" in err) == (2, True)
    with pipe_of(monkeypatch, "quit\n"):
        code, _, err = run(capsys, "teach", "xela://127.0.0.1:1", "-o", "new.json")
    assert (code, err.splitlines()[-1]) == (2, "holdfast: not confirmed: nothing was recorded")
    assert list(tmp_path.iterdir()) == []


@contextmanager
def pipe_of(monkeypatch, text):
    """Let stdin be a pipe with these lines, which stays open."""
    reading, writing = os.pipe()
    os.write(writing, text.encode())
    with os.fdopen(reading) as pipe:
        monkeypatch.setattr("sys.stdin", pipe)
        yield
    os.close(writing)


SHORT = {"open": 1.0, "pull": 9.0}


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
    monkeypatch.setattr(webcam, "N_SUBPIXELS", 1)
    monkeypatch.setattr(webcam, "N_INSTANTS", 1)
    monkeypatch.chdir(tmp_path)
    words = ("teach", "twin:?object=can&seed=3", "-o", "mine.json", "--unattended", "--json")
    code, printed, err = run(capsys, *words, "--false-alarms", "60")
    assert code == 0, err
    report = json.loads(printed)
    kept = [(x["name"], x["kept"]) for x in report["steps"] if x["kept"]]
    assert kept == [(x, True) for x in ("open", "pull", "pull")]
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
        assert str(tmp_path / "grasps") in err
        return
    assert code == 0
    report = json.loads(printed)
    assert (report["model"], report["heads"], report["verdict"]) == (str(out), {}, NO_SLIPS)
    assert [(x["name"], x["seconds"], x["kept"]) for x in report["steps"]] == [("carry", 30, True)]
    assert run(capsys, "teach", "twin:", "-o", out, "--force")[0] == 0


@pytest.mark.parametrize(
    ("name", "options", "why"),
    [
        ("carry", {}, ""),
        ("carry", {"sway": 0.0}, "pad: the arm hardly moved"),
        ("hold", {}, "nothing"),
    ],
)
def test_what_was_carried_calibrates(tmp_path, capsys, name, options, why):
    folder = TeachingFolder(tmp_path / "grasps", resume=False)
    recording = handling_recording(0, held=36.0, **options)
    folder.save([GraspResult(name, 1, 30.0, True, "001-carry")])
    save_recording(recording, folder.path / "001-carry.mcap")
    model = normalised_model()
    made, is_calibrated = verb.calibrated(model, folder)
    assert (is_calibrated, made == model) == (not why, bool(why))
    assert capsys.readouterr().err.startswith(f"not calibrated: {why}" if why else "")


def test_a_protocol_that_is_complete_needs_no_hand(capsys, tmp_path, monkeypatch):
    """Only the fit was stopped: --resume goes on with it."""
    folder = TeachingFolder(tmp_path / "new-grasps", resume=False)
    names = [step.name for step in STEPS if not step.in_view]
    folder.save([GraspResult(name, 1, 9.0, True, f"00{k}-{name}") for k, name in enumerate(names)])
    monkeypatch.setattr(verb, "calibrated", lambda model, folder: (model, True))
    monkeypatch.chdir(tmp_path)
    code, printed, _ = run(capsys, "teach", "xela://127.0.0.1:1", "-o", "new.json", "--resume")
    assert (code, printed.split(":")[0]) == (0, "new.json")
