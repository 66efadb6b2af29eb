"""Figures of curves: over what was varied, over thresholds, over probabilities."""

from collections.abc import Iterable, Mapping
from itertools import chain
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from holdfast.plots.style import (
    FAINT,
    GREY,
    SMALL,
    SeriesStyle,
    add_labels,
    add_legend,
    handles_of,
    panels,
    sheet,
    styles_of,
    tidy,
)
from holdfast.sensors.types import Array

MOST_TICKS = 9
"""Values of x that are all named on the axis."""


class Curve(NamedTuple):
    """Values over something that was varied.

    Attributes:
        x: (k,) what was varied.
        y: (k,) values; NaN where there is none.
        low: (k,) lower ends of their intervals; None without.
        high: (k,) upper ends.
        chosen: index of the point that is in use; it is drawn larger.
    """

    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None
    chosen: int | None = None


def draw_lines(
    groups: Mapping[str, Mapping[str, Curve]], x: str, *, log: bool = False, per_row: int = 3
) -> Figure:
    """Curves of several methods with bands of their intervals, one panel for each figure.

    For sensitivity (noise, margin, rate) and for the window sweep beside the paper's: a curve
    called "the paper" is drawn black and dashed.

    Args:
        groups: by the label of the panel's y axis with its unit: by method, its curve.
        x: label of the x axis, with its unit.
        log: whether x is logarithmic.
        per_row: panels beside each other.
    """
    figure, grid = panels(len(groups), per_row, 2.3)
    styles = styles_of(chain.from_iterable(groups.values()))
    for axes, (y, curves) in zip(grid, groups.items(), strict=True):
        if log:
            axes.set_xscale("log")
        axes.grid(color=FAINT, linewidth=0.5)
        for name, curve in curves.items():
            _draw_curve(axes, curve, styles[name])
        _name_values(axes, curves.values(), log)
        add_labels(axes, x, y)
    add_legend(figure, handles_of(styles, groups.values()), per_row=5)
    return figure


def draw_alarms(
    groups: Mapping[str, Mapping[str, Curve]],
    x: str = "false alarms per minute of stable label",
    bar: float | None = None,
) -> Figure:
    """What a method misses, or how late it is, against how often it alarms in vain.

    The x axis is logarithmic; no false alarm at all is drawn at its left end, marked 0. What
    does not end (an infinite delay) is not drawn.

    Args:
        groups: by the label of the panel's y axis, "missed within 0.05 s [%]": by method, a
            curve over thresholds; `chosen` is the threshold in use.
        x: label of the x axis.
        bar: a rate to mark by a dotted line.
    """
    figure, grid = panels(len(groups), 3, 2.8)
    styles = styles_of(chain.from_iterable(groups.values()))
    every = [curve.x for curves in groups.values() for curve in curves.values()]
    floor = _floor(every)
    for axes, (y, curves) in zip(grid, groups.items(), strict=True):
        axes.set_xscale("log")
        axes.grid(color=FAINT, linewidth=0.5)
        if bar is not None:
            axes.axvline(bar, color=GREY, linewidth=0.9, linestyle=":")
        for name, curve in curves.items():
            shown = np.where(np.isfinite(curve.y), curve.y, np.nan)
            _draw_curve(
                axes,
                curve._replace(x=np.maximum(curve.x, floor), y=shown),
                styles[name],
                dots=False,
            )
        axes.xaxis.set_major_formatter(
            FuncFormatter(lambda rate, _: "0" if rate <= floor * 1.01 else f"{rate:g}")
        )
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlim(left=floor * 0.8)
        axes.set_ylim(bottom=0)
        add_labels(axes, x if len(grid) < 3 else x.replace(" of stable", "\nof stable"), y)
    add_legend(figure, handles_of(styles, groups.values()), per_row=5)
    return figure


def draw_reliability(curves: Mapping[str, Array], notes: Mapping[str, str] | None = None) -> Figure:
    """How often what was given a probability was so, of several methods; below, how many.

    Args:
        curves: by method: (m, 3) mean probability, share labelled stable and number of samples
            of each bin, as `holdfast.plots.evaluation.calibration` gives them.
        notes: by method, added to its name: "Brier 0.041".
    """
    figure = sheet(4.6)
    axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(3.2, 1))
    styles = styles_of(curves)
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=0.9, linestyle=":")
    for name, table in curves.items():
        color, marker, dashes = styles[name]
        axes.plot(
            table[:, 0], table[:, 1], color=color, marker=marker, linestyle=dashes,
            linewidth=1.1, markersize=4,
        )  # fmt: skip
        share = 100 * table[:, 2] / max(table[:, 2].sum(), 1)
        below.plot(
            table[:, 0], share, color=color, marker=marker, linestyle=dashes, linewidth=0.9,
            markersize=3,
        )  # fmt: skip
    axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
    below.set_yscale("log")
    for each in (axes, below):
        tidy(each)
        each.grid(color=FAINT, linewidth=0.5)
    add_labels(axes, y="share that was labelled stable")
    add_labels(below, "probability of stability that was given", "samples [%]")
    handles = handles_of({name: styles[name] for name in curves}, [curves])
    for handle, name in zip(handles, curves, strict=True):
        handle.set_label(", ".join(filter(None, (name, (notes or {}).get(name)))))
    axes.legend(handles=handles, loc="upper left", fontsize=SMALL, frameon=False)
    return figure


def _draw_curve(axes: Axes, curve: Curve, style: SeriesStyle, *, dots: bool = True) -> None:
    color, marker, dashes = style
    axes.plot(
        curve.x, curve.y, color=color, marker=marker if dots else "", linestyle=dashes,
        linewidth=1.1, markersize=3.5,
    )  # fmt: skip
    if curve.low is not None and curve.high is not None:
        axes.fill_between(curve.x, curve.low, curve.high, color=color, alpha=0.13, linewidth=0)
    if curve.chosen is not None:
        axes.plot(
            curve.x[curve.chosen], curve.y[curve.chosen], color=color, marker=marker,
            markersize=6, markeredgecolor="white", markeredgewidth=0.7, clip_on=False, zorder=4,
        )  # fmt: skip


def _name_values(axes: Axes, curves: Iterable[Curve], log: bool) -> None:
    """Names the values that were tried, where they are few; a log axis in plain numbers."""
    values = sorted({float(value) for curve in curves for value in curve.x})
    if 0 < len(values) <= MOST_TICKS:
        axes.set_xticks(values, [f"{value:g}" for value in values])
        axes.xaxis.set_minor_locator(NullLocator())
    elif log:
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _floor(rates: Iterable[Array]) -> float:
    """Where no false alarm at all is drawn: well below the smallest rate."""
    positive = [rate[np.isfinite(rate) & (rate > 0)] for rate in rates]
    smallest = min((float(rate.min()) for rate in positive if len(rate)), default=1.0)
    return float(10 ** np.floor(np.log10(smallest) - 0.3))
