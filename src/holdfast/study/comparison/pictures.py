"""Figures of the comparison."""

from collections.abc import Mapping, Sequence

import numpy as np

from holdfast.metrics.events import POSTS
from holdfast.plots.curves import Curve, draw_alarms, draw_reliability
from holdfast.plots.dots import IntervalEstimate, draw_dots, draw_groups
from holdfast.sensors.types import Array
from holdfast.study.comparison import error_tables, sample_tables
from holdfast.study.comparison.jobs import PAPER, SPLITS, Results, found, titles
from holdfast.study.evaluation.alarm_statistics import AlarmStatistics
from holdfast.study.evaluation.evaluate_method import (
    COMPARED_RATE,
    FALSE_ALARM_RATES,
    MethodEvaluation,
)
from holdfast.study.methods import METHODS
from holdfast.study.plan import StudyPlan
from holdfast.study.report.html_report import ReportFigure
from holdfast.study.report.result_tables import Row

DRAWN = (
    "logreg", "zhang", "slip_servo", "anyskin", "jl_global_logreg", "tcn", "trees", "holdfast",
)  # fmt: skip
"""One of each kind: more curves cannot be told apart."""
FEW = ("logreg", "svm", "zhang", "trees", "holdfast")


def pictures(plan: StudyPlan, results: Results) -> list[ReportFigure]:
    """All figures of the comparison."""
    drawn = [
        _methods(plan, results),
        _alarms(plan, results),
        _reliability(plan, results),
        _by_force(plan, results),
        _by_direction(plan, results),
    ]
    return [picture for picture in drawn if picture is not None]


def _methods(plan: StudyPlan, results: Results) -> ReportFigure:
    table = sample_tables.hands(plan, results)
    shown = ("recording", "object", "others")
    groups = {
        f"accuracy of hands,\n{SPLITS[key]} [%]": _estimates(
            [
                row
                for row in table.rows
                if row.keys["on"] == SPLITS[key] and row.keys["figure"] == "accuracy [%]"
            ],
            "method",
        )
        for key in shown
    }
    groups = {head: values for head, values in groups.items() if values}
    strong = [METHODS[name].title for name in (PAPER, "holdfast") if name in METHODS]
    caption = (
        "All methods judged as hands, the task that they have in common. Lines: 95 % intervals, "
        "by bootstrap over recordings."
    )
    return ReportFigure("methods", caption, draw_dots(groups, strong))


def _alarms(plan: StudyPlan, results: Results) -> ReportFigure:
    first = f"{1000 * POSTS[0]:.0f} ms"
    groups: dict[str, dict[str, Curve]] = {
        f"events missed at {first} [%]": {},
        f"slips not found within {first} [%]": {},
    }
    for name, title in _shown(plan, DRAWN).items():
        judged = dict(found(plan, results, name)).get("recording")
        if judged is not None:
            for group, curve in zip(groups.values(), _curves(judged), strict=True):
                group[title] = curve
    caption = (
        "What is missed against what is alarmed in vain, by recording. Thresholds are chosen on "
        "training recordings for false alarms under a stable label of "
        f"{', '.join(f'{rate:g}' for rate in FALSE_ALARM_RATES)} per minute; drawn is what they "
        f"come to on the others. Large marks: chosen for {COMPARED_RATE:g} per minute."
    )
    return ReportFigure("alarms", caption, draw_alarms(groups, bar=COMPARED_RATE))


def _curves(judged: MethodEvaluation) -> tuple[Curve, Curve]:
    """Missed events, and slips not found, over false alarms under a stable label."""
    rates = np.array([_per_minute(heard) for heard in judged.curve])
    missed = [_share(sum(h.n_missed(POSTS[0]) for h in heard), sum(len(h.delays) for h in heard))
              for heard in judged.curve]  # fmt: skip
    found_ = [_share(sum(h.n_found(POSTS[0]) for h in heard), sum(len(h.slips) for h in heard))
              for heard in judged.curve]  # fmt: skip
    chosen = FALSE_ALARM_RATES.index(COMPARED_RATE)
    return (
        Curve(rates, np.array(missed), chosen=chosen),
        Curve(rates, 100 - np.array(found_), chosen=chosen),
    )


def _per_minute(heard: Sequence[AlarmStatistics]) -> float:
    seconds = sum(each.stable_seconds for each in heard)
    return 60 * sum(each.under_stable for each in heard) / seconds if seconds else np.nan


def _share(part: int, whole: int) -> float:
    return 100 * part / whole if whole else np.nan


def _reliability(plan: StudyPlan, results: Results) -> ReportFigure:
    curves, notes = {}, {}
    for name, title in _shown(plan, FEW).items():
        judged = dict(found(plan, results, name)).get("recording")
        if judged is not None:
            curves[title] = _bins(judged)
            brier = judged.metrics.pooled.brier
            notes[title] = "" if brier is None else f"Brier {brier:.3f}"
    caption = (
        "How far probabilities can be believed, by recording. On the dotted line they are right."
    )
    return ReportFigure("reliability", caption, draw_reliability(curves, notes))


def _bins(judged: MethodEvaluation) -> Array:
    """(m, 3) mean probability, share labelled stable and samples of each bin that has any."""
    total = np.array(judged.calibration, dtype=np.float64).sum(axis=0)
    p, stable, n = total[total[:, 2] > 0].T
    return np.column_stack([p / n, stable / n, n])


def _by_force(plan: StudyPlan, results: Results) -> ReportFigure | None:
    table = error_tables.force(plan, results)
    groups = {
        error: _groups(plan, [row for row in table.rows if row.keys["error"] == error], "grip")
        for error in (error_tables.DOUBTED, error_tables.TRUSTED)
    }
    if not any(groups.values()):
        return None
    caption = (
        "Errors by the force of the grip, by recording. The paper holds that it does not matter."
    )
    return ReportFigure("grip", caption, draw_groups(groups, "samples [%]"))


def _by_direction(plan: StudyPlan, results: Results) -> ReportFigure | None:
    table = error_tables.directions(plan, results)
    groups = {"direction of the push": _groups(plan, table.rows, "direction")}
    if not any(groups.values()):
        return None
    caption = (
        "Disturbances called stable, by the direction of the push, by recording. The paper holds "
        "that all directions are found."
    )
    drawn = draw_groups(groups, "disturbed, called stable [%]", per_row=1)
    return ReportFigure("directions", caption, drawn)


def _groups(
    plan: StudyPlan, rows: Sequence[Row], key: str
) -> dict[str, Mapping[str, IntervalEstimate]]:
    """By method, its values by group, out of those judged by recording."""
    own = [row for row in rows if row.keys["on"] == SPLITS["recording"]]
    drawn = {
        title: _estimates([row for row in own if _short(str(row.keys["method"])) == title], key)
        for title in _shown(plan, FEW).values()
    }
    return {title: values for title, values in drawn.items() if values}


def _estimates(rows: Sequence[Row], key: str) -> dict[str, IntervalEstimate]:
    return {
        str(row.keys[key]): IntervalEstimate(row.ours, *(row.interval or (None, None)))
        for row in rows
    }


def _shown(plan: StudyPlan, names: Sequence[str]) -> dict[str, str]:
    """The titles, for legends without what stands in brackets."""
    return {name: _short(title) for name, title in titles(plan).items() if name in names}


def _short(title: str) -> str:
    return title.split(" (", maxsplit=1)[0]
