"""Figures of the paper: one finger over one recording, its features and predicted states."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, Phase
from holdfast.plots.style import (
    COMPONENT_COLOURS,
    FONT_SIZE,
    INK,
    STATE_COLOURS,
    add_labels,
    add_legend,
    default_settings,
    literal,
    page_figure,
    style_axes,
)
from holdfast.plots.time_series import (
    FingerSeries,
    StateCodes,
    component_handles,
    draw_components,
    draw_curve,
    draw_sigma,
    equal_spans,
    line_handle,
)
from holdfast.sensors.types import Array

PHASE_COLOURS = {
    Phase.FREE: "#eeeeee",
    Phase.CLOSING: "#fbe3b5",
    Phase.LOCKED: "#c9ead9",
    Phase.DISTURBED: "#cfe6f7",
    Phase.SLIPPING: "#f6cdb6",
    Phase.RELEASED: "#e6d8ec",
}
LETTER_WIDTH = 0.0083
"""Width of a letter of a phase's name, as a fraction of the width of the axes."""
STATE_TITLES = {STABLE: "1: stable", UNSTABLE: "0: not stable", NO_CONTACT: "0: no contact"}
LABEL_STRIP = "label"
AMPLITUDE_COLOUR = COMPONENT_COLOURS["F_a"]
MEAN_COLOUR = "#56b4e9"
PROBABILITY_COLOURS = ("#0072b2", "#d55e00")
"""Colours of P(stable) of the first and the second method."""


@default_settings()
def draw_forces(series: FingerSeries) -> Figure:
    """Draw the components of the fingertip force, with the phases shaded and named.

    The paper's figure of one recording (`pics_force`).
    """
    figure = page_figure(3.1)
    axes = figure.subplots()
    shade_phases(axes, series, named=True)
    draw_components(axes, series)
    add_labels(axes, y=f"fingertip force {series.unit_label}")
    _finish(figure, [axes], series)
    add_legend(figure, component_handles())
    return figure


@default_settings()
def draw_features(series: FingerSeries) -> Figure:
    """Draw force, amplitude, mean, sigma and the label of one experiment.

    The paper's figure of features and labels (`expiriment`).
    """
    figure = page_figure(5.7)
    rows = figure.subplots(4, 1, sharex=True, height_ratios=(1.6, 1.4, 1.1, 0.3))
    for axes in rows[:3]:
        shade_phases(axes, series, named=axes is rows[0])
    draw_components(rows[0], series)
    draw_curve(rows[1], series, series.amplitude, AMPLITUDE_COLOUR)
    draw_curve(rows[1], series, series.mean, MEAN_COLOUR)
    draw_sigma(rows[2], series)
    _draw_strips(rows[3], series, {LABEL_STRIP: series.labels})
    for axes, name in zip(rows, ("$F_{tip}$", "$F_a$, $m$", "$\\sigma$"), strict=False):
        add_labels(axes, y=f"{name} {series.unit_label}")
    _finish(figure, rows, series)
    lines = [line_handle(AMPLITUDE_COLOUR, "$F_a$"), line_handle(MEAN_COLOUR, "$m$")]
    add_legend(figure, [*component_handles(), *lines, *_state_handles([series.labels])])
    return figure


@default_settings()
def draw_experiment(
    series: FingerSeries,
    predicted: Mapping[str, StateCodes],
    stable: Mapping[str, Array],
    span: tuple[float, float] | None = None,
) -> Figure:
    """Draw F_a, sigma, P(stable), the label and predicted states.

    The paper's figures of experiment 1 (a failed grasp) and 2 (locked, disturbed, released).

    Args:
        series: of the finger.
        predicted: by title of the method: (n,) state codes, UNKNOWN without a decision.
        stable: by title of the method: (n,) probability that the contact is stable, or NaN.
        span: the part to show [s]; everything by default.
    """
    strips = {LABEL_STRIP: series.labels, **predicted}
    figure = page_figure(4.7 + 0.3 * len(strips))
    rows = figure.subplots(4, 1, sharex=True, height_ratios=(1.5, 1.1, 0.9, 0.3 * len(strips)))
    for axes in rows[:3]:
        shade_phases(axes, series, named=axes is rows[0])
    draw_curve(rows[0], series, series.amplitude, AMPLITUDE_COLOUR)
    draw_sigma(rows[1], series)
    for values, colour in zip(stable.values(), PROBABILITY_COLOURS, strict=False):
        draw_curve(rows[2], series, values, colour)
    rows[2].set_ylim(-0.05, 1.05)
    _draw_strips(rows[3], series, strips)
    add_labels(rows[0], y=f"$F_a$ {series.unit_label}")
    add_labels(rows[1], y=f"$\\sigma$ {series.unit_label}")
    add_labels(rows[2], y="P(stable)")
    _finish(figure, rows, series)
    if span is not None:
        rows[0].set_xlim(span)
    lines = [line_handle(c, title) for title, c in zip(stable, PROBABILITY_COLOURS, strict=False)]
    add_legend(figure, [*lines, *_state_handles(strips.values())])
    return figure


