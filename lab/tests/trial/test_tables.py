import pytest

from holdfast_lab.report.result_tables import pivot, to_csv
from holdfast_lab.report.table_layouts import to_markdown
from holdfast_lab.trial.document import document_of
from holdfast_lab.trial.plan import TrialPlan
from holdfast_lab.trial.tables import (
    fingers_table,
    kinds_table,
    laws_table,
    objects_table,
    paired_table,
)

from .example_results import results_of


@pytest.fixture(scope="module")
def document():
    return document_of(TrialPlan(("fixed", "pr2", "holdfast"), 12), results_of(), 0)


def test_the_table_of_laws(document):
    lines = to_markdown(laws_table(document)).splitlines()
    fixed, _, ours = (line for line in lines if line.startswith(("| fixed", "| pr2", "| hold")))
    assert fixed.split("|")[2].strip().startswith("63.6<br>")
    assert fixed.split("|")[3].strip() == "infinite<br><sub>2.00–∞</sub>"
    assert ours.split("|")[2].strip() == "0.0<br><sub>0.0–0.0</sub>"
    assert ours.split("|")[4].strip() == "30<br><sub>30–30</sub>"
    assert "On 11 trials." in lines[-1] and "bootstrap over trials" in lines[-1]


def test_a_table_has_values_and_no_paper(document):
    assert to_csv(laws_table(document)).splitlines()[0] == "law,figure,value,n,low,high"


def test_every_law_has_a_line_in_each_part(document):
    for table, n_parts in ((kinds_table, 5), (objects_table, 2)):
        assert len(pivot(table(document)).lines) == 3 * n_parts


def test_parts_without_trials_are_left_out(document):
    assert {line.heads[0] for line in pivot(fingers_table(document)).lines} == {"4"}


def test_differences_are_to_the_named_law(document):
    table = paired_table(document, "fixed")
    assert [line.heads[0] for line in pivot(table).lines] == ["pr2", "holdfast"]
    assert pivot(table).lines[1].cells[0].ours == pytest.approx(-100 * 7 / 11)
