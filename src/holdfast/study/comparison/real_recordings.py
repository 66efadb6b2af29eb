"""Part of the study: the methods on recordings of a real hand, one left out at a time."""

from typing import Any

from holdfast.metrics import RecordingMetrics
from holdfast.study.comparison.jobs import NETWORK, SLOW, Results, has_network, judging
from holdfast.study.evaluation.evaluate_method import (
    EvaluationEffort,
    EvaluationJob,
    MethodEvaluation,
)
from holdfast.study.evaluation.variation import Variation
from holdfast.study.methods import METHODS
from holdfast.study.plan import Corpus, StudyPlan
from holdfast.study.report.html_report import ReportFigure
from holdfast.study.report.result_tables import ResultTable, Row
from holdfast.study.tasks import Task

MOST_FOLDS = 20
"""Of more recordings, several are left out at a time."""

CAVEAT = (
    "Five recordings of one box, 27 s in all, held by two flat patches of a gripper: slip happens "
    "in two of them, and in those the arm also moves faster, so that slip cannot be told from "
    "speed. The object is already held when they begin: there is no stretch without contact, "
    "the first sample is the tare, and so forces are changes since then. 6 to 9 % of the rows "
    "repeat the row before. Labels are slip, measured by a marker, and rest; there is no contact "
    "lost but in the end of one. An AUC of 0.5 is chance; there is none where a recording has one "
    "class. No figure here is the accuracy on real data."
)


def tasks(plan: StudyPlan) -> list[Task]:
    """A task for each method; none where there are no real recordings."""
    if plan.real is None:
        return []
    return [
        judging(f"real/{name}", _job(plan, plan.real, name))._replace(cost=_cost(name))
        for name in _methods(plan)
    ]


def tables(plan: StudyPlan, results: Results) -> list[ResultTable]:
    """AUC by recording and finger; none where there are no real recordings."""
    if plan.real is None:
        return []
    rows: list[Row] = []
    for name, title in _methods(plan).items():
        judged: MethodEvaluation = results[f"real/{name}"]["recording"]
        for recording in judged.metrics.recordings:
            rows += _rows(title, recording)
    rows.sort(key=lambda row: (str(row.keys["recording"]), str(row.keys["finger"])))
    note = f"Leave one recording out. {CAVEAT}"
    lines = ("recording", "finger", "method")
    digits = {"stable samples": 0, "other samples": 0}
    return [
        ResultTable("real", "Real recordings: AUC", note, rows, lines, digits=2, digits_of=digits)
    ]


def figures(plan: StudyPlan, results: Results) -> list[ReportFigure]:
    """None: five recordings make no curve."""
    del plan, results
    return []


def _rows(title: str, recording: RecordingMetrics) -> list[Row]:
    """Of each finger that has both classes."""
    rows = []
    for finger, metrics in recording.fingers.items():
        if metrics.auc is None:
            continue
        keys: dict[str, Any] = {"recording": recording.name, "finger": finger, "method": title}
        figures = {
            "AUC": metrics.auc,
            "AUC contact": metrics.auc_contact,
            "stable samples": sum(metrics.confusion[1]),
            "other samples": sum(metrics.confusion[0]),
        }
        rows += [Row(keys | {"figure": each}, value) for each, value in figures.items()]
    return rows


def _methods(plan: StudyPlan) -> dict[str, str]:
    left_out = SLOW if plan.quick else () if has_network() else (NETWORK,)
    return {name: each.title for name, each in METHODS.items() if name not in left_out}


def _job(plan: StudyPlan, real: Corpus, name: str) -> EvaluationJob:
    effort = EvaluationEffort(folds=min(len(real.recordings), MOST_FOLDS), inner=2)
    return EvaluationJob(name, real, ("recording",), (), Variation(), effort, plan.seed)


def _cost(name: str) -> float:
    return 120.0 if name == NETWORK else 5.0
