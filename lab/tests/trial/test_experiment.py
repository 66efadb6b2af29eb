import csv
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from holdfast.errors import OutputError
from holdfast.parallel import Engine
from holdfast_lab.report.sections import Section
from holdfast_lab.trial import experiment
from holdfast_lab.trial import plan as trial_plan
from holdfast_lab.trial.course import TrialCourse
from holdfast_lab.trial.document import document_of, example_of
from holdfast_lab.trial.experiment import run_trials
from holdfast_lab.trial.plan import TrialPlan

from .example_results import invented, results_of

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


def kept(out):
    return sorted(path.name for path in (out / "work").glob("[!.]*.msgpack"))


def outcome(out):
    """Everything in trial.json that does not depend on the machine and the time."""
    document = json.loads((out / "trial.json").read_text())
    return {name: value for name, value in document.items() if name not in ("machine", "seconds")}


def test_files_of_a_comparison(tmp_path, calls):
    document = run_trials(TrialPlan(LAWS, 6), tmp_path / "out")
    out = tmp_path / "out"
    assert {path.name for path in out.iterdir()} == {
        "report.md", "trial.json", "trials.csv", "tables", "figures", "work",
    }  # fmt: skip
    assert "numpy" in document["versions"]
    assert document["example"] == {
        "number": 0, "object": "ball", "kind": "weight", "n_fingers": 4,
        "lost_by": "fixed", "held_by": "holdfast",
    }  # fmt: skip
    assert len(list(csv.reader((out / "trials.csv").read_text().splitlines()))) == 13
    page = (out / "report.md").read_text()
    assert "fixed loses it 0.40 s later" in page
    assert str(tmp_path) not in page
    for name in ("laws", "slips", "forces", "drops", "paired-fixed", "kinds", "objects", "fingers"):
        assert (out / f"tables/{name}.md").read_text().strip() in page
    for name in ("course", "force", "distributions", "kinds"):
        assert f"(figures/{name}.png)" in page and (out / f"figures/{name}.png").is_file()


def test_finished_trials_are_not_run_again(tmp_path, calls, undrawn):
    out = tmp_path / "out"
    run_trials(TrialPlan(("fixed",), 4), out)
    assert calls == [f"{k}/fixed" for k in range(4)]
    with pytest.raises(OutputError, match=r"already holds a comparison of grip laws: choose an"):
        run_trials(TrialPlan(LAWS, 4), out)
    messages = []
    run_trials(TrialPlan(LAWS, 4), out, notify=messages.append, force=True)
    assert calls[4:] == [f"{k}/holdfast" for k in range(4)]
    assert messages[0] == "4 of 8 tasks are already done"
    run_trials(TrialPlan(LAWS, 6), out, force=True)
    assert sorted(calls[8:]) == ["4/fixed", "4/holdfast", "5/fixed", "5/holdfast"]


def test_an_interrupt_keeps_finished_trials_and_writes_nothing_else(tmp_path, calls, undrawn):
    def follow(items, *_):
        for place, item in enumerate(items):
            if place == 3:
                raise KeyboardInterrupt
            yield item

    with suppress(KeyboardInterrupt):
        run_trials(TrialPlan(LAWS, 6), tmp_path / "out", progress=follow)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["work"]
    assert len(kept(tmp_path / "out")) == 4
    run_trials(TrialPlan(LAWS, 6), tmp_path / "out")
    assert len(set(calls)) == len(calls) == 12


def test_a_killed_comparison_continues(tmp_path, calls, undrawn):
    out = tmp_path / "out"
    code = f"""if True:
        import time
        from pathlib import Path
        from holdfast_lab.trial import plan
        from holdfast_lab.trial.experiment import run_trials
        from trial.example_results import invented

        def slow(trial, law, model):
            time.sleep(0.05)
            return invented(trial, law)

        plan.run_trial = slow
        run_trials(plan.TrialPlan({LAWS!r}, 40), {str(out)!r})
    """
    tests = str(Path(__file__).parents[1])
    with subprocess.Popen(
        [sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": tests}
    ) as running:
        while len(kept(out)) < 3 and running.poll() is None:
            time.sleep(0.01)
        running.send_signal(signal.SIGKILL)
    n_kept = len(kept(out))
    assert 3 <= n_kept < 80
    assert not (out / "trial.json").exists()
    run_trials(TrialPlan(LAWS, 40), out)
    assert len(calls) == 80 - n_kept
    run_trials(TrialPlan(LAWS, 40), tmp_path / "whole")
    assert outcome(out) == outcome(tmp_path / "whole")


def test_other_files_are_not_touched(tmp_path, calls):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"holds other files \(notes.txt, ...\) and no compari"):
        run_trials(TrialPlan(LAWS, 2), tmp_path, force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    assert calls == []


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """The folder of two real trials of one law, run in this process."""
    out = tmp_path_factory.mktemp("real") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(experiment, "report_sections", lambda *_: [Section("All", "")])
        run_trials(TrialPlan(("fixed",), 2), out)
    return out


def test_other_processes_give_the_same_results(real, tmp_path, undrawn):
    run_trials(TrialPlan(("fixed",), 2), tmp_path / "out", Engine(2))
    assert outcome(tmp_path / "out") == outcome(real)
    assert kept(tmp_path / "out") == kept(real)


def test_a_cluster_gives_the_same_results(real, tmp_path, undrawn):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0",
        silence_logs=50,
    ) as cluster:  # fmt: skip
        engine = Engine.parse(f"dask:{cluster.scheduler_address}")
        run_trials(TrialPlan(("fixed",), 2), tmp_path / "out", engine)
    assert outcome(tmp_path / "out") == outcome(real)
    assert kept(tmp_path / "out") == kept(real)


def test_the_kind_of_folder_is_named_by_its_summary():
    assert experiment.COMPARISON.outputs[-1] == "trial.json"


def test_without_an_example_the_report_says_so():
    results = results_of(("pr2",))
    document = document_of(TrialPlan(tuple(results), 12), results, example_of(results))
    laws, paired, *_, shown = experiment.report_sections(document, results, None)
    assert shown.text.startswith("There is no such trial.") and not shown.figures
    assert laws.tables and not paired.tables
