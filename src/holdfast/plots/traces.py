"""The paper's figures: one finger over one recording, its features and what was predicted."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullLocator

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, Phase
from holdfast.features import FEATURE_NAMES, Tare, fingertip_force, haar_features
from holdfast.plots.envelope import envelope
from holdfast.plots.recording import COMPONENT_COLOURS
from holdfast.plots.style import INK, SMALL, add_labels, add_legend, sheet, tidy
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

Codes = npt.NDArray[np.integer[Any]]
PHASE_COLOURS = {
    Phase.FREE: "#eeeeee",
    Phase.CLOSING: "#fbe3b5",
    Phase.LOCKED: "#c9ead9",
    Phase.DISTURBED: "#cfe6f7",
    Phase.SLIPPING: "#f6cdb6",
    Phase.RELEASED: "#e6d8ec",
}
PHASE_TITLES = {
    Phase.FREE: "free",
    Phase.CLOSING: "closing",
    Phase.LOCKED: "locked",
    Phase.DISTURBED: "disturbed",
    Phase.SLIPPING: "slipping",
    Phase.RELEASED: "released",
}
STATE_COLOURS = {STABLE: "#009e73", UNSTABLE: "#e08a3c", NO_CONTACT: "#c8c8c8"}
STATE_TITLES = {STABLE: "1: stable", UNSTABLE: "0: not stable", NO_CONTACT: "0: no contact"}
TRUTH = "label"
COMPONENTS = ("F_x", "F_y", "F_z")
AMPLITUDE_COLOUR = COMPONENT_COLOURS["F_a"]
MEAN_COLOUR = "#56b4e9"
WIDE = 15.0
"""Sigma is drawn on a logarithmic axis where its peak is so many times its median."""
N_BINS = 1500
"""Stretches of a curve of which the smallest and the largest value are drawn."""
ROOM = 0.0083
"""Width of a letter of a phase's name, as a share of the axes."""


class Trace(NamedTuple):
    """One finger over one recording.

    Attributes:
        name: of the recording and finger.
        times: (n,) [s].
        force: (n, 3) F_tip [unit].
        amplitude: (n,) F_a [unit].
        mean: (n,) m [unit].
        sigma: (n,) [unit]; NaN without a full window.
        labels: (n,) state codes; UNKNOWN without a label.
        phases: (n,) what the experiment was doing; empty where that is not known.
        unit: of the readings: "count" or "N".
    """

    name: str
    times: Array
    force: Array
    amplitude: Array
    mean: Array
    sigma: Array
    labels: Codes
    phases: npt.NDArray[np.str_]
    unit: str = "count"


def trace_of(recording: Recording, finger: str, tare: Tare, window: int = 14) -> Trace:
    """The trace of a finger of a recording.

    Args:
        recording: whose truth tells the phases, where it has one.
        finger: its name.
        tare: how the baseline is found.
        window: N_w [samples].
    """
    module = recording.modules[finger]
    times = module.times
    force = fingertip_force(module.readings, module.sensor, tare, times)
    features = haar_features(force, window)
    truth = recording.truth
    phases = np.full(len(times), "")
    if truth is not None and "phase" in truth.hand and len(truth.times):
        at = np.searchsorted(truth.times, times, side="right") - 1
        phases = np.asarray(truth.hand["phase"])[np.clip(at, 0, None)].astype(str)
    return Trace(
        name=f"{recording.name}, {finger}",
        times=times,
        force=force,
        amplitude=np.asarray(np.linalg.norm(force, axis=1)),
        mean=features[:, FEATURE_NAMES.index("m")],
        sigma=features[:, FEATURE_NAMES.index("sigma")],
        labels=module.label_states,
        phases=phases,
        unit=str(module.unit),
    )


def draw_forces(trace: Trace) -> Figure:
    """The components of the fingertip force, with the phases shaded and named.

    The paper's figure of one recording (`pics_force`).
    """
    figure = sheet(3.1)
    axes = figure.subplots()
    _draw_phases(axes, trace, named=True)
    _draw_components(axes, trace)
    add_labels(axes, y=f"fingertip force {_unit(trace)}")
    _finish(figure, [axes], trace)
    add_legend(figure, _component_handles())
    return figure


