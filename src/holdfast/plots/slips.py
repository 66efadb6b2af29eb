"""Panels about slips: share found over time, false alarms, and decisions beside the truth."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FormatStrFormatter, MaxNLocator, PercentFormatter

from holdfast.contact import SLIP_CODE, SLIP_SPEED
from holdfast.detection import Model, detect
from holdfast.metrics import Decisions
from holdfast.metrics.masks import Mask, runs
from holdfast.metrics.slip_curves import SlipSummary
from holdfast.metrics.slips import FOUND_WITHIN, SlipCounts, SlipMetrics, count_slips
from holdfast.metrics.truth_labels import ORIGINS
from holdfast.plots import COLOURS
from holdfast.plots.style import (
    FAINT,
    FONT_SIZE,
    GREY,
    INK,
    add_labels,
    add_title,
    literal,
)
from holdfast.plots.time_series import FingerSeries, draw_line
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

DELAY_LIMITS = (-0.1, 0.3)
"""Limits of the axis of the delays of slips [s]."""
SLIP_COLOUR = COLOURS[4]
"""Colour of what is decided to slide."""
DECIDED_ALPHA = 0.5
MM_PER_M = 1e3


class SlipDecisionSeries(NamedTuple):
    """Decisions about the slips of one finger over time.

    Attributes:
        times: (n,) [s].
        probability: (n,) of a slip; NaN without an estimate.
        raised: (n,) True where the finger is decided to slide.
        threshold: of the probability.
    """

    times: Array
    probability: Array
    raised: Mask
    threshold: float


def slip_series(model: Model, recording: Recording) -> dict[str, SlipDecisionSeries]:
    """Return the decisions of a model about the slips of each finger that has a slip rule.

    Raises:
        ModelError: the recording has other fingers or sensors.
    """
    series: dict[str, SlipDecisionSeries] = {}
    for name, trace in detect(model, recording).fingers.items():
        head = model.finger(name, recording.modules[name].sensor).slip
        if head is None or trace.slip_probability is None:
            continue
        series[name] = SlipDecisionSeries(
            trace.times, trace.slip_probability, trace.cause == SLIP_CODE, head.threshold
        )
    return series


def draw_slip_speed(axes: Axes, series: FingerSeries) -> None:
    """Draw the speed of a finger over its object, by the truth."""
    if series.slip is None:
        axes.set_yticks([])
        axes.text(
            0.5, 0.5, "slip not known", transform=axes.transAxes, fontsize=FONT_SIZE, color=INK,
            ha="center", va="center",
        )  # fmt: skip
        return
    times, speed = series.slip
    draw_line(axes, times, MM_PER_M * speed)
    add_labels(axes, y="slip [mm/s]")
    axes.set_ylim(bottom=0)


def draw_slip_decisions(
    speed: Axes | None, probability: Axes, decisions: SlipDecisionSeries | None
) -> None:
    """Draw the probability of a slip, its threshold, and shades where the finger slides.

    Args:
        speed: of the slip by the truth; is shaded too.
        probability: to draw on.
        decisions: about the finger; None without a slip rule.
    """
    add_labels(probability, y="p(slip)")
    probability.set_ylim(0, 1.02)
    if decisions is None:
        probability.set_yticks([])
        probability.text(
            0.5, 0.5, "no slip rule", transform=probability.transAxes, fontsize=FONT_SIZE,
            color=INK, ha="center", va="center",
        )  # fmt: skip
        return
    draw_line(probability, decisions.times, decisions.probability, INK, 0.8)
    probability.axhline(decisions.threshold, color=GREY, linewidth=0.8, linestyle="--", zorder=1)
    if speed is not None and speed.get_yticks().size:
        # Linear below the limit of a slip, so that creep and fast slides are both seen.
        speed.set_yscale("symlog", linthresh=MM_PER_M * SLIP_SPEED)
        speed.yaxis.set_major_formatter(FormatStrFormatter("%g"))
        speed.axhline(MM_PER_M * SLIP_SPEED, color=GREY, linewidth=0.8, linestyle="--", zorder=1)
    for axes in filter(None, (speed, probability)):
        for start, end in runs(decisions.raised):
            axes.axvspan(
                decisions.times[start], decisions.times[min(end, len(decisions.times) - 1)],
                facecolor=SLIP_COLOUR, alpha=DECIDED_ALPHA, edgecolor="none", linewidth=0,
                zorder=0.5,
            )  # fmt: skip


def draw_slips_found(axes: Axes, decisions: Sequence[Decisions], slips: SlipMetrics) -> None:
    """Draw the share of slips that are found, by the time since their onset.

    Args:
        axes: to draw on.
        decisions: about each recording.
        slips: of all fingers.
    """
    counts = SlipCounts.total(
        count_slips(slip) for decision in decisions for slip in decision.known_slips.values()
    )
    for limit in (0.0, *FOUND_WITHIN):
        axes.axvline(limit, color=GREY, linewidth=0.8, linestyle=":" if limit else "-")
    over = counts.delays[counts.is_over_1mm]
    for k, (name, delays) in enumerate(
        (("incipient", counts.delays), ("gross", counts.gross_delays), ("over 1 mm", over))
    ):
        if not len(delays):
            continue
        # What is found before the axis begins is found at its beginning.
        start, end = DELAY_LIMITS
        n_early = np.count_nonzero(delays < start)
        within = np.sort(delays[(delays >= start) & (delays <= end)])
        times = np.concatenate([[start], within, [end]])
        n_found = n_early + np.append(np.arange(len(within) + 1), len(within))
        axes.step(
            times, n_found / len(delays), where="post", color=COLOURS[k], linewidth=1.4,
            label=f"{name} ({len(delays)})",
        )  # fmt: skip
    axes.set(xlim=DELAY_LIMITS, ylim=(0, 1.02))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    add_labels(axes, "time since the onset of the slip [s]", "slips found by then")
    add_title(axes, f"slips of fingers: {slips.n} {ORIGINS[slips.onsets]}")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            fontsize=FONT_SIZE, loc="upper left", borderaxespad=0.1, framealpha=1.0,
            edgecolor="none",
        )  # fmt: skip


def draw_false_alarms(axes: Axes, summary: SlipSummary) -> None:
    """Draw the false alarms of slips per minute, of each finger and of all."""
    rows = {**summary.fingers, "all": summary.pooled}
    names = list(rows)[::-1]
    longest = 0.0
    for kind, label, colour, offset in (
        ("quiet", "of quiet hold", COLOURS[4], 0.2),
        ("held", "of held time", COLOURS[0], -0.2),
    ):
        rates = [rows[name].false_alarms_per_minute[kind] or 0.0 for name in names]
        axes.barh(np.arange(len(rates)) + offset, rates, 0.38, color=colour, label=label)
        longest = max(longest, *rates)
    axes.set_yticks(range(len(names)), [literal(name) for name in names])
    axes.set_xlim(0, max(1.0, 1.15 * longest))
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.grid(axis="x", color=FAINT, linewidth=0.6)
    add_labels(axes, "false alarms per minute")
    minutes = f"{summary.pooled.quiet_minutes:.1f} min quiet of {summary.pooled.held_minutes:.1f}"
    add_title(axes, f"false alarms of slips: {minutes} min held")
    axes.legend(fontsize=FONT_SIZE, frameon=False, loc="lower right", borderaxespad=0.1)
