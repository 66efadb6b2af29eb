import csv

import pytest

from holdfast.errors import OutputError
from holdfast_lab.report.sections import Section
from holdfast_lab.trial import experiment
from holdfast_lab.trial import plan as trial_plan
from holdfast_lab.trial.course import TrialCourse
from holdfast_lab.trial.experiment import run_trials
from holdfast_lab.trial.plan import TrialPlan

from .example_results import invented

LAWS = ("fixed", "holdfast")


@pytest.fixture
def calls(monkeypatch):
    """Trials and courses that take no time; the names of all trials that were run."""
    made = []

    def run_trial(trial, law, model):
        made.append(f"{trial.number}/{law}")
        return invented(trial, law)

    course = TrialCourse([-0.5, 0.0, 0.5], [2.0] * 3, [1.0] * 3, [0.0] * 3, 0.4)
    monkeypatch.setattr(trial_plan, "run_trial", run_trial)
    monkeypatch.setattr(trial_plan, "follow", lambda *_: ())
    monkeypatch.setattr(TrialCourse, "of", lambda _: course)
    return made


@pytest.fixture
def undrawn(monkeypatch):
    """Reports without tables and figures, which take most of the time."""
    monkeypatch.setattr(experiment, "report_sections", lambda *_: [Section("All", "")])


def test_files_of_a_comparison(tmp_path, calls):
    document = run_trials(TrialPlan(LAWS, 6), tmp_path / "out")
    out = tmp_path / "out"
    assert {path.name for path in out.iterdir()} == {
        "report.md", "trial.json", "trials.csv", "tables", "figures", "work",
    }  # fmt: skip
    assert "numpy" in document["versions"]
    assert len(list(csv.reader((out / "trials.csv").read_text().splitlines()))) == 13
    page = (out / "report.md").read_text()
    assert str(tmp_path) not in page
    for name in ("laws", "slips", "forces", "drops", "paired-fixed", "kinds", "objects", "fingers"):
        assert (out / f"tables/{name}.md").read_text().strip() in page
    for name in ("course", "force", "distributions", "kinds"):
        assert f"(figures/{name}.png)" in page and (out / f"figures/{name}.png").is_file()


def test_finished_trials_are_not_run_again(tmp_path, calls, undrawn):
    out = tmp_path / "out"
    run_trials(TrialPlan(("fixed",), 4), out)
    assert calls == [f"{k}/fixed" for k in range(4)]
    with pytest.raises(OutputError, match="--force"):
        run_trials(TrialPlan(LAWS, 4), out)
    messages = []
    run_trials(TrialPlan(LAWS, 4), out, notify=messages.append, force=True)
    assert calls[4:] == [f"{k}/holdfast" for k in range(4)]
    assert messages[0] == "4 of 8 tasks are already done"
    run_trials(TrialPlan(LAWS, 6), out, force=True)
    assert sorted(calls[8:]) == ["4/fixed", "4/holdfast", "5/fixed", "5/holdfast"]
