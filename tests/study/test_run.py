import json
import shutil
import subprocess
from pathlib import Path

import pytest

from holdfast.errors import OutputError, TrainingError
from holdfast.parallel import Engine
from holdfast.study import run
from holdfast.study.paper import experiments, paper_tables
from holdfast.study.plan import StudyPlan, scan_corpus
from holdfast.study.run import check_plan, run_study
from holdfast.synthetic import synthetic_recording

from .example_recordings import recordings_of_cases, save_all, save_synthetic

PAPER = ("confusion", "window", "ablation", "unseen", "fingers", "zhang")


@pytest.fixture(scope="module")
def few():
    """A study of few tasks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper_tables, "QUICK_WINDOWS", (14,))
        patch.setattr(paper_tables, "ABLATION_WINDOWS", (14,))
        patch.setattr(run, "PARTS", {"paper": paper_tables, "experiments": experiments})
        yield


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan") / "main"
    corpus = scan_corpus("main", save_all(folder, recordings_of_cases(["2", "1", "failed", "2"])))
    return StudyPlan({"main": corpus}, quick=True)


@pytest.fixture(scope="module")
def done(few, plan, tmp_path_factory):
    """The folder of a finished study, and its tables."""
    out = tmp_path_factory.mktemp("done") / "out"
    return out, run_study(plan, out, made_in=60.0, left_out=["the moon."])


def summary(out):
    return json.loads((out / "study.json").read_text())


def test_all_tables_and_figures_are_there(done):
    out, tables = done
    assert {*PAPER, "discrepancies"} == {table.name for table in tables}
    names = {"forces", "features", "experiment-1", "experiment-2", "window"}
    assert {path.stem for path in (out / "figures").iterdir()} == names
    written = summary(out)["tables"]
    assert list(written) == [table.name for table in tables]
    assert {"ours", "paper", "difference", "n", "interval"} < set(written["confusion"][0])


def test_the_summary_describes_the_run(done, plan):
    document = summary(done[0])
    assert document["seed"] == 0 and document["quick"] is True
    assert document["versions"]["numpy"] and "torch" in document["versions"]
    one = synthetic_recording("a", 0).modules["index"]
    assert document["data"]["main"] == {
        "name": "main", "digest": plan.main.digest, "recordings": 4, "fingers": ["index", "thumb"],
        "samples": 8 * len(one.times), "rate": pytest.approx(150.0), "tare": "0.5",
    }  # fmt: skip
    assert document["machine"]["cores"] >= 1
    assert document["seconds"]["data"] == 60.0
    assert "<li>Left out: the moon.</li>" in (done[0] / "report.html").read_text()


def test_no_output_contains_the_path_of_the_data(done, plan):
    texts = [path for path in done[0].rglob("*") if path.suffix in (".html", ".json", ".csv")]
    home = str(Path(plan.main.folder).parent)
    assert texts and not [path for path in texts if home in path.read_text()]


def test_stored_results_are_not_computed_again(done, plan, tmp_path):
    out = shutil.copytree(done[0], tmp_path / "out")
    with pytest.raises(OutputError, match="already holds a study: choose another name, or give"):
        run_study(plan, out)
    kept = {path.name: path.read_bytes() for path in (out / "work").iterdir()}
    (out / "data").mkdir()
    messages = []
    run_study(plan, out, notify=messages.append, force=True)
    assert messages[0] == f"{len(kept)} of {len(kept)} tasks are already done"
    assert {path.name: path.read_bytes() for path in (out / "work").iterdir()} == kept
    assert (out / "data").is_dir()
    assert summary(out)["tables"] == summary(done[0])["tables"]


def test_other_processes_give_the_same_tables(done, plan, tmp_path):
    assert run_study(plan, tmp_path / "out", Engine(2)) == done[1]


def test_a_browser_shows_the_report(done):
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no Chromium is installed")
    page = (done[0] / "report.html").as_uri()
    options = ("--headless", "--no-sandbox", "--disable-gpu", "--dump-dom")
    shown = subprocess.run(
        [browser, *options, page], capture_output=True, text=True, timeout=60, check=True
    ).stdout
    assert shown.count("<section") == 5
    assert shown.count("<svg") + shown.count("<img") == 5


def test_hands_of_one_finger_are_rejected(tmp_path):
    main = scan_corpus("main", save_synthetic(tmp_path / "main", range(2), fingers=("thumb",)))
    message = (
        r"one finger with labels of both classes given \(thumb\); the study compares classifiers "
        "of whole hands, which need at least two$"
    )
    with pytest.raises(TrainingError, match=message):
        check_plan(StudyPlan({"main": main}))
    with pytest.raises(TrainingError, match=message):
        run_study(StudyPlan({"main": main}), tmp_path / "out")
    assert not (tmp_path / "out").exists()
