"""The figure of an evaluation: how good, how sure, how soon."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from holdfast.metrics import (
    Decisions,
    EventMetrics,
    Metrics,
    SampleMetrics,
    calibration_sums,
    match_alarms,
)
from holdfast.metrics.decisions import FingerDecisions
from holdfast.metrics.events import EARLY, POSTS, event_delays
from holdfast.sensors.types import Array

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Told apart by colour-blind people too (Okabe and Ito); beyond six fingers they come again."""
MARKERS = "osD^vP"
HAND_COLOUR = "black"
GREY = "#999999"

N_NAMED = 25
"""Recordings that are named; of more only their number is told."""
LONGEST_NAME = 24
LONGEST_DELAY = 0.5
"""Where the curve of delays ends [s]."""
SMALL = 7


class Style(NamedTuple):
    """How a finger looks in every panel."""

    color: str
    marker: str


def draw_evaluation(metrics: Metrics, judged: Sequence[Decisions]) -> Figure:
    """Accuracy and AUC of each recording, reliability, and delays of alarms.

    Args:
        metrics: of all recordings.
        judged: the decisions that they are about.
    """
    n_rows = len(metrics.recordings) if len(metrics.recordings) <= N_NAMED else N_NAMED // 2
    n_rows = max(4, n_rows)
    figure = Figure(figsize=(9.6, 4.7 + 0.16 * n_rows), dpi=160, layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0 + 0.16 * n_rows, 3.3))
    styles = {
        name: Style(COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)])
        for k, name in enumerate(metrics.fingers)
    }
    left = figure.add_subplot(grid[0, 0])
    right = figure.add_subplot(grid[0, 1], sharey=left)
    _draw_recordings(left, right, metrics, styles)
    _draw_reliability(figure.add_subplot(grid[1, 0]), metrics.pooled, judged, styles)
    _draw_delays(figure.add_subplot(grid[1, 1]), metrics, judged, styles)
    for axes in figure.axes:
        axes.tick_params(labelsize=SMALL)
        axes.spines[["top", "right"]].set_visible(False)
    _add_legend(figure, styles)
    return figure


def calibration(judged: Sequence[FingerDecisions]) -> Array:
    """How often what was given a probability was so.

    Args:
        judged: any fingers.

    Returns:
        (m, 3) for each bin of probabilities that has labelled samples: their mean probability,
        the share of them labelled stable, and their number.
    """
    table = calibration_sums(judged)
    table = table[table[:, 2] > 0]
    table[:, :2] /= table[:, 2:]
    return table


def _draw_recordings(
    left: Axes, right: Axes, metrics: Metrics, styles: Mapping[str, Style]
) -> None:
    """A row for each recording, the best on top, and a dot for each finger."""
    ordered = sorted(metrics.recordings, key=lambda each: _mean(each.fingers, "accuracy"))
    for axes, field in ((left, "accuracy"), (right, "auc")):
        for name, style in styles.items():
            rows = [(k, each.fingers.get(name)) for k, each in enumerate(ordered)]
            dots = [(getattr(m, field), k) for k, m in rows if m and getattr(m, field) is not None]
            x, y = np.array(dots).reshape(-1, 2).T
            axes.scatter(x, y, s=20, alpha=0.85, linewidths=0, **style._asdict())
        value = getattr(metrics.pooled, field)
        if value is not None:
            axes.axvline(value, color=HAND_COLOUR, linewidth=0.8)
        axes.grid(axis="y", color="#eeeeee", linewidth=0.6)
        axes.set_axisbelow(True)
    right.axvline(0.5, color=GREY, linewidth=0.8, linestyle=":")
    left.set_xlim(min(left.get_xlim()[0], 48), 101)
    right.set_xlim(min(right.get_xlim()[0], 0.48), 1.01)
    left.set_xlabel("accuracy [%]", fontsize=SMALL)
    right.set_xlabel("AUC, stable against the rest (dotted: chance)", fontsize=SMALL)
    _add_title(left, "samples right" + _text(metrics.pooled.accuracy, ": {:.1f} % of all"))
    _add_title(
        right, "samples in the right order" + _text(metrics.pooled.auc, ": AUC {:.3f} of all")
    )
    left.set_ylim(-0.7, max(len(ordered), 1) - 0.3)
    right.tick_params(labelleft=False)
    if len(ordered) <= N_NAMED:
        left.set_yticks(range(len(ordered)), [_short(each.name) for each in ordered])
    else:
        left.set_yticks([])
        left.set_ylabel(f"{len(ordered)} recordings, by accuracy", fontsize=SMALL)


