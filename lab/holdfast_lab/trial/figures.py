"""Figures of a comparison of laws."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from holdfast.sensors.types import Array
from holdfast_lab.figures.dots import IntervalEstimate, draw_groups
from holdfast_lab.figures.trials import (
    Distribution,
    ForceCourse,
    TradeOff,
    draw_courses,
    draw_distributions,
    draw_trade_offs,
)
from holdfast_lab.report.html_report import ReportFigure
from holdfast_lab.trial.course import TrialCourse
from holdfast_lab.trial.document import GOALS, Results
from holdfast_lab.trial.run import TrialResult
from holdfast_lab.trial.summary import Summary, reaction_time


def distribution_figure(results: Results) -> ReportFigure:
    """Return the distributions of slip and reaction time."""
    slips = {law: _held(each, lambda one: 1e3 * one.slip) for law, each in results.items()}
    times = {
        law: _held(each, lambda one: 1e3 * reaction_time(one)) for law, each in results.items()
    }
    groups = {
        "slip distance [mm]": Distribution(slips, 0.01, 30.0, 1e3 * GOALS["slip_median"]),
        "reaction time after the onset of slip [ms]": Distribution(
            {law: values[~np.isnan(values)] for law, values in times.items()},
            1.0, 1000.0, 1e3 * GOALS["reaction_median"],
        ),
    }  # fmt: skip
    return ReportFigure(
        "distributions",
        "Slip distance and reaction time. Each curve is the share of trials with at most this "
        "value; what is missing to 100 % was dropped, or did not react. On the right, only "
        "trials in which something slipped. Dotted: the goal for the median.",
        draw_distributions(groups),
    )


def trade_off_figure(document: Mapping[str, Any]) -> ReportFigure:
    """Return the share of drops against the force, for all and for unseen objects."""
    groups = {
        "all objects": _trade_offs(document["laws"]),
        "six other objects": _trade_offs(document["unseen_objects"]),
    }
    return ReportFigure(
        "force",
        "Force against drops. A law should be in the shaded corner: few drops with little force. "
        "The force of a law that drops early is low, because it is averaged until the drop.",
        draw_trade_offs(
            groups, "mean force / least force", "dropped [%]",
            (GOALS["force_ratio_mean"], GOALS["dropped"]),
        ),
    )  # fmt: skip


def kinds_figure(document: Mapping[str, Any]) -> ReportFigure:
    """Return the share of drops by kind of load."""
    kinds = document["by_kind"]
    by_law = {
        law: {
            kind: _estimate(kinds[kind][law]["dropped"]) for kind in kinds if kinds[kind][law]["n"]
        }
        for law in document["laws"]
    }
    return ReportFigure(
        "kinds",
        "Drops by kind of load. With 95 % intervals by bootstrap over trials.",
        draw_groups({"kind of load": by_law}, "dropped [%]", per_row=1),
    )


def course_figure(courses: Mapping[str, TrialCourse], what: str) -> ReportFigure:
    """Return force and slip speed over time of the example.

    Args:
        courses: by law.
        what: description of the trial.
    """
    drawn = {
        law: ForceCourse(
            np.array(course.times), np.array(course.force), np.array(course.least),
            np.array(course.slip_speed), course.lost_at,
        )
        for law, course in courses.items()
    }  # fmt: skip
    return ReportFigure(
        "course",
        f"Force over time of one trial. {what} The dashed line is the least force that Coulomb "
        "friction needs at that instant.",
        draw_courses(drawn),
    )


def _held(results: Sequence[TrialResult], value: Callable[[TrialResult], float]) -> Array:
    return np.array([value(result) for result in results if result.held], dtype=np.float64)


def _trade_offs(by_law: Mapping[str, Summary]) -> dict[str, TradeOff]:
    return {
        law: TradeOff(_estimate(summary["force_ratio_mean"]), _estimate(summary["dropped"]))
        for law, summary in by_law.items()
        if summary["n"]
    }


def _estimate(number: Summary) -> IntervalEstimate:
    low, high = number["interval"] or (None, None)
    return IntervalEstimate(number["value"], low, high)
