import json

import pytest

from holdfast.cli import main
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
    assert lines[2].split() == ["fixed", "3", "66.7", "inf", "inf", "1.40", "0.0"]


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
        (["--laws", "magic"], "'magic'"),
        (["--jobs", "0"], "0 given"),
        (["--engine", "moon"], "'moon'"),
        (["--model", "nothing.json"], "nothing.json"),
    ],
)
def test_bad_input_is_one_line(tmp_path, capsys, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    assert main(["trial", "--out", str(tmp_path / "out"), *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_an_interrupt_names_the_folder(tmp_path, capsys, quick, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(plan, "run_trial", stop)
    out = tmp_path / "out"
    assert main(["trial", "--out", str(out), "--n", "1", "--jobs", "1"]) == 130
    assert str(out) in capsys.readouterr().err
    assert not (out / "trial.json").exists()