def _draw_strips(axes: Axes, series: FingerSeries, strips: Mapping[str, StateCodes]) -> None:
    """Draw a coloured strip for each list of states, with its name and accuracy beside it."""
    names = []
    for row, (name, codes) in enumerate(strips.items()):
        spans = list(equal_spans(series.times, codes))
        for state, colour in STATE_COLOURS.items():
            bars = [(start, end - start) for first, start, end in spans if codes[first] == state]
            axes.broken_barh(bars, (row - 0.4, 0.8), facecolors=colour, linewidth=0)
        if name == LABEL_STRIP:
            names.append(name)
            continue
        # Where both are known; samples without a label or without an estimate do not count.
        decided = (series.labels != UNKNOWN) & (codes != UNKNOWN)
        correct = ((series.labels == STABLE) == (codes == STABLE))[decided]
        accuracy = f"{100 * np.mean(correct):.1f} % correct" if decided.any() else "no label"
        names.append(f"{literal(name)}\n{accuracy}")
    axes.set_yticks(range(len(strips)), names)
    axes.set_ylim(len(strips) - 0.5, -0.5)


def _finish(figure: Figure, rows: Sequence[Axes], series: FingerSeries) -> None:
    for axes in rows:
        style_axes(axes)
        if axes.yaxis_inverted():  # strips
            axes.tick_params(axis="y", length=0)
        if len(series.times) > 1:
            axes.set_xlim(series.times[0], series.times[-1])
    add_labels(rows[-1], x="time [s]")
    rows[0].set_title(literal(series.name), fontsize=FONT_SIZE + 0.5, loc="left", pad=14, color=INK)
    figure.align_ylabels([axes for axes in rows if not axes.yaxis_inverted()])
    add_legend(figure, phase_handles(series), "outside lower center")


def _state_handles(strips: Iterable[StateCodes]) -> list[Artist]:
    present = {int(code) for codes in strips for code in np.unique(codes)}
    return [
        Patch(facecolor=colour, label=STATE_TITLES[state])
        for state, colour in STATE_COLOURS.items()
        if state in present
    ]


def shade_phases(axes: Axes, series: FingerSeries, *, named: bool = False) -> None:
    """Shade each phase.

    Args:
        axes: to draw on.
        series: with phases.
        named: write the name above each phase that is wide enough.
    """
    spans = list(equal_spans(series.times, series.phases))
    duration = spans[-1][2] - spans[0][1] if spans else 1.0
    for first, start, end in spans:
        name = str(series.phases[first])
        if not name:
            continue
        axes.axvspan(start, end, facecolor=PHASE_COLOURS[Phase(name)], linewidth=0, zorder=0)
        if named and (end - start) / duration > LETTER_WIDTH * (len(name) + 1):
            axes.annotate(
                name, ((start + end) / 2, 1), xycoords=("data", "axes fraction"),
                xytext=(0, 2), textcoords="offset points", ha="center", fontsize=FONT_SIZE - 0.5,
            )  # fmt: skip


def phase_handles(series: FingerSeries) -> list[Artist]:
    """Return the legend handles of the phases of a series."""
    present = set(series.phases.tolist())
    return [
        Patch(facecolor=colour, label=str(phase))
        for phase, colour in PHASE_COLOURS.items()
        if phase in present
    ]
