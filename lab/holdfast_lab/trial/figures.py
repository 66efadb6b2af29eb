"""Figures of a comparison of laws: distributions, force against drops, force over time."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from holdfast.plots import COLOURS
from holdfast.plots.style import (
    FAINT,
    FONT_SIZE,
    GREY,
    INK,
    SeriesStyle,
    add_labels,
    add_legend,
    add_title,
    default_settings,
    panels,
    series_styles,
)
from holdfast.sensors.types import Array
from holdfast_lab.figures.dots import IntervalEstimate, draw_groups
from holdfast_lab.figures.legends import legend_handles
from holdfast_lab.report.sections import ReportFigure
from holdfast_lab.trial.course import TrialCourse
from holdfast_lab.trial.document import GOALS, TrialResults
from holdfast_lab.trial.run import TrialResult
from holdfast_lab.trial.summary import Summary, reaction_time


class Distribution(NamedTuple):
    """Values of each series, of which some may be infinite.

    Attributes:
        values: by series, (n,) values of at least 0; an infinite one is above every value.
        floor: value at the left end of the axis, which is marked 0; lower ones are drawn there.
        limit: value at the right end.
        goal: value to mark by a dotted line; None for none.
    """

    values: Mapping[str, Array]
    floor: float
    limit: float
    goal: float | None = None


@default_settings()
def draw_distributions(groups: Mapping[str, Distribution]) -> Figure:
    """Draw which share of all values is at most x, as steps over a logarithmic x.

    A curve that ends below 100 % has values beyond the right end, or infinite ones.

    Args:
        groups: by label of a panel's x axis, with its unit.
    """
    figure, grid = panels(len(groups), 2, 2.6, sharey=True)
    styles = series_styles(name for group in groups.values() for name in group.values)
    for axes, (x, group) in zip(grid, groups.items(), strict=True):
        axes.set_xscale("log")
        axes.set_xlim(group.floor * 0.9, group.limit)
        axes.grid(color=FAINT, linewidth=0.5)
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(
            FuncFormatter(
                lambda value, _, floor=group.floor: "0" if value <= floor * 1.01 else f"{value:g}"
            )
        )
        if group.goal is not None:
            axes.axvline(group.goal, color=GREY, linewidth=0.9, linestyle=":")
        for name, values in group.values.items():
            _draw_steps(axes, values, group, styles[name])
        add_labels(axes, x)
    if grid:
        grid[0].set_ylim(-2, 102)
        add_labels(grid[0], y="share of trials [%]")
    handles = legend_handles(styles, [group.values for group in groups.values()])
    for handle in handles:  # steps have no marks
        handle.set_marker("")
    add_legend(figure, handles, per_row=6)
    return figure


class TradeOff(NamedTuple):
    """Two values of a series, with their intervals."""

    x: IntervalEstimate
    y: IntervalEstimate


@default_settings()
def draw_trade_offs(
    groups: Mapping[str, Mapping[str, TradeOff]], x: str, y: str, goal: tuple[float, float]
) -> Figure:
    """Draw one value against another for each series, with both intervals.

    Args:
        groups: by title of a panel: by series, its two values.
        x: label of the x axes.
        y: label of the y axes.
        goal: largest x and y of the area that is shaded.
    """
    figure, grid = panels(len(groups), 2, 2.8, sharey=True)
    # One scale, so that the shaded area has the same size in all panels.
    for axes in grid[1:]:
        axes.sharex(grid[0])
    styles = series_styles(name for group in groups.values() for name in group)
    for axes, (title, group) in zip(grid, groups.items(), strict=True):
        axes.grid(color=FAINT, linewidth=0.5)
        axes.fill_between([0, goal[0]], 0, goal[1], color=COLOURS[2], alpha=0.15, linewidth=0)
        for name, values in group.items():
            at, drops = values
            if at.value is None or drops.value is None:
                continue
            color, marker, _ = styles[name]
            if at.low is not None and at.high is not None:
                axes.hlines(drops.value, at.low, at.high, color=color, linewidth=1.1)
            if drops.low is not None and drops.high is not None:
                axes.vlines(at.value, drops.low, drops.high, color=color, linewidth=1.1)
            axes.plot(at.value, drops.value, color=color, marker=marker, markersize=5, linestyle="")
        axes.set_ylim(-3, 103)
        axes.set_xlim(left=0.9)
        add_title(axes, title)
        add_labels(axes, x)
    if grid:
        add_labels(grid[0], y=y)
        grid[0].set_xlim(right=max(axes.get_xlim()[1] for axes in grid))
    add_legend(figure, legend_handles(styles, groups.values(), lines=False), per_row=6)
    return figure


@default_settings()
def draw_courses(courses: Mapping[str, TrialCourse]) -> Figure:
    """Draw force and slip speed over time, one column for each series.

    Args:
        courses: by title of a column.
    """
    figure, grid = panels(2 * len(courses), len(courses), 1.7)
    upper, lower = grid[: len(courses)], grid[len(courses) :]
    for (title, course), force, slip in zip(courses.items(), upper, lower, strict=True):
        add_title(force, title)
        add_labels(slip, "time since the load began [s]")
        for axes in (force, slip):
            axes.grid(color=FAINT, linewidth=0.5)
            axes.axvline(0, color=GREY, linewidth=0.9, linestyle=":")
        times, speed = course.times, 1e3 * np.array(course.slip_speed)
        force.plot(times, course.force, color=COLOURS[0], linewidth=1.1, label="force of the hand")
        force.plot(
            times, course.least, color=INK, linewidth=0.9, linestyle="--", label="least force"
        )
        slip.plot(times, speed, color=COLOURS[1], linewidth=0.9)
        for axes in (force, slip):
            if course.lost_at is not None:
                axes.axvline(course.lost_at, color=COLOURS[1], linewidth=1.0)
                axes.annotate(
                    "lost", (course.lost_at, 0.97), xycoords=("data", "axes fraction"),
                    xytext=(3, 0), textcoords="offset points", va="top", fontsize=FONT_SIZE,
                    color=COLOURS[1],
                )  # fmt: skip
    # The panels of a row have the same limits, so that the laws can be compared.
    for row in (upper, lower) if courses else ():
        right = max(axes.get_xlim()[1] for axes in row)
        left = min(axes.get_xlim()[0] for axes in row)
        top = max(axes.get_ylim()[1] for axes in row)
        for axes in row:
            axes.set(xlim=(left, right), ylim=(0, top))
    if courses:
        add_labels(upper[0], y="normal force, sum [N]")
        add_labels(lower[0], y="slip speed [mm/s]")
        add_legend(figure, upper[0].get_legend_handles_labels()[0])
    return figure


def _draw_steps(axes: Axes, values: Array, group: Distribution, style: SeriesStyle) -> None:
    if not len(values):
        return
    # Shares of all values: infinite ones keep the curve below 100 %.
    finite = np.sort(np.maximum(values[np.isfinite(values)], group.floor))
    shares = 100 * np.arange(len(finite) + 1) / len(values)
    x = np.concatenate([[group.floor * 0.9], finite, [group.limit]])
    axes.step(
        x, [*shares, shares[-1]], where="post", color=style.color, linestyle=style.linestyle,
        linewidth=1.2,
    )  # fmt: skip


def distribution_figure(results: TrialResults) -> ReportFigure:
    """Return the distributions of slip and reaction time."""
    slips = {law: _held(trials, lambda trial: 1e3 * trial.slip) for law, trials in results.items()}
    times = {
        law: _held(trials, lambda trial: 1e3 * reaction_time(trial))
        for law, trials in results.items()
    }
    groups = {
        "slip distance [mm]": Distribution(slips, 0.01, 30.0, 1e3 * GOALS["slip_p90"]),
        "reaction time after the onset of slip [ms]": Distribution(
            {law: values[~np.isnan(values)] for law, values in times.items()},
            1.0, 1000.0, 1e3 * GOALS["friction_reaction_median"],
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
    return ReportFigure(
        "course",
        f"Force over time of one trial. {what} The dashed line is the least force that Coulomb "
        "friction needs at that instant.",
        draw_courses(courses),
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