def draw_features(trace: Trace) -> Figure:
    """Force, its amplitude and mean, sigma, and the label of one experiment.

    The paper's figure of features and labels (`expiriment`).
    """
    figure = sheet(5.7)
    rows = figure.subplots(4, 1, sharex=True, height_ratios=(1.6, 1.4, 1.1, 0.3))
    for axes in rows[:3]:
        _draw_phases(axes, trace, named=axes is rows[0])
    _draw_components(rows[0], trace)
    _curve(rows[1], trace.times, trace.amplitude, AMPLITUDE_COLOUR, 1.0)
    _curve(rows[1], trace.times, trace.mean, MEAN_COLOUR, 1.0)
    _draw_sigma(rows[2], trace)
    _draw_states(rows[3], trace, {TRUTH: trace.labels})
    for axes, name in zip(rows, ("$F_{tip}$", "$F_a$, $m$", "$\\sigma$"), strict=False):
        add_labels(axes, y=f"{name} {_unit(trace)}")
    _finish(figure, rows, trace)
    lines = [_line(AMPLITUDE_COLOUR, "$F_a$"), _line(MEAN_COLOUR, "$m$")]
    states = _state_handles([trace.labels])
    add_legend(figure, [*_component_handles(), *lines, *states])
    return figure


def draw_experiment(
    trace: Trace, predicted: Mapping[str, Codes], span: tuple[float, float] | None = None
) -> Figure:
    """F_a, sigma, and what was predicted beside the label.

    The paper's figures of experiment 1 (a failed grasp) and 2 (locked, disturbed, released).

    Args:
        trace: of the finger.
        predicted: by the title of the method: (n,) state codes, UNKNOWN where it cannot tell.
        span: the part that is shown [s]; all by default.
    """
    strips = {TRUTH: trace.labels, **predicted}
    figure = sheet(3.7 + 0.3 * len(strips))
    rows = figure.subplots(3, 1, sharex=True, height_ratios=(1.5, 1.1, 0.3 * len(strips)))
    for axes in rows[:2]:
        _draw_phases(axes, trace, named=axes is rows[0])
    _curve(rows[0], trace.times, trace.amplitude, AMPLITUDE_COLOUR, 1.0)
    _draw_sigma(rows[1], trace)
    _draw_states(rows[2], trace, strips)
    add_labels(rows[0], y=f"$F_a$ {_unit(trace)}")
    add_labels(rows[1], y=f"$\\sigma$ {_unit(trace)}")
    _finish(figure, rows, trace)
    if span is not None:
        rows[0].set_xlim(span)
    add_legend(figure, _state_handles(strips.values()))
    return figure


def runs(values: npt.NDArray[Any]) -> Iterator[tuple[int, int]]:
    """First place and end of each run of equal values.

    Example:
        >>> list(runs(np.array([3, 3, 1])))
        [(0, 2), (2, 3)]
    """
    edges = np.flatnonzero(values[1:] != values[:-1]) + 1
    return pairwise([0, *edges.tolist(), len(values)]) if len(values) else iter(())


def _draw_phases(axes: Axes, trace: Trace, *, named: bool = False) -> None:
    """Shades over time; above them the name of each phase that has room for it."""
    spans = list(_spans(trace.times, trace.phases))
    duration = spans[-1][2] - spans[0][1] if spans else 1.0
    for first, start, end in spans:
        phase = str(trace.phases[first])
        if not phase:
            continue
        axes.axvspan(start, end, facecolor=PHASE_COLOURS[Phase(phase)], linewidth=0, zorder=0)
        name = PHASE_TITLES[Phase(phase)]
        if named and (end - start) / duration > ROOM * (len(name) + 1):
            axes.annotate(
                name, ((start + end) / 2, 1), xycoords=("data", "axes fraction"),
                xytext=(0, 2), textcoords="offset points", ha="center", fontsize=SMALL - 0.5,
            )  # fmt: skip


