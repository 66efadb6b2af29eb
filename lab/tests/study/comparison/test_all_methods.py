import numpy as np
import pytest

from holdfast_lab.report.result_tables import to_json
from holdfast_lab.report.table_layouts import to_markdown
from holdfast_lab.study.comparison import (
    all_methods,
    jobs,
    real_recordings,
    sample_tables,
)
from holdfast_lab.study.comparison.rows import correct_and_all
from holdfast_lab.study.evaluation.evaluate_method import EvaluationEffort
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.plan import StudyPlan
from study.example_recordings import corpora_of, recording_with_truth, results_of

pytestmark = pytest.mark.slow

FEW = ("logreg", "logreg_unweighted", "holdfast", "finger_logreg", "zhang", "jl_global_logreg")
TABLES = (
    "strongest", "methods", "hands", "events", "glitches", "glitch_rates", "splits",
    "reliability",
)  # fmt: skip


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    seeds = {
        "main": range(4),
        "others": range(10, 13),
        "gentle": range(20, 22),
        "glitch-0": range(30, 32),
        "glitch-1": range(40, 42),
    }
    folder = tmp_path_factory.mktemp("comparison")
    return StudyPlan(corpora_of(folder, seeds, recording_with_truth))


@pytest.fixture(scope="module")
def few():
    """Reduce the study to few methods, folds and samples."""
    chosen = {name: METHODS[name] for name in FEW}
    with pytest.MonkeyPatch.context() as patch:
        for module in (jobs, sample_tables, all_methods):
            patch.setattr(module, "METHODS", chosen)
        patch.setattr(
            jobs, "EvaluationEffort", lambda: EvaluationEffort(folds=2, inner=2, max_samples=500)
        )
        yield


@pytest.fixture(scope="module")
def results(plan, few):
    return results_of(all_methods.tasks(plan))


@pytest.fixture(scope="module")
def tables(plan, results):
    return {table.name: table for table in all_methods.tables(plan, results)}


def test_names_of_tasks_are_unique_over_all_parts(plan, few):
    both = StudyPlan(plan.corpora, real=plan.main)
    tasks = [*all_methods.tasks(both), *real_recordings.tasks(both)]
    names = [task.name for task in tasks]
    assert len(set(names)) == len(names)
    assert all(task.cost > 0 for task in tasks)


def test_the_tables_can_be_laid_out(tables):
    assert tuple(tables) == TABLES
    for table in tables.values():
        assert table.rows and table.note
        assert to_markdown(table) and to_json(table)


def accuracy(metrics):
    right, n = np.array(list(correct_and_all(metrics).values())).sum(axis=0)
    return 100 * right / n


def test_the_figures_can_be_drawn(plan, results):
    drawn = all_methods.figures(plan, results)
    assert [each.name for each in drawn] == ["methods", "alarms", "reliability"]
    for each in drawn:
        each.figure.draw_without_rendering()
