"""Part of the study: the methods on recordings of a real hand, by leaving one recording out."""

from typing import Any

from holdfast.metrics import RecordingMetrics
from holdfast.study.comparison.jobs import (
    NETWORK,
    Results,
    compared_methods,
    evaluation_task,
    method_titles,
)
from holdfast.study.comparison.rows import PERCENT, WITHOUT_ESTIMATE
from holdfast.study.comparison.sample_tables import SAME_SAMPLES_NOTE
from holdfast.study.evaluation.error_breakdown import Count
from holdfast.study.evaluation.evaluate_method import (
    EvaluationEffort,
    EvaluationJob,
    MethodEvaluation,
)
from holdfast.study.evaluation.variation import Variation
from holdfast.study.plan import Corpus, StudyPlan
from holdfast.study.report.html_report import ReportFigure
from holdfast.study.report.result_tables import ResultTable, Row
from holdfast.study.tasks import Task

MAX_FOLDS = 20
"""Maximum number of folds. With more recordings, a fold leaves several out."""

CAVEAT = (
    "Five recordings of one box, 27 s in total, held by two flat patches of a gripper. Slip occurs "
    "in two of them, and in those the arm also moves faster, so slip and speed cannot be "
    "distinguished. The object is already held when the recordings begin: there is no interval "
    "without contact, the first sample is the tare, and forces are changes since then. 6 to 9 % of "
    "the samples repeat the sample before. Labels are slip, measured by a marker, and rest; "
    "contact is lost only at the end of one recording. An AUC of 0.5 is chance; there is no AUC "
    "for a recording of one class. No value here is the accuracy on real data."
)


def tasks(plan: StudyPlan) -> list[Task]:
    """Return a task for each method; none without real recordings."""
    if plan.real is None:
        return []
    return [
        evaluation_task(f"real/{name}", _job(plan, plan.real, name))._replace(cost=_cost(name))
        for name in method_titles(plan)
    ]


def tables(plan: StudyPlan, results: Results) -> list[ResultTable]:
    """Return the table of AUC by recording and finger; none without real recordings."""
    if plan.real is None:
        return []
    rows: list[Row] = []
    for name, title in method_titles(plan).items():
        evaluation: MethodEvaluation = results[f"real/{name}"]["recording"]
        for recording, counts in zip(
            evaluation.metrics.recordings, evaluation.without_estimate, strict=True
        ):
            rows += _recording_rows(title, recording, counts)
    rows.sort(key=lambda row: (str(row.keys["recording"]), str(row.keys["finger"])))
    note = f"Leave one recording out. {SAME_SAMPLES_NOTE} {CAVEAT}"
    lines = ("recording", "finger", "method")
    digits = {"stable samples": 0, "other samples": 0, WITHOUT_ESTIMATE: 1}
    title = "Real recordings: AUC"
    return [ResultTable("real", title, note, rows, lines, digits=2, digits_of=digits)]


def figures(plan: StudyPlan, results: Results) -> list[ReportFigure]:
    """Return no figure: five recordings are too few for a curve."""
    del plan, results
    return []


def _recording_rows(title: str, recording: RecordingMetrics, counts: Count) -> list[Row]:
    """Return the rows of the fingers that have both classes.

    Args:
        title: of the method.
        recording: its metrics.
        counts: labelled samples of all fingers, and those of them without an estimate.
    """
    rows = []
    for finger, metrics in recording.fingers.items():
        if metrics.auc is None:
            continue
        keys: dict[str, Any] = {"recording": recording.name, "finger": finger, "method": title}
        values = {
            "AUC": metrics.auc,
            "AUC contact": metrics.auc_contact,
            "stable samples": sum(metrics.confusion[1]),
            "other samples": sum(metrics.confusion[0]),
            WITHOUT_ESTIMATE: PERCENT * counts[1] / max(counts[0], 1),
        }
        rows += [Row(keys | {"figure": figure}, value) for figure, value in values.items()]
    return rows


def _job(plan: StudyPlan, real: Corpus, name: str) -> EvaluationJob:
    effort = EvaluationEffort(folds=min(len(real.recordings), MAX_FOLDS), inner=2)
    compared = compared_methods(plan)
    return EvaluationJob(name, real, ("recording",), (), Variation(), effort, plan.seed, compared)


def _cost(name: str) -> float:
    return 120.0 if name == NETWORK else 5.0