def _draw_reliability(
    axes: Axes, pooled: SampleMetrics, judged: Sequence[Decisions], styles: Mapping[str, Style]
) -> None:
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=0.8, linestyle=":")
    for name, style in styles.items():
        found = calibration([each.fingers[name] for each in judged if name in each.fingers])
        axes.plot(found[:, 0], found[:, 1], color=style.color, linewidth=0.8, alpha=0.7)
    every = calibration([finger for each in judged for finger in each.fingers.values()])
    if len(every):
        share = every[:, 2] / every[:, 2].sum()
        axes.bar(every[:, 0], 0.25 * share / share.max(), width=0.06, color="#dddddd", zorder=0)
        axes.plot(every[:, 0], every[:, 1], "o-", color=HAND_COLOUR, linewidth=1.4, markersize=3)
    axes.set(xlim=(-0.03, 1.03), ylim=(0, 1.02))
    axes.set_xlabel("probability of stability that was given", fontsize=SMALL)
    axes.set_ylabel("share that was labelled stable", fontsize=SMALL)
    _add_title(
        axes, "reliability" + _text(pooled.brier, ": Brier score {:.3f}") + " (bars: samples)"
    )


def _draw_delays(
    axes: Axes, metrics: Metrics, judged: Sequence[Decisions], styles: Mapping[str, Style]
) -> None:
    """The share of events that were told, by the time since their onset."""
    for post in POSTS:
        axes.axvline(post, color=GREY, linewidth=0.8, linestyle=":")
    for name, style in styles.items():
        fingers = [each.fingers[name] for each in judged if name in each.fingers]
        _draw_curve(axes, fingers, color=style.color, linewidth=0.9, alpha=0.8)
    hands = [each.hand for each in judged if each.hand is not None]
    _draw_curve(axes, hands, color=HAND_COLOUR, linewidth=1.8, alpha=1.0)
    axes.set(xlim=(-EARLY, LONGEST_DELAY), ylim=(0, 1.02))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.set_xlabel("time since the onset [s]", fontsize=SMALL)
    axes.set_ylabel("events with an alarm by then", fontsize=SMALL)
    _add_title(axes, _events_title(metrics.events.hand))


def _draw_curve(
    axes: Axes, judged: Sequence[FingerDecisions], *, color: str, linewidth: float, alpha: float
) -> None:
    matches = [match_alarms(each.times, each.labels, each.states) for each in judged]
    delays = event_delays(matches)
    if not len(delays):
        return
    told = delays[delays <= LONGEST_DELAY]
    times = np.concatenate([[-EARLY], told, [LONGEST_DELAY]])
    share = np.concatenate([[0], np.arange(1, len(told) + 1), [len(told)]]) / len(delays)
    axes.step(times, share, where="post", color=color, linewidth=linewidth, alpha=alpha)


def _events_title(hand: EventMetrics) -> str:
    if not hand.n_events:
        return "alarms of the hand: no event in the labels"
    rate = _text(hand.false_alarms_per_minute, ", {:.1f} false alarms/min")
    return f"alarms of the hand: {hand.n_events} event{'s' * (hand.n_events > 1)}{rate}"


def _add_legend(figure: Figure, styles: Mapping[str, Style]) -> None:
    dots = [
        figure.axes[0].plot(
            [], [], linestyle="-", linewidth=0.9, markersize=4, label=name, **style._asdict()
        )[0]
        for name, style in styles.items()
    ]
    whole = figure.axes[0].plot([], [], color=HAND_COLOUR, label="all samples, or the hand")
    figure.legend(
        handles=[*dots, *whole], loc="outside upper center", ncols=min(len(dots) + 1, 8),
        fontsize=SMALL, frameon=False,
    )  # fmt: skip


def _add_title(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=8, loc="left")


def _mean(fingers: Mapping[str, SampleMetrics], field: str) -> float:
    values = [getattr(each, field) for each in fingers.values()]
    return float(np.mean([v for v in values if v is not None] or [-1.0]))


def _short(name: str) -> str:
    """The end of a long name: names of recordings begin alike."""
    return name if len(name) <= LONGEST_NAME else f"…{name[1 - LONGEST_NAME :]}"


def _text(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)
