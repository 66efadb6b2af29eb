"""Figures of slips: truth beside the decisions of a model, over time."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from holdfast.contact import SLIP_CODE, SLIP_SPEED
from holdfast.detector import detect
from holdfast.metrics.masks import Mask, runs
from holdfast.metrics.slip_truth import (
    SLIDING,
    Slip,
    finger_slips,
    has_slip_truth,
    sample_durations,
    slip_truth,
)
from holdfast.model import Model
from holdfast.plots.style import (
    COLOURS,
    FAINT,
    FONT_SIZE,
    GREY,
    INK,
    add_labels,
    add_legend,
    add_title,
    page_figure,
    style_axes,
)
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

COLUMN_WIDTH = 3.5
"""Width of the figure [inch]: one column of a page with two."""
COLUMN_HEIGHT = 4.3
"""Height of the figure [inch]."""
OVERVIEW_COLUMNS = 2
OVERVIEW_ROW_HEIGHT = 2.1
"""Height of a row of panels in the figure of several slips [inch]."""
LOWEST_SHOWN_PROBABILITY = 1e-4
"""Lower end of the logarithmic axis of the probability; less is drawn there."""
MARGIN_TIME = 0.5
"""Time that is drawn before the first and after the last slip [s]."""
MAX_SHOWN_TIME = 3.0
"""Maximum time that is drawn after the first onset [s]."""
MIN_SPEED = 0.1
"""Lower end of the axis of the speed [mm/s]; slower is drawn there."""
MILLIMETRES_PER_METRE = 1e3
SPEED_COLOUR, SCORE_COLOUR, RAISED_COLOUR = COLOURS[0], COLOURS[2], COLOURS[3]
INCIPIENT_STYLE: dict[str, Any] = {"color": COLOURS[5], "linestyle": "-", "linewidth": 1.0}
GROSS_STYLE: dict[str, Any] = {"color": COLOURS[1], "linestyle": (0, (4, 2)), "linewidth": 1.0}
SPEED_STYLE: dict[str, Any] = {"color": GREY, "linestyle": ":", "linewidth": 0.8}
THRESHOLD_STYLE: dict[str, Any] = {"color": INK, "linestyle": "--", "linewidth": 0.8}
EVENTS_KEY = "slip_events"
"""Key of the metadata with the slip events of a recording."""
KIND_TITLES = {
    "weight": "weight is added",
    "grip": "the grip relaxes",
    "friction": "friction falls",
    "creep": "the object is drawn slowly",
    "twist": "a torque grows",
    "turn": "the object is turned",
    "roll": "the object is rolled",
}
"""Words for the kinds of slip events."""


class SlipSeries(NamedTuple):
    """Truth of one finger, and the decisions of a model about it; times from the first onset.

    Attributes:
        finger: name of the finger.
        times: (n,) of the truth [s].
        speed: (n,) of the slip [m/s].
        distance: (n,) slid since the first onset [m].
        decided_at: (m,) times of the decisions [s].
        probability: (m,) of a slip.
        raised: (m,) where a slip is reported.
        sliding: (m,) where the finger slides by the truth.
        threshold: of the probability.
        slips: by the truth.
        end: of what is drawn [s].
    """

    finger: str
    times: Array
    speed: Array
    distance: Array
    decided_at: Array
    probability: Array
    raised: Mask
    sliding: Mask
    threshold: float
    slips: tuple[Slip, ...]
    end: float


def event_kinds(recording: Recording, distance: float = 0.0) -> list[str]:
    """Return the kinds of the slip events of a recording in which a finger slips.

    Args:
        recording: with a truth and slip events.
        distance: that a finger slides at least in the first event of a kind [m].
    """
    events = recording.metadata.get(EVENTS_KEY) or []
    slips = {event["kind"]: _slipping_finger(recording, event["kind"])[1] for event in events}
    return [kind for kind, made in slips.items() if made and _slid(made) >= distance]


def slip_figure(model: Model, recording: Recording, kind: str) -> Figure:
    """Draw the slips of the first event of a kind: truth above, decisions below.

    It shows the finger that slides farthest in the event.

    Args:
        model: with a slip rule.
        recording: with a truth and slip events.
        kind: of the event.

    Raises:
        ValueError: there is no such event in which a finger slips, or the model has no slip rule.
    """
    series = _series(model, recording, kind)
    figure = page_figure(COLUMN_HEIGHT, COLUMN_WIDTH)
    rows = figure.subplots(4, 1, sharex=True, height_ratios=(1.3, 1.0, 1.3, 0.55))
    for axes in rows:
        style_axes(axes)
        _mark_onsets(axes, series)
    _draw_speed(rows[0], series)
    _draw_distance(rows[1], series)
    _draw_probability(rows[2], series)
    _draw_strips(rows[3], series)
    rows[3].set_xlim(-MARGIN_TIME, series.end)
    add_labels(rows[3], "time from the first onset [s]")
    add_title(rows[0], _title(recording, kind, series))
    figure.align_ylabels(rows)
    add_legend(figure, _handles([series]), per_row=2)
    return figure


def slips_figure(model: Model, events: Sequence[tuple[Recording, str]]) -> Figure:
    """Draw the slips of several events, each in a panel: truth above, decisions below.

    Args:
        model: with a slip rule.
        events: recordings with a truth, and the kind of the event of each.

    Raises:
        ValueError: as `slip_figure`.
    """
    n_rows = len(events) // OVERVIEW_COLUMNS + 1  # one place is for the legend
    figure = page_figure(n_rows * OVERVIEW_ROW_HEIGHT)
    places = figure.subfigures(n_rows, OVERVIEW_COLUMNS, squeeze=False).ravel()
    drawn = []
    for place, (recording, kind) in zip(places, events, strict=False):
        series = _series(model, recording, kind)
        _draw_panel(place, series, _title(recording, kind, series))
        drawn.append(series)
    places[-1].legend(
        handles=_handles(drawn), loc="center", fontsize=FONT_SIZE, frameon=False, handlelength=2.8
    )
    return figure


def _draw_panel(place: SubFigure, series: SlipSeries, title: str) -> None:
    rows = place.subplots(3, 1, sharex=True, height_ratios=(1.2, 1.0, 0.55))
    for axes in rows:
        style_axes(axes)
        _mark_onsets(axes, series)
    _draw_speed(rows[0], series)
    _draw_probability(rows[1], series)
    _draw_strips(rows[2], series)
    rows[2].set_xlim(-MARGIN_TIME, series.end)
    add_labels(rows[2], "time from the first onset [s]")
    add_title(rows[0], title)
    place.align_ylabels(rows)


def _title(recording: Recording, kind: str, series: SlipSeries) -> str:
    item = str(recording.metadata.get("object", recording.name))
    return f"{KIND_TITLES.get(kind, kind)}: {item.replace('_', ' ')}, {series.finger}"


def _slid(slips: Sequence[Slip]) -> float:
    """Return the distance that a finger slides in all slips [m]."""
    return sum(slip.distance for slip in slips)


def _slipping_finger(recording: Recording, kind: str) -> tuple[str, tuple[Slip, ...]]:
    """Return the finger that slides farthest in the first event of a kind, and its slips there."""
    events = recording.metadata.get(EVENTS_KEY) or []
    event = next((event for event in events if event["kind"] == kind), None)
    truth = recording.truth
    best: tuple[str, tuple[Slip, ...]] = ("", ())
    if event is None or truth is None:
        return best
    for finger in recording.modules:
        if has_slip_truth(truth, finger):
            slips = tuple(
                slip
                for slip in finger_slips(truth, finger)
                if event["start"] <= slip.onset < event["end"]
            )
            if _slid(slips) > _slid(best[1]):
                best = (finger, slips)
    return best


def _series(model: Model, recording: Recording, kind: str) -> SlipSeries:
    finger, slips = _slipping_finger(recording, kind)
    if not slips or recording.truth is None:
        raise ValueError(f"{recording.name} has no slip event {kind!r} in which a finger slips")
    rule = model.finger(finger, recording.modules[finger].sensor).slip
    trace = detect(model, recording).fingers[finger]
    known = slip_truth(recording, finger, trace.times)
    if rule is None or trace.slip_probability is None or known is None:
        raise ValueError(f"{model.name or 'the model'} has no slip rule of the {finger}")
    onset, truth = slips[0].onset, recording.truth
    speed = truth.fingers[finger]["slip_speed"]
    counted = np.where((truth.times >= onset) & (speed > SLIP_SPEED), speed, 0.0)
    return SlipSeries(
        finger=finger,
        times=truth.times - onset,
        speed=speed,
        distance=np.cumsum(counted * sample_durations(truth.times)),
        decided_at=trace.times - onset,
        probability=trace.slip_probability,
        raised=trace.cause == SLIP_CODE,
        sliding=known.codes == SLIDING,
        threshold=rule.threshold,
        slips=tuple(
            slip._replace(onset=slip.onset - onset, gross=slip.gross - onset) for slip in slips
        ),
        end=min(slips[-1].end - onset, MAX_SHOWN_TIME) + MARGIN_TIME,
    )


def _mark_onsets(axes: Axes, series: SlipSeries) -> None:
    for slip in series.slips:
        axes.axvline(slip.onset, zorder=1, **INCIPIENT_STYLE)
        if not math.isnan(slip.gross):
            axes.axvline(slip.gross, zorder=1, **GROSS_STYLE)


def _draw_speed(axes: Axes, series: SlipSeries) -> None:
    shown = _shown(series.times, series.end)
    speed = np.maximum(series.speed[shown] * MILLIMETRES_PER_METRE, MIN_SPEED)
    axes.plot(series.times[shown], speed, color=SPEED_COLOUR, linewidth=1.0)
    axes.axhline(SLIP_SPEED * MILLIMETRES_PER_METRE, **SPEED_STYLE)
    highest = max(20.0, 1.5 * float(speed.max()))
    _set_log_scale(axes, (MIN_SPEED, highest), [t for t in (0.1, 1.0, 10.0, 100.0) if t < highest])
    add_labels(axes, y="slip speed\n[mm/s]")


def _draw_distance(axes: Axes, series: SlipSeries) -> None:
    shown = _shown(series.times, series.end)
    distance = series.distance[shown] * MILLIMETRES_PER_METRE
    axes.plot(series.times[shown], distance, color=SPEED_COLOUR, linewidth=1.0)
    axes.set_ylim(0, 1.1 * max(float(distance.max()), 0.1))
    add_labels(axes, y="distance slid\n[mm]")


def _draw_probability(axes: Axes, series: SlipSeries) -> None:
    shown = _shown(series.decided_at, series.end)
    probability = np.maximum(series.probability[shown], LOWEST_SHOWN_PROBABILITY)
    axes.plot(series.decided_at[shown], probability, color=SCORE_COLOUR, linewidth=1.0)
    axes.axhline(series.threshold, **THRESHOLD_STYLE)
    _set_log_scale(axes, (0.8 * LOWEST_SHOWN_PROBABILITY, 1.3), (1e-4, 1e-2, 1.0))
    add_labels(axes, y="slip\nprobability")


def _set_log_scale(axes: Axes, limits: tuple[float, float], ticks: Sequence[float]) -> None:
    axes.set_yscale("log")
    axes.set_ylim(*limits)
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()


def _draw_strips(axes: Axes, series: SlipSeries) -> None:
    """Draw bars where the finger slides, and where a slip is reported."""
    bars = ((1.0, series.sliding, SPEED_COLOUR), (0.0, series.raised, RAISED_COLOUR))
    steps = sample_durations(series.decided_at)
    for height, mask, colour in bars:
        spans = [
            (series.decided_at[a], series.decided_at[b - 1] + steps[b - 1] - series.decided_at[a])
            for a, b in runs(mask)
        ]
        axes.axhline(height, color=FAINT, linewidth=0.8, zorder=0)
        axes.broken_barh(spans, (height - 0.35, 0.7), color=colour, linewidth=0)
    axes.set_yticks((1.0, 0.0), ("slides", "reported"))
    axes.set_ylim(-0.5, 1.5)
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.tick_params(axis="y", length=0)


def _shown(times: Array, end: float) -> Mask:
    return np.asarray((times >= -MARGIN_TIME) & (times <= end))


def _handles(drawn: Sequence[SlipSeries]) -> list[Artist]:
    """Return the handles of the legend of all lines that are drawn."""
    handles: list[Artist] = [Line2D([], [], label="a slip begins", **INCIPIENT_STYLE)]
    if any(not math.isnan(slip.gross) for series in drawn for slip in series.slips):
        handles.append(Line2D([], [], label="it becomes gross", **GROSS_STYLE))
    return [
        *handles,
        Line2D([], [], label="1 mm/s: faster is sliding", **SPEED_STYLE),
        Line2D([], [], label="threshold of the model", **THRESHOLD_STYLE),
    ]
