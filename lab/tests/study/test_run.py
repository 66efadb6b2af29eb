import json
import shutil
from pathlib import Path

import pytest

from holdfast.errors import OutputError
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study import run
from holdfast_lab.study.paper import paper_tables
from holdfast_lab.study.plan import StudyPlan, scan_corpus
from holdfast_lab.study.run import run_study

from .example_recordings import recordings_of_cases, save_all

ALL_PARTS = run.PARTS
PAPER = ("confusion", "window", "ablation", "unseen", "fingers", "zhang")


@pytest.fixture(scope="module")
def few():
    """A study of few tasks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper_tables, "QUICK_WINDOWS", (14,))
        patch.setattr(paper_tables, "ABLATION_WINDOWS", (14,))
        patch.setattr(run, "PARTS", {name: ALL_PARTS[name] for name in ("paper", "experiments")})
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
    assert document["versions"]["numpy"] and "scipy" in document["versions"]
    one = synthetic_recording("a", 0).modules["index"]
    assert document["data"]["main"] == {
        "name": "main", "digest": plan.main.digest, "recordings": 4, "fingers": ["index", "thumb"],
        "samples": 8 * len(one.times), "rate": pytest.approx(150.0), "tare": "0.5",
    }  # fmt: skip
    assert document["machine"]["cores"] >= 1
    assert document["seconds"]["data"] == 60.0
    report = (done[0] / "report.md").read_text()
    assert "the moon" in report
    assert all(f"(figures/{path.name})" in report for path in (done[0] / "figures").iterdir())


def test_no_output_contains_the_path_of_the_data(done, plan):
    texts = [path for path in done[0].rglob("*") if path.suffix in (".md", ".json", ".csv")]
    home = str(Path(plan.main.folder).parent)
    assert texts and not [path for path in texts if home in path.read_text()]


def test_stored_results_are_not_computed_again(done, plan, tmp_path):
    out = shutil.copytree(done[0], tmp_path / "out")
    with pytest.raises(OutputError, match="--force"):
        run_study(plan, out)
    kept = {path.name: path.read_bytes() for path in (out / "work").glob("*.msgpack")}
    (out / "data").mkdir()
    messages = []
    run_study(plan, out, notify=messages.append, force=True)
    assert messages[0] == f"{len(kept)} of {len(kept)} tasks are already done"
    assert {path.name: path.read_bytes() for path in (out / "work").glob("*.msgpack")} == kept
    assert (out / "data").is_dir()
    assert summary(out)["tables"] == summary(done[0])["tables"]


def test_a_study_has_the_parts_of_the_paper_and_a_full_one_all(plan, monkeypatch, tmp_path):
    asked = []
    parts = {name: run.StudyPart(lambda _, name=name: asked.append(name) or [])
             for name in ("paper", "slips")}  # fmt: skip
    monkeypatch.setattr(run, "PARTS", parts)
    for settings, found in (({}, 1), ({"quick": True}, 2), ({"full": True}, 2)):
        asked.clear()
        out = tmp_path / repr(settings)
        run_study(StudyPlan(plan.corpora, **settings), out)
        assert len(asked) == found
        left_out = summary(out)["left_out"]
        assert any(each.endswith("slips, shipped: give --full.") for each in left_out) == (
            not settings
        )
