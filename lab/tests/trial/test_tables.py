import pytest

from holdfast_lab.report.result_tables import pivot
from holdfast_lab.trial.document import document_of
from holdfast_lab.trial.plan import TrialPlan
from holdfast_lab.trial.tables import (
    fingers_table,
    kinds_table,
    objects_table,
    paired_table,
)

from .example_results import results_of


@pytest.fixture(scope="module")
def document():
    return document_of(TrialPlan(("fixed", "pr2", "holdfast"), 12), results_of(), 0)


def test_every_law_has_a_line_in_each_part(document):
    for table, n_parts in ((kinds_table, 5), (objects_table, 2)):
        assert len(pivot(table(document)).lines) == 3 * n_parts


def test_parts_without_trials_are_left_out(document):
    assert {line.heads[0] for line in pivot(fingers_table(document)).lines} == {"4"}


def test_differences_are_to_the_named_law(document):
    table = paired_table(document, "fixed")
    assert [line.heads[0] for line in pivot(table).lines] == ["pr2", "holdfast"]
    assert pivot(table).lines[1].cells[0].ours == pytest.approx(-100 * 7 / 11)
