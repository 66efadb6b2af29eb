"""Part of the study: all methods on the same recordings, by sample and by event."""

from collections.abc import Sequence

import numpy as np

from holdfast.metrics.events import POST_DURATIONS
from holdfast_lab.figures.curves import PlottedCurve, draw_alarms, draw_reliability
from holdfast_lab.figures.dots import IntervalEstimate, draw_dots
from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.report.sections import ReportFigure
from holdfast_lab.study.comparison import event_tables, sample_tables, strongest
from holdfast_lab.study.comparison.jobs import (
    DEFAULT_SECONDS,
    METHOD_SECONDS,
    REFERENCE_METHOD,
    SPLIT_TITLES,
    Results,
    method_job,
    method_results,
    method_task,
    method_titles,
    short_titles,
)
from holdfast_lab.study.evaluation.evaluate_method import (
    BY_RATE,
    COMPARED_RATE,
    FALSE_ALARM_RATES,
    MethodEvaluation,
    evaluate_pooled,
)
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.paper.random_split import ConfusionCounts
from holdfast_lab.study.plan import StudyPlan
from holdfast_lab.tasks import Task

TABLES = (
    strongest.table,
    sample_tables.methods,
    sample_tables.hands,
    event_tables.events,
    event_tables.glitches,
    event_tables.glitch_rates,
    sample_tables.splits,
    sample_tables.reliability,
)
"""Functions that make the tables, in their order."""

ALARM_CURVES = (
    "logreg", "zhang", "slip_servo", "anyskin", "jl_global_logreg", "trees", "holdfast",
)  # fmt: skip
"""Methods in the figure of alarms, one of each kind: more curves would be hard to read."""
DETAIL_METHODS = ("logreg", "svm", "zhang", "trees", "holdfast")
"""Methods in the figure of reliability."""


def tasks(plan: StudyPlan) -> list[Task]:
    """Return the evaluation tasks of all methods, and those by a random split."""
    evaluated = [method_task(plan, name) for name in method_titles(plan)]
    pooled = []
    for name in sample_tables.pooled_methods(plan):
        # One split, and no thresholds to choose.
        cost = METHOD_SECONDS.get(name, DEFAULT_SECONDS) / 4
        arguments = (method_job(plan, name),)
        pooled.append(
            Task(f"pooled/{name}", evaluate_pooled, arguments, ConfusionCounts, cost=cost)
        )
    return [*evaluated, *pooled]


def tables(plan: StudyPlan, results: Results) -> list[ResultTable]:
    """Return all tables of the comparison that have rows."""
    made = [make(plan, results) for make in TABLES]
    return [table for table in made if table.rows]


def figures(plan: StudyPlan, results: Results) -> list[ReportFigure]:
    """Return all figures of the comparison."""
    return [
        accuracy_figure(plan, results),
        alarm_figure(plan, results),
        reliability_figure(plan, results),
    ]


def accuracy_figure(plan: StudyPlan, results: Results) -> ReportFigure:
    """Return the accuracy of all methods as hands, on three splits."""
    rows = [
        row
        for row in sample_tables.hands(plan, results).rows
        if row.keys["figure"] == "accuracy [%]"
    ]
    groups = {
        f"accuracy of hands,\n{title} [%]": _estimates(
            [row for row in rows if row.keys["on"] == title], "method"
        )
        for title in (SPLIT_TITLES[key] for key in ("recording", "object", "others"))
    }
    groups = {head: values for head, values in groups.items() if values}
    emphasised = [METHODS[name].title for name in (REFERENCE_METHOD, "holdfast") if name in METHODS]
    caption = (
        "All methods evaluated as hands, the task that they have in common. Lines: 95 % "
        "intervals, by bootstrap over recordings."
    )
    return ReportFigure("methods", caption, draw_dots(groups, emphasised))


def alarm_figure(plan: StudyPlan, results: Results) -> ReportFigure:
    """Return missed events over false alarms under a stable label, by threshold."""
    post = f"{1000 * POST_DURATIONS[0]:.0f} ms"
    chosen = FALSE_ALARM_RATES.index(COMPARED_RATE)
    curves = {}
    for title, evaluation in _by_recording(plan, results, ALARM_CURVES).items():
        rates, missed = [], []
        for alarms in (evaluation.alarms[name] for name in BY_RATE):
            # Sums over the recordings, not means of their rates: most have too few alarms for a
            # rate of their own.
            seconds = sum(alarm.stable_seconds for alarm in alarms)
            n_false = sum(alarm.n_under_stable for alarm in alarms)
            rates.append(60 * n_false / seconds if seconds else np.nan)
            n_events = sum(len(alarm.delays) for alarm in alarms)
            n_missed = sum(alarm.n_missed(POST_DURATIONS[0]) for alarm in alarms)
            missed.append(100 * n_missed / n_events if n_events else np.nan)
        curves[title] = PlottedCurve(np.array(rates), np.array(missed), chosen=chosen)
    caption = (
        "Missed events against false alarms, by recording. Thresholds are chosen on "
        "training recordings for false alarms under a stable label of "
        f"{', '.join(f'{rate:g}' for rate in FALSE_ALARM_RATES)} per minute; the figure shows "
        "the rates that result on the other recordings. Large marks: chosen for "
        f"{COMPARED_RATE:g} per minute. A glitch of the hand's controller is an event here."
    )
    return ReportFigure(
        "alarms", caption, draw_alarms({f"events missed at {post} [%]": curves}, bar=COMPARED_RATE)
    )


def reliability_figure(plan: StudyPlan, results: Results) -> ReportFigure:
    """Return the share of stable samples over the probability, and the Brier scores."""
    # Of each method, (m, 3): mean probability, share of stable samples, samples of each used bin.
    curves, notes = {}, {}
    for title, evaluation in _by_recording(plan, results, DETAIL_METHODS).items():
        total = np.array(evaluation.calibration, dtype=np.float64).sum(axis=0)
        p, stable, n = total[total[:, 2] > 0].T
        curves[title] = np.column_stack([p / n, stable / n, n])
        brier = evaluation.metrics.pooled.brier
        notes[title] = "" if brier is None else f"Brier {brier:.3f}"
    caption = "Reliability of the probabilities, by recording. On the dotted line they are right."
    return ReportFigure("reliability", caption, draw_reliability(curves, notes))


def _estimates(rows: Sequence[Row], key: str) -> dict[str, IntervalEstimate]:
    return {
        str(row.keys[key]): IntervalEstimate(row.ours, *(row.interval or (None, None)))
        for row in rows
    }


def _by_recording(
    plan: StudyPlan, results: Results, names: Sequence[str]
) -> dict[str, MethodEvaluation]:
    """Return the evaluations by recording of some methods, by short title."""
    evaluations = {
        title: dict(method_results(plan, results, name)).get("recording")
        for name, title in short_titles(plan).items()
        if name in names
    }
    return {
        title: evaluation for title, evaluation in evaluations.items() if evaluation is not None
    }
