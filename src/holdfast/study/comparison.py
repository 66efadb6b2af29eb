"""Part of the study: all methods on the same recordings, by sample, by event, by circumstance."""

from holdfast.study import (
    alarms_compared,
    comparison_pictures,
    costs,
    errors_compared,
    methods_compared,
)
from holdfast.study.counts import Counts
from holdfast.study.jobs import SECONDS, USUAL, Results, job_of, task_of, titles
from holdfast.study.leak import judge_pooled
from holdfast.study.plan import Plan
from holdfast.study.report import Picture
from holdfast.study.tables import Table
from holdfast.study.work import Task

MAKERS = (
    methods_compared.methods,
    methods_compared.hands,
    alarms_compared.events,
    alarms_compared.slips,
    methods_compared.splits,
    errors_compared.phases,
    errors_compared.force,
    errors_compared.directions,
    methods_compared.reliability,
    costs.table,
)


def tasks(plan: Plan) -> list[Task]:
    """A task for each method, one for each that is also judged by a random split, and the costs."""
    judged = [task_of(plan, name) for name in titles(plan)]
    pooled = [_pooled(plan, name) for name in methods_compared.leaking(plan)]
    return [*judged, *pooled, *costs.tasks(plan)]


def tables(plan: Plan, results: Results) -> list[Table]:
    """The methods side by side."""
    return [make(plan, results) for make in MAKERS]


def pictures(plan: Plan, results: Results) -> list[Picture]:
    """The same as figures."""
    return comparison_pictures.pictures(plan, results)


def _pooled(plan: Plan, name: str) -> Task:
    cost = SECONDS.get(name, USUAL) / 4
    return Task(f"pooled/{name}", judge_pooled, (job_of(plan, name),), Counts, cost=cost)
