"""Figures of curves: over a parameter, over thresholds, over probabilities."""

from collections.abc import Mapping
from itertools import chain
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from holdfast.plots.style import (
    FAINT,
    FONT_SIZE,
    GREY,
    SeriesStyle,
    add_labels,
    add_legend,
    default_settings,
    literal,
    page_figure,
    panels,
    series_styles,
    style_axes,
)
from holdfast.sensors.types import Array
from holdfast_lab.figures.legends import legend_handles

MAX_TICKS = 9
"""Maximum number of values of x that all get a tick."""


class PlottedCurve(NamedTuple):
    """Values over a parameter.

    Attributes:
        x: (k,) values of the parameter.
        y: (k,) values; NaN if unknown.
        low: (k,) lower ends of their intervals; None without intervals.
        high: (k,) upper ends.
        chosen: index of the point that is in use; it is drawn larger.
    """

    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None
    chosen: int | None = None


@default_settings()
def draw_lines(groups: Mapping[str, Mapping[str, PlottedCurve]], x: str, *, per_row: int) -> Figure:
    """Draw the curves of several methods with bands of their intervals, in panels.

    A curve called "the paper" is black and dashed.

    Args:
        groups: by label of a panel's y axis with its unit: by method, its curve.
        x: label of the x axis, with its unit.
        per_row: panels in a row.
    """
    figure, grid = panels(len(groups), per_row, 2.3)
    styles = series_styles(chain.from_iterable(groups.values()))
    for axes, (y, curves) in zip(grid, groups.items(), strict=True):
        axes.grid(color=FAINT, linewidth=0.5)
        for name, curve in curves.items():
            _draw_curve(axes, curve, styles[name])
        # Few values of x all get a tick.
        values = sorted({float(value) for curve in curves.values() for value in curve.x})
        if 0 < len(values) <= MAX_TICKS:
            axes.set_xticks(values, [f"{value:g}" for value in values])
            axes.xaxis.set_minor_locator(NullLocator())
        add_labels(axes, x, y)
    add_legend(figure, legend_handles(styles, groups.values()), per_row=5)
    return figure


@default_settings()
def draw_alarms(
    groups: Mapping[str, Mapping[str, PlottedCurve]],
    x: str = "false alarms per minute of stable label",
    bar: float | None = None,
) -> Figure:
    """Draw the missed fraction, or the delay, over the rate of false alarms.

    The x axis is logarithmic. A rate of zero is drawn at its left end, which is marked 0.
    Infinite delays are not drawn.

    Args:
        groups: by label of a panel's y axis, "missed within 0.05 s [%]": by method, a curve
            over thresholds; `chosen` is the threshold in use.
        x: label of the x axis.
        bar: a rate to mark by a dotted line.
    """
    figure, grid = panels(len(groups), 3, 2.8)
    styles = series_styles(chain.from_iterable(groups.values()))
    # The x at which a rate of zero is drawn: well below the smallest rate.
    rates = (curve.x for curves in groups.values() for curve in curves.values())
    positive = [rate[np.isfinite(rate) & (rate > 0)] for rate in rates]
    smallest = min((float(rate.min()) for rate in positive if len(rate)), default=1.0)
    floor = float(10 ** np.floor(np.log10(smallest) - 0.3))
    for axes, (y, curves) in zip(grid, groups.items(), strict=True):
        # A logarithmic axis has no 0: `floor` stands for it, and is labelled 0.
        axes.set_xscale("log")
        axes.grid(color=FAINT, linewidth=0.5)
        if bar is not None:
            axes.axvline(bar, color=GREY, linewidth=0.9, linestyle=":")
        axes.xaxis.set_major_formatter(
            FuncFormatter(lambda rate, _: "0" if rate <= floor * 1.01 else f"{rate:g}")
        )
        axes.xaxis.set_minor_locator(NullLocator())
        for name, curve in curves.items():
            finite = np.where(np.isfinite(curve.y), curve.y, np.nan)
            drawn = curve._replace(x=np.maximum(curve.x, floor), y=finite)
            _draw_curve(axes, drawn, styles[name], dots=False)
        axes.set_xlim(left=floor * 0.8)
        axes.set_ylim(bottom=0)
        add_labels(axes, x if len(grid) < 3 else x.replace(" of stable", "\nof stable"), y)
    add_legend(figure, legend_handles(styles, groups.values()), per_row=5)
    return figure


@default_settings()
def draw_reliability(curves: Mapping[str, Array], notes: Mapping[str, str] | None = None) -> Figure:
    """Draw the fraction labelled stable over the probability; below, the number of samples.

    Args:
        curves: by method: (m, 3) mean probability, fraction labelled stable and number of
            samples of each bin, as `holdfast.plots.evaluation.calibration` returns them.
        notes: by method, added to its name: "Brier 0.041".
    """
    figure = page_figure(4.6)
    axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(3.2, 1))
    styles = series_styles(curves)
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=0.9, linestyle=":")
    for name, table in curves.items():
        style = styles[name]
        look = style._asdict()
        axes.plot(table[:, 0], table[:, 1], linewidth=1.1, markersize=4, **look)
        share = 100 * table[:, 2] / max(table[:, 2].sum(), 1)
        below.plot(table[:, 0], share, linewidth=0.9, markersize=3, **look)
    axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
    below.set_yscale("log")
    for panel in (axes, below):
        style_axes(panel)
        panel.grid(color=FAINT, linewidth=0.5)
    add_labels(axes, y="fraction labelled stable")
    add_labels(below, "probability of stability", "samples [%]")
    handles = legend_handles({name: styles[name] for name in curves}, [curves])
    for handle, name in zip(handles, curves, strict=True):
        handle.set_label(literal(", ".join(filter(None, (name, (notes or {}).get(name))))))
    axes.legend(handles=handles, loc="upper left", fontsize=FONT_SIZE, frameon=False)
    return figure


def _draw_curve(axes: Axes, curve: PlottedCurve, style: SeriesStyle, *, dots: bool = True) -> None:
    color, marker, dashes = style
    axes.plot(
        curve.x, curve.y, color=color, marker=marker if dots else "", linestyle=dashes,
        linewidth=1.1, markersize=3.5,
    )  # fmt: skip
    if curve.low is not None and curve.high is not None:
        axes.fill_between(curve.x, curve.low, curve.high, color=color, alpha=0.13, linewidth=0)
    if curve.chosen is not None:
        # Above all curves and over the edge of the panel, so that no other mark hides it.
        axes.plot(
            curve.x[curve.chosen], curve.y[curve.chosen], color=color, marker=marker,
            markersize=6, markeredgecolor="white", markeredgewidth=0.7, clip_on=False, zorder=4,
        )  # fmt: skip