def _spans(times: Array, values: npt.NDArray[Any]) -> Iterator[tuple[int, float, float]]:
    """First place, start and end [s] of each run of equal values."""
    if len(times) < 2:
        return
    period = float(np.median(np.diff(times)))
    ends = np.append(times[1:], times[-1] + period)
    for first, stop in runs(values):
        yield first, float(times[first]), float(ends[stop - 1])


def _draw_components(axes: Axes, trace: Trace) -> None:
    for column, name in enumerate(COMPONENTS):
        _curve(axes, trace.times, trace.force[:, column], COMPONENT_COLOURS[name], 1.0)
    axes.axhline(0, color=INK, linewidth=0.4, zorder=1)


def _curve(axes: Axes, times: Array, values: Array, colour: str, width: float) -> None:
    axes.plot(*envelope(times, values, N_BINS), color=colour, linewidth=width, zorder=2)


def _draw_sigma(axes: Axes, trace: Trace) -> None:
    """Linear, unless the peaks would hide all else: then logarithmic."""
    _curve(axes, trace.times, trace.sigma, INK, 0.8)
    known = trace.sigma[np.isfinite(trace.sigma) & (trace.sigma > 0)]
    if len(known) and known.max() > WIDE * np.median(known):
        axes.set_yscale("log")
        axes.set_ylim(np.quantile(known, 0.005) / 1.5, known.max() * 1.5)
        axes.yaxis.set_minor_locator(NullLocator())
    else:
        axes.set_ylim(bottom=0)
        axes.yaxis.set_major_locator(MaxNLocator(4))


def _draw_states(axes: Axes, trace: Trace, strips: Mapping[str, Codes]) -> None:
    """One strip of colours for each series; beside it its name and share of samples right."""
    names = []
    for row, (name, codes) in enumerate(strips.items()):
        spans = list(_spans(trace.times, codes))
        for state, colour in STATE_COLOURS.items():
            bars = [(start, end - start) for first, start, end in spans if codes[first] == state]
            axes.broken_barh(bars, (row - 0.4, 0.8), facecolors=colour, linewidth=0)
        names.append(name if name == TRUTH else f"{name}\n{_share_right(trace.labels, codes)}")
    axes.set_yticks(range(len(strips)), names)
    axes.set_ylim(len(strips) - 0.5, -0.5)


def _share_right(labels: Codes, codes: Codes) -> str:
    known = (labels != UNKNOWN) & (codes != UNKNOWN)
    if not known.any():
        return "no label"
    return f"{100 * np.mean((labels == STABLE)[known] == (codes == STABLE)[known]):.1f} % right"


def _finish(figure: Figure, rows: Sequence[Axes], trace: Trace) -> None:
    for axes in rows:
        tidy(axes)
        if axes.yaxis_inverted():  # strips
            axes.tick_params(axis="y", length=0)
        if len(trace.times) > 1:
            axes.set_xlim(trace.times[0], trace.times[-1])
    add_labels(rows[-1], x="time [s]")
    rows[0].set_title(trace.name, fontsize=SMALL + 0.5, loc="left", pad=14, color=INK)
    figure.align_ylabels([axes for axes in rows if not axes.yaxis_inverted()])
    add_legend(figure, _phase_handles(trace), "outside lower center")


def _unit(trace: Trace) -> str:
    return "[counts]" if trace.unit == "count" else f"[{trace.unit}]"


def _line(colour: str, label: str) -> Line2D:
    return Line2D([], [], color=colour, linewidth=1.4, label=label)


def _component_handles() -> list[Artist]:
    return [_line(COMPONENT_COLOURS[name], f"${name}$") for name in COMPONENTS]


def _phase_handles(trace: Trace) -> list[Artist]:
    seen = set(trace.phases.tolist())
    return [
        Patch(facecolor=colour, label=PHASE_TITLES[phase])
        for phase, colour in PHASE_COLOURS.items()
        if phase in seen
    ]


def _state_handles(strips: Iterable[Codes]) -> list[Artist]:
    seen = {int(code) for codes in strips for code in np.unique(codes)}
    return [
        Patch(facecolor=colour, label=STATE_TITLES[state])
        for state, colour in STATE_COLOURS.items()
        if state in seen
    ]
