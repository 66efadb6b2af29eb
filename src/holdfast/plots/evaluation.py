"""Figure of an evaluation: accuracy, calibration, delays and slips."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from holdfast.metrics import (
    Decisions,
    Metrics,
    RecordingMetrics,
    SampleMetrics,
    calibration_sums,
    match_decisions,
)
from holdfast.metrics.decisions import FingerDecisions
from holdfast.metrics.events import EARLY_TOLERANCE, POST_DURATIONS, event_delays
from holdfast.plots.slips import draw_false_alarms, draw_slips_found
from holdfast.plots.style import (
    FAINT,
    GREY,
    SeriesStyle,
    add_labels,
    add_legend,
    add_title,
    default_settings,
    literal,
    page_figure,
    series_styles,
    style_axes,
)
from holdfast.sensors.types import Array

WIDTH = 9.6
"""Width of the figure [inch]."""
SLIPS_HEIGHT = 2.6
"""Height of the panels about slips [inch]."""
HAND_COLOUR = "black"
MAX_NAMED_RECORDINGS = 25
"""With more recordings only their number is written."""
MAX_NAME_LENGTH = 24
MAX_DELAY = 0.5
"""End of the time axis of the delays [s]."""


@default_settings()
def draw_evaluation(metrics: Metrics, decisions: Sequence[Decisions]) -> Figure:
    """Draw accuracy and AUC of each recording, calibration, delays of alarms, and slips.

    Slips are drawn if the model has a slip rule, and slips are known.

    Args:
        metrics: of all recordings.
        decisions: from which the metrics were computed.
    """
    n_recordings = len(metrics.recordings)
    named = n_recordings <= MAX_NAMED_RECORDINGS
    # The texts beside few recordings need the height of four rows; dots without names need half.
    n_rows = max(4, n_recordings if named else MAX_NAMED_RECORDINGS // 2)
    heights = [1.0 + 0.16 * n_rows, 3.3, *([] if metrics.slips is None else [SLIPS_HEIGHT])]
    figure = page_figure(0.4 + sum(heights), WIDTH)
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    series = series_styles(metrics.fingers)
    styles = {name: series[name]._replace(linestyle="-") for name in metrics.fingers}
    left = figure.add_subplot(grid[0, 0])
    right = figure.add_subplot(grid[0, 1], sharey=left)
    _draw_recordings(left, right, metrics, styles)
    _draw_calibration(figure.add_subplot(grid[1, 0]), metrics.pooled, decisions, styles)
    _draw_delays(figure.add_subplot(grid[1, 1]), metrics, decisions, styles)
    if metrics.slips is not None:
        draw_slips_found(figure.add_subplot(grid[2, 0]), decisions, metrics.slips.pooled)
        draw_false_alarms(figure.add_subplot(grid[2, 1]), metrics.slips)
    for axes in figure.axes:
        style_axes(axes)
    right.tick_params(labelleft=False)
    # The legend has lines of its own: panels draw a finger as dots, or as a line without them.
    fingers = [
        left.plot([], [], linewidth=0.9, markersize=4, label=literal(name), **style._asdict())[0]
        for name, style in styles.items()
    ]
    hand = left.plot([], [], color=HAND_COLOUR, label="all samples, or the hand")
    add_legend(figure, [*fingers, *hand])
    return figure


def calibration(decisions: Sequence[FingerDecisions]) -> Array:
    """Return how often samples with about the same probability are labelled stable.

    Args:
        decisions: of any fingers.

    Returns:
        (m, 3) for each bin of probabilities with labelled samples: their mean probability,
        the fraction of them labelled stable, and their number.
    """
    table = calibration_sums(decisions)
    table = table[table[:, 2] > 0]
    table[:, :2] /= table[:, 2:]
    return table


def _draw_recordings(
    left: Axes, right: Axes, metrics: Metrics, styles: Mapping[str, SeriesStyle]
) -> None:
    """Draw a row for each recording, the best on top, and a dot for each finger."""

    def mean_accuracy(recording: RecordingMetrics) -> float:
        values = [finger.accuracy for finger in recording.fingers.values()]
        return float(np.mean([v for v in values if v is not None] or [-1.0]))

    # Sorted as a whole, so that both panels have a recording in the same row.
    ordered = sorted(metrics.recordings, key=mean_accuracy)
    _draw_dots(left, metrics, ordered, "accuracy", styles)
    _draw_dots(right, metrics, ordered, "auc_contact", styles)
    right.axvline(0.5, color=GREY, linewidth=0.8, linestyle=":")
    left.set_xlim(min(left.get_xlim()[0], 48), 101)
    right.set_xlim(min(right.get_xlim()[0], 0.48), 1.01)
    add_labels(left, "accuracy [%]")
    add_labels(right, "AUC in contact, stable against unstable (dotted: chance)")
    accuracy = _text(metrics.pooled.accuracy, ": {:.1f} % of all")
    add_title(left, f"correct samples{accuracy}")
    add_title(
        right,
        f"samples in the right order{_text(metrics.pooled.auc_contact, ': AUC {:.3f} of all')}",
    )
    left.set_ylim(-0.7, max(len(ordered), 1) - 0.3)
    if len(ordered) <= MAX_NAMED_RECORDINGS:
        # Of a long name the end: the names of recordings often begin alike.
        names = [recording.name for recording in ordered]
        most = MAX_NAME_LENGTH
        shown = [name if len(name) <= most else f"…{name[1 - most :]}" for name in names]
        left.set_yticks(range(len(ordered)), [literal(name) for name in shown])
    else:
        left.set_yticks([])
        add_labels(left, y=f"{len(ordered)} recordings, by accuracy")


def _draw_dots(
    axes: Axes,
    metrics: Metrics,
    ordered: Sequence[RecordingMetrics],
    field: str,
    styles: Mapping[str, SeriesStyle],
) -> None:
    """Draw one metric of each recording and finger, and a line at its value of all samples."""
    for name, (color, marker, _) in styles.items():
        rows = [(k, recording.fingers.get(name)) for k, recording in enumerate(ordered)]
        dots = [(getattr(m, field), k) for k, m in rows if m and getattr(m, field) is not None]
        x, y = np.array(dots).reshape(-1, 2).T
        axes.scatter(x, y, s=20, alpha=0.85, linewidths=0, color=color, marker=marker)
    value = getattr(metrics.pooled, field)
    if value is not None:
        axes.axvline(value, color=HAND_COLOUR, linewidth=0.8)
    axes.grid(axis="y", color=FAINT, linewidth=0.6)


def _draw_calibration(
    axes: Axes,
    pooled: SampleMetrics,
    decisions: Sequence[Decisions],
    styles: Mapping[str, SeriesStyle],
) -> None:
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=0.8, linestyle=":")
    for name, style in styles.items():
        table = calibration(
            [decision.fingers[name] for decision in decisions if name in decision.fingers]
        )
        axes.plot(table[:, 0], table[:, 1], color=style.color, linewidth=0.8, alpha=0.7)
    every = calibration([finger for decision in decisions for finger in decision.fingers.values()])
    if len(every):
        # Bars of the samples lie under the curve: where there are few, it means little.
        share = every[:, 2] / every[:, 2].sum()
        axes.bar(every[:, 0], 0.25 * share / share.max(), width=0.06, color="#dddddd", zorder=0)
        axes.plot(every[:, 0], every[:, 1], "o-", color=HAND_COLOUR, linewidth=1.4, markersize=3)
    axes.set(xlim=(-0.03, 1.03), ylim=(0, 1.02))
    add_labels(axes, "probability of stability", "fraction labelled stable")
    brier = _text(pooled.brier, ": Brier score {:.3f}")
    add_title(axes, f"calibration{brier} (bars: samples)")


def _draw_delays(
    axes: Axes,
    metrics: Metrics,
    decisions: Sequence[Decisions],
    styles: Mapping[str, SeriesStyle],
) -> None:
    """Draw the fraction of events with an alarm, by the time since their onset."""
    for post in POST_DURATIONS:
        axes.axvline(post, color=GREY, linewidth=0.8, linestyle=":")
    for name, style in styles.items():
        fingers = [decision.fingers[name] for decision in decisions if name in decision.fingers]
        _draw_delay_curve(axes, fingers, color=style.color, linewidth=0.9, alpha=0.8)
    hands = [decision.hand for decision in decisions if decision.hand is not None]
    _draw_delay_curve(axes, hands, color=HAND_COLOUR, linewidth=1.8, alpha=1.0)
    axes.set(xlim=(-EARLY_TOLERANCE, MAX_DELAY), ylim=(0, 1.02))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    add_labels(axes, "time since the onset [s]", "events with an alarm by then")
    hand = metrics.events.hand
    title = "no event in the labels"
    if hand.n_events:
        rate = _text(hand.false_alarms_per_minute, ", {:.1f} false alarms/min")
        title = f"{hand.n_events} event{'s' * (hand.n_events > 1)}{rate}"
    add_title(axes, f"alarms of the hand: {title}")


def _draw_delay_curve(
    axes: Axes, decisions: Sequence[FingerDecisions], *, color: str, linewidth: float, alpha: float
) -> None:
    matches = [match_decisions(decision) for decision in decisions]
    delays = event_delays(matches)
    if not len(delays):
        return
    # The curve ends below 1 by the share of missed events, whose delay is infinite.
    detected = delays[delays <= MAX_DELAY]
    times = np.concatenate([[-EARLY_TOLERANCE], detected, [MAX_DELAY]])
    counts = np.concatenate([[0], np.arange(1, len(detected) + 1), [len(detected)]])
    share = counts / len(delays)
    axes.step(times, share, where="post", color=color, linewidth=linewidth, alpha=alpha)


def _text(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)
