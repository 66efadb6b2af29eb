import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from holdfast.contact import ContactState
from holdfast.errors import OutputError, TrainingError
from holdfast.parallel import Engine
from holdfast.study import run
from holdfast.study.paper import experiments, paper_tables
from holdfast.study.paper.published import discrepancies
from holdfast.study.plan import StudyPlan, scan_corpus
from holdfast.study.report.html_report import ReportFigure
from holdfast.study.report.result_tables import ResultTable, Row
from holdfast.study.run import check_plan, run_study
from holdfast.study.sections import OUTLINES, TWIN_NOTE, PartOutput, report_sections
from holdfast.synthetic import synthetic_recording

from .example_recordings import save_all, save_synthetic

PAPER = ("confusion", "window", "ablation", "unseen", "fingers", "zhang")


def table(name, n=3):
    return ResultTable(name, name, "Note.", [Row({"m": "a", "figure": "x"}, 1.0, n=n)], ("m",))


def titles(found):
    return [(section.title, [table.name for table in section.tables]) for section in found]


class TestSections:
    def test_tables_stand_where_they_are_named_else_with_their_part(self):
        made = {
            "paper": PartOutput(
                [table("unseen"), table("more"), table("confusion"), discrepancies()], []
            ),
            "real": PartOutput([table("hand")], [ReportFigure("forces", "", None)]),
        }
        found = report_sections(made, ["a", "b"], twin=False)
        assert titles(found) == [
            ("What was run", []),
            ("The paper's tables", ["confusion", "more"]),
            ("Where the paper disagrees with itself", ["discrepancies"]),
            ("Results on new data", ["unseen"]),
            ("Real recordings", ["hand"]),
        ]
        assert found[0].text == "- a\n- b"
        assert [picture.name for picture in found[-1].figures] == ["forces"]

    def test_what_the_twin_cannot_show_stands_beside_what_rests_on_it(self):
        made = {
            "paper": PartOutput([table("confusion"), table("cost", None), discrepancies()], []),
            "real": PartOutput([table("hand")], []),
        }
        found = report_sections(made, [], twin=True)
        notes = {table.name: table.note for section in found for table in section.tables}
        assert notes["confusion"] == f"Note. {TWIN_NOTE}"
        assert notes["hand"] == notes["cost"] == "Note."
        assert TWIN_NOTE not in notes["discrepancies"]
        assert found[-1].title == "What the twin cannot show"
        lines = found[-1].text.split("\n\n")[1].splitlines()
        assert len(lines) > 3 and all(line.startswith("- ") for line in lines)

    def test_every_section_has_a_text_on_how_to_read_it(self):
        assert all(len(outline.text.split()) > 20 for outline in OUTLINES)
        named = [name for outline in OUTLINES for name in outline.names]
        assert len(named) == len(set(named))


def with_case(recording, case):
    return replace(recording, metadata={**recording.metadata, "case": case})


def recordings(cases, start=0):
    for seed, case in enumerate(cases, start):
        made = synthetic_recording(f"{case}-{seed}", seed, ("index", "thumb"))
        yield with_case(made, case)


class TestExperiments:
    def test_recordings_are_chosen_by_case_and_name_where_nothing_trained(self, tmp_path):
        main = scan_corpus("main", save_all(tmp_path / "a", recordings(["2", "failed", "1"])))
        others = scan_corpus("others", save_all(tmp_path / "b", recordings(["2", "2"], 5)))
        shown = experiments.predict_examples({"others": others, "main": main}, "index", 0)
        assert [(s.experiment, s.role, s.recording) for s in shown] == [
            ("protocol", "main", "2-0"),
            ("failed", "main", "failed-1"),
            ("disturbed", "others", "2-5"),
        ]
        n = len(synthetic_recording("a", 0).modules["index"].times)
        assert not shown[0].states
        assert all(len(states) == n for s in shown[1:] for states in s.states.values())
        assert all(set(s.states) == {"logreg", "svm"} for s in shown[1:])

    def test_a_recording_is_judged_by_fits_without_it(self, tmp_path):
        """What a recording is labelled makes no difference to what is predicted of it."""
        found = []
        for state in (ContactState.STABLE, ContactState.UNSTABLE):
            first, *rest = recordings(["2", "1", "1"])
            labels = {
                name: [replace(label, state=state) for label in module.labels]
                for name, module in first.modules.items()
            }
            place = tmp_path / state.value
            main = scan_corpus("main", save_all(place, [first.with_labels(labels), *rest]))
            found.append(experiments.predict_examples({"main": main}, "index", 0)[1])
        assert found[0].recording == "2-0"
        assert found[0] == found[1]

    def test_without_cases_the_first_recording_is_shown(self, tmp_path):
        main = scan_corpus("main", save_synthetic(tmp_path / "a", range(2)))
        shown = experiments.predict_examples({"main": main}, "index", 0)
        assert [(s.experiment, s.recording) for s in shown] == [
            ("protocol", "grasp-0"),
            ("any", "grasp-0"),
        ]


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
    corpus = scan_corpus("main", save_all(folder, recordings(["2", "1", "failed", "2"])))
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
    told = summary(out)["tables"]
    assert list(told) == [table.name for table in tables]
    assert {"ours", "paper", "difference", "n", "interval"} < set(told["confusion"][0])


def test_the_summary_says_what_was_run(done, plan):
    told = summary(done[0])
    assert told["seed"] == 0 and told["quick"] is True
    assert told["versions"]["numpy"] and "torch" in told["versions"]
    one = synthetic_recording("a", 0).modules["index"]
    assert told["data"]["main"] == {
        "name": "main", "digest": plan.main.digest, "recordings": 4, "fingers": ["index", "thumb"],
        "samples": 8 * len(one.times), "rate": pytest.approx(150.0), "tare": "0.5",
    }  # fmt: skip
    assert told["machine"]["cores"] >= 1
    assert told["seconds"]["data"] == 60.0
    assert "<li>Left out: the moon.</li>" in (done[0] / "report.html").read_text()


def test_nothing_tells_where_it_was_made(done, plan):
    texts = [path for path in done[0].rglob("*") if path.suffix in (".html", ".json", ".csv")]
    home = str(Path(plan.main.folder).parent)
    assert texts and not [path for path in texts if home in path.read_text()]


def test_what_is_kept_is_not_computed_again(done, plan, tmp_path):
    out = shutil.copytree(done[0], tmp_path / "out")
    with pytest.raises(OutputError, match="already holds a study: choose another name, or give"):
        run_study(plan, out)
    kept = {path.name: path.read_bytes() for path in (out / "work").iterdir()}
    (out / "data").mkdir()
    told = []
    run_study(plan, out, notify=told.append, force=True)
    assert told[0] == f"{len(kept)} of {len(kept)} tasks are already done"
    assert {path.name: path.read_bytes() for path in (out / "work").iterdir()} == kept
    assert (out / "data").is_dir()
    assert summary(out)["tables"] == summary(done[0])["tables"]


def test_other_processes_find_the_same(done, plan, tmp_path):
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


def test_hands_of_one_finger_are_refused(tmp_path):
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
