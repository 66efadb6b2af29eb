"""The figures in docs/study/grip-trials.md are those of the published run of `holdfast trial`."""

import json
import shutil

import msgspec
import pytest

from benchmark_script import ROOT, load
from holdfast_lab.trial.document import document_of
from holdfast_lab.trial.plan import TrialPlan
from trial.example_results import results_of

script = load("publish_trial")
PUBLISHED = ROOT / "docs" / "study" / "grip"


def test_the_page_is_what_the_template_gives():
    assert (ROOT / "docs" / "study" / script.PAGE).read_text("utf-8") == script.render(PUBLISHED), (
        "docs/study/grip-trials.md differs: run python benchmarks/publish_trial.py render"
    )


def test_the_readme_quotes_the_published_run():
    laws = json.loads((PUBLISHED / "trial.json").read_text("utf-8"))["laws"]
    sets = json.loads((PUBLISHED / "sets.json").read_text("utf-8"))
    ours, twice = (sets["mild"]["laws"][name] for name in ("holdfast", "fixed-2"))
    readme = (ROOT / "README.md").read_text("utf-8").splitlines()
    row = next(line for line in readme if line.startswith("| Is less dropped?"))
    dropped, force = (
        [f"{law[name]['value']:.1f}" for law in (ours, twice)]
        for name in ("dropped", "force_ratio_mean")
    )
    assert f"| {dropped[0]} %; {force[0]}. " in row
    assert f"twice the first grip: {dropped[1]} %; {force[1]} |" in row
    for name, text in (("taught", "a taught model"), ("any", "calibrated `any`:")):
        assert f"{text} {sets[name]['laws']['holdfast']['dropped']['value']:.1f} %" in row
    rivals = [laws[name] for name in ("pr2", "wong-zhu", "friction-margin")]
    least = ours["force_ratio_mean"]["value"]
    assert all(one["force_ratio_mean"]["value"] > least for one in rivals)
    assert all(one["dropped"]["value"] < ours["dropped"]["value"] for one in rivals)


@pytest.fixture
def runs(tmp_path):
    """Folders of invented runs with both plants; docs with the template and an older run's file."""
    (tmp_path / "docs/grip").mkdir(parents=True)
    (tmp_path / "docs/grip/old.csv").write_text("old")
    shutil.copy(PUBLISHED / f"{script.PAGE}.j2", tmp_path / "docs/grip")
    laws = ("fixed", "fixed-2", "true-slips", "holdfast")
    for plant in ("mild", "hard"):
        plan = TrialPlan(laws, 12, model="builtin:any", plant=plant)
        document = document_of(plan, results_of(laws), 0)
        document |= {"seconds": {"trials": 90.0}, "machine": {"cores": 2}, "versions": {}}
        for name in ("tables", "figures"):
            (tmp_path / plant / name).mkdir(parents=True)
        (tmp_path / plant / "trial.json").write_bytes(msgspec.json.encode(document))
        (tmp_path / plant / "trials.csv").write_text("a")
        (tmp_path / plant / "tables/laws.csv").write_text("b")
        (tmp_path / plant / "figures/course.png").write_bytes(b"c")
    return tmp_path


def test_runs_are_published_in_place_of_the_old_one(runs):
    docs, mild, hard = runs / "docs", runs / "mild", runs / "hard"
    with pytest.raises(FileNotFoundError):
        script.publish(runs / "none", docs, hard)
    assert (docs / "grip/old.csv").exists()
    script.publish(mild, docs, hard)
    script.publish_sets(docs, {"mild": mild, "hard": hard})
    assert {path.name for path in (docs / "grip").iterdir()} == {
        "trial.json", "hard.json", "sets.json", "trials.csv", "laws.csv", "course.png",
        f"{script.PAGE}.j2",
    }  # fmt: skip
    assert "trials" not in json.loads((docs / "grip/trial.json").read_text())
    script.write_page(docs)
    page = (docs / script.PAGE).read_text()
    assert "(grip/course.png)" in page and "(grip/force.png)" not in page
    assert "| `fixed` | 63.6<br><sub>" in page
    assert "| hard | hard, 0 | `holdfast` | 11 |" in page
