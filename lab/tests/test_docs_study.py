"""The figures in docs/study.md and the pages beside it are those of the published study."""

import json
from pathlib import Path

import pytest

from benchmark_script import ROOT, load

script = load("publish_study")
PUBLISHED = ROOT / "docs" / "study"


@pytest.fixture(scope="module")
def summary():
    return script.published(PUBLISHED)


class TestPublished:
    def test_the_pages_are_what_the_templates_give(self, summary):
        for page, text in script.render(summary, PUBLISHED).items():
            assert (ROOT / "docs" / page).read_text("utf-8") == text, (
                f"docs/{page} differs: run python benchmarks/publish_study.py render"
            )

    def test_there_is_a_csv_of_each_table_and_no_other_data(self, summary):
        assert {path.stem for path in PUBLISHED.glob("*.csv")} == set(summary["tables"])
        templates = {f"{Path(page).name}.j2" for page in script.PAGES}
        others = {p.name for p in PUBLISHED.iterdir() if p.suffix not in (".csv", ".md")}
        assert others == {"study.json", "grip", "sources", *templates}


def row_of_readme(question):
    readme = (ROOT / "README.md").read_text("utf-8").splitlines()
    return next(line for line in readme if line.startswith(f"| {question}"))


def test_the_readme_quotes_the_published_study(summary):
    figures = script.Figures(summary["tables"])

    def accuracies(table, on, digits=1, field="ours"):
        rows = [{"classifier": x, "on": on, "figure": "accuracy"} for x in ("LogReg", "SVM")]
        return [figures.cell(table, row, digits, field=field) for row in rows]

    row = row_of_readme("Is the contact disturbed or held?")
    held_out = ", ".join(accuracies("confusion", "held out"))
    fresh = ", ".join(accuracies("unseen", "fresh recordings"))
    assert f"| {held_out} %; {fresh} % |" in row
    paper = accuracies("unseen", "fresh recordings", 2, "paper")
    assert f"unseen data of its own: {paper[0]}, {float(paper[1]):g} % |" in row


def rows_of(file, table):
    """Return the rows of a published table, each by its columns."""
    source = json.loads((PUBLISHED / "sources" / f"{file}.json").read_text("utf-8"))[table]
    return [dict(zip(source["columns"], row, strict=True)) for row in source["rows"]]


def test_the_readme_quotes_the_test_of_hands_never_met():
    ours, rival = rows_of("slips", "any")[:2]
    found, rate = (
        [row[name].split()[0] for row in (ours, rival)]
        for name in ("before 1 mm", "false alarms, held")
    )
    row = row_of_readme("Is this finger of a hand never met slipping?")
    assert f"| {found[0]} %; {float(rate[0]):.1f} |" in row
    assert f"{rival['by']}: {found[1]} %; {float(rate[1]):.1f} |" in row


def test_the_readme_quotes_the_hands_that_were_taught():
    ours, *_, rival = (row["next grasps"].split("; ") for row in rows_of("teach", "hands"))
    row = row_of_readme("And after `holdfast teach`?")
    found, interval = ours[0].split(" ", 1)
    assert f"| {found} % {interval}; {ours[-1]} |" in row
    assert f"| the same: {rival[0].split()[0]} %; {rival[-1].split()[0]} |" in row


def test_the_readme_quotes_the_real_recordings():
    boxes, tugs, sliding = (rows_of("real-data", "sets")[k] for k in (0, 5, 6))
    row = row_of_readme("And on real hands?")
    assert f"| {boxes['calibrated']}. {sliding['calibrated']} |" in row
    force, arm = (boxes[name].strip("*") for name in ("change of the force", "speed of the arm"))
    tug = tugs["change of the force"].strip("*")
    assert f"| change of force: {force}. {tug}; speed of the arm: {arm}." in row


def test_the_page_of_slips_begins_with_its_figures():
    page = (PUBLISHED / "slips.md").read_text("utf-8").partition("\n## ")[0]
    _, slips, long_hold, _ = (row["before 1 mm"] for row in rows_of("slips", "fresh"))
    assert f"`builtin:twin` finds {slips} % of the slips over 1 mm" in page
    assert f"(in long holds {long_hold})" in page
    found = rows_of("slips", "any")[0]["before 1 mm"].split()[0]
    assert f"[{found} % before 1 mm]" in page
