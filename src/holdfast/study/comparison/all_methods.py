"""Part of the study: all methods on the same recordings, by sample, by event, by circumstance."""

from holdfast.study.comparison import costs, error_tables, event_tables, sample_tables
from holdfast.study.comparison import pictures as drawn
from holdfast.study.comparison.jobs import SECONDS, USUAL, Results, job_of, task_of, titles
from holdfast.study.comparison.pooled_split import judge_pooled
from holdfast.study.paper.random_split import ConfusionCounts
from holdfast.study.plan import StudyPlan
from holdfast.study.report.html_report import ReportFigure
from holdfast.study.report.result_tables import ResultTable
from holdfast.study.tasks import Task

MAKERS = (
    sample_tables.methods,
    sample_tables.hands,
    event_tables.events,
    event_tables.slips,
    sample_tables.splits,
    error_tables.phases,
    error_tables.force,
    error_tables.directions,
    sample_tables.reliability,
    costs.table,
)


def tasks(plan: StudyPlan) -> list[Task]:
    """A task for each method, one for each that is also judged by a random split, and the costs."""
    judged = [task_of(plan, name) for name in titles(plan)]
    pooled = [_pooled(plan, name) for name in sample_tables.leaking(plan)]
    return [*judged, *pooled, *costs.tasks(plan)]


def tables(plan: StudyPlan, results: Results) -> list[ResultTable]:
    """The methods side by side."""
    return [make(plan, results) for make in MAKERS]


def figures(plan: StudyPlan, results: Results) -> list[ReportFigure]:
    """The same as figures."""
    return drawn.pictures(plan, results)


def _pooled(plan: StudyPlan, name: str) -> Task:
    cost = SECONDS.get(name, USUAL) / 4
    return Task(f"pooled/{name}", judge_pooled, (job_of(plan, name),), ConfusionCounts, cost=cost)
