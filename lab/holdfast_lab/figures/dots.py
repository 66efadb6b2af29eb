"""Figures of single values with intervals: methods compared, errors by group."""

from collections.abc import Collection, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from holdfast.plots import COLOURS
from holdfast.plots.style import (
    FAINT,
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


class IntervalEstimate(NamedTuple):
    """A value and its interval; NaN or None if unknown."""

    value: float | None
    low: float | None = None
    high: float | None = None


@default_settings()
def draw_dots(
    groups: Mapping[str, Mapping[str, IntervalEstimate]], strong: Collection[str] = ()
) -> Figure:
    """Draw a dot with an interval for each method; the highest of the first panel is on top.

    Args:
        groups: by label of a panel's x axis, "accuracy by object [%]": by method, its value.
        strong: methods whose names are bold.
    """
    # By the value in the first panel, the lowest first; those without one are below.
    first: Mapping[str, IntervalEstimate] = next(iter(groups.values()), {})
    names = sorted(
        dict.fromkeys(chain.from_iterable(groups.values())),
        key=lambda name: _number(first[name].value if name in first else None, -np.inf),
        reverse=True,
    )[::-1]  # not ascending at once: of equal values, the first stays on top
    figure = page_figure(0.8 + 0.21 * max(len(names), 3))
    grid = figure.subplots(1, max(len(groups), 1), squeeze=False, sharey=True)[0]
    for axes, (x, values) in zip(grid, groups.items(), strict=False):
        style_axes(axes)
        axes.grid(axis="both", color=FAINT, linewidth=0.5)
        axes.tick_params(axis="y", length=0)
        for row, name in enumerate(names):
            if name in values:
                _draw_dot(axes, row, values[name], bold=name in strong)
        add_labels(axes, x)
    grid[0].set_yticks(range(len(names)), map(literal, names))
    grid[0].set_ylim(-0.7, len(names) - 0.3)
    for name, label in zip(names, grid[0].get_yticklabels(), strict=True):
        label.set_fontweight("bold" if name in strong else "normal")
    return figure


@default_settings()
def draw_groups(
    groups: Mapping[str, Mapping[str, Mapping[str, IntervalEstimate]]], y: str, per_row: int = 2
) -> Figure:
    """Draw the values of several methods side by side in each group, with their intervals.

    Args:
        groups: by label of a panel's x axis, "grip force": by method: by group, its value.
        y: label of the y axes, with its unit.
        per_row: panels in a row.
    """
    figure, grid = panels(len(groups), per_row, 2.6, sharey=True)
    styles = series_styles(chain.from_iterable(groups.values()))
    for k, (axes, (x, methods)) in enumerate(zip(grid, groups.items(), strict=True)):
        names = list(dict.fromkeys(chain.from_iterable(methods.values())))
        axes.grid(axis="y", color=FAINT, linewidth=0.5)
        for rank, (method, values) in enumerate(methods.items()):
            # The methods of a group share 0.7 of its width; the rest parts it from the next.
            shift = 0.7 * ((rank + 0.5) / len(methods) - 0.5)
            at = np.array([names.index(name) for name in values]) + shift
            _draw_intervals(axes, at, list(values.values()), styles[method])
        axes.set_xticks(range(len(names)), map(literal, names))
        axes.set_xlim(-0.5, len(names) - 0.5)
        for edge in range(1, len(names)):
            axes.axvline(edge - 0.5, color=FAINT, linewidth=0.5)
        axes.tick_params(axis="x", length=0)
        add_labels(axes, x, y if k % max(per_row, 1) == 0 else None)
    if grid:
        grid[0].set_ylim(bottom=0)
    add_legend(figure, legend_handles(styles, groups.values(), lines=False), per_row=5)
    return figure


def _draw_dot(axes: Axes, row: int, estimate: IntervalEstimate, *, bold: bool) -> None:
    colour = COLOURS[1] if bold else COLOURS[0]
    value = _number(estimate.value)
    axes.hlines(
        row, _number(estimate.low, value), _number(estimate.high, value), color=colour,
        linewidth=1.3,
    )  # fmt: skip
    axes.plot(value, row, "o", color=colour, markersize=4.5)


def _draw_intervals(
    axes: Axes, x: Array, values: Sequence[IntervalEstimate], style: SeriesStyle
) -> None:
    heights = np.array([_number(value.value) for value in values])
    low = np.array([_number(value.low, value.value) for value in values])
    high = np.array([_number(value.high, value.value) for value in values])
    axes.vlines(x, low, high, color=style.color, linewidth=1.1)
    axes.plot(x, heights, color=style.color, marker=style.marker, linestyle="", markersize=4)


def _number(value: float | None, otherwise: float | None = None) -> float:
    """Return the first of the two that is neither None nor NaN, else NaN."""
    for number in (value, otherwise):
        if number is not None and not np.isnan(number):
            return float(number)
    return float("nan")
