import json

import msgspec
import pytest

from holdfast.cli import main
from holdfast.model import Model
from holdfast_lab.report.sections import Section
from holdfast_lab.trial import experiment, plan
from holdfast_lab.trial.course import TrialCourse
from trial.example_results import invented


@pytest.fixture
def quick(monkeypatch):
    """Trials that take no time."""
    course = TrialCourse([0.0, 0.5], [2.0] * 2, [1.0] * 2, [0.0] * 2, 0.4)
    monkeypatch.setattr(plan, "run_trial", invented)
    monkeypatch.setattr(plan, "follow", lambda *_: ())
    monkeypatch.setattr(TrialCourse, "of", lambda _: course)
    monkeypatch.setattr(experiment, "report_sections", lambda *_: [Section("All", "")])


@pytest.mark.slow
def test_trial_json_has_every_law(tmp_path, capsys, quick):
    assert main(["trial", "--out", str(tmp_path / "out"), "--n", "3", "--jobs", "1"]) == 0
    document = json.loads((tmp_path / "out/trial.json").read_text())
    assert list(document["laws"])[:2] == ["fixed", "pr2"]
    assert {"wong-zhu", "friction-margin", "holdfast"} <= set(document["laws"])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines[:-1])) <= 80
    assert lines[2].split() == ["fixed", "3", "66.7", "inf", "inf", "1.40", "0.0"]
    assert lines[-1].startswith(f"{tmp_path / 'out' / 'report.md'}: ")


@pytest.mark.slow
def test_json_goes_to_stdout(tmp_path, capsys, quick):
    words = ["--n", "2", "--laws", "holdfast", "--jobs", "1", "--json"]
    assert main(["trial", "--out", str(tmp_path / "out"), *words]) == 0
    document = json.loads(capsys.readouterr().out)
    assert list(document["laws"]) == ["holdfast"]
    assert (document["plant"]["name"], document["plant"]["latency"]) == ("mild", [0, 0])


@pytest.mark.slow
def test_the_plant_reaches_the_trials_and_the_document(tmp_path, capsys, quick, monkeypatch):
    ran = []
    monkeypatch.setattr(
        plan, "run_trial", lambda trial, *rest: ran.append(trial) or invented(trial, *rest)
    )
    words = ["--n", "4", "--laws", "holdfast", "--jobs", "1", "--json", "--plant", "hard"]
    assert main(["trial", "--out", str(tmp_path / "out"), *words]) == 0
    assert {trial.grasp.plant for trial in ran} == {"hard"}
    assert json.loads(capsys.readouterr().out)["plant"]["backlash"] == 0.01


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--laws", "magic"], "unknown law 'magic'; there are fixed"),
        (["--laws", "fixed,fixed"], "the law 'fixed' is given twice"),
        (["--n", "0"], "at least 1 trial expected, 0 given"),
        (["--plant", "soft"], "unknown plant 'soft'; there are mild, hard"),
        (["--seed", "-1"], "a seed of at least 0 expected, -1 given"),
        (["--jobs", "0"], "jobs other than 0 expected, 0 given"),
        (["--engine", "moon"], "unknown engine 'moon'"),
        (["--model", "nothing.json"], "nothing.json"),
        (["--model", "three.json"], "the model has no ring, only thumb, index, middle"),
    ],
)
def test_bad_input_is_one_line(tmp_path, capsys, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    model = Model.load("builtin:noise-floor")
    fingers = dict.fromkeys(("thumb", "index", "middle"), model.fingers["*"])
    msgspec.structs.replace(model, fingers=fingers).save("three.json")
    assert main(["trial", "--out", str(tmp_path / "out"), *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "message"), [("trial.json", "give --force"), ("notes.txt", "holds other files")]
)
def test_what_a_folder_holds_is_kept(tmp_path, capsys, quick, name, message):
    (tmp_path / name).write_text("mine")
    assert main(["trial", "--out", str(tmp_path), "--n", "1", "--jobs", "1"]) == 2
    assert message in capsys.readouterr().err
    assert (tmp_path / name).read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_an_interrupt_names_the_folder(tmp_path, capsys, quick, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(plan, "run_trial", stop)
    out = tmp_path / "out"
    assert main(["trial", "--out", str(out), "--n", "1", "--jobs", "1"]) == 130
    assert (
        f"the finished trials are in {out}: the same command continues" in capsys.readouterr().err
    )
    assert not (out / "trial.json").exists()
