"""A recording over time, as in the paper's figures 3 and 5: forces, sigma, labels, slip."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from holdfast.contact import ContactState
from holdfast.features import DEFAULT_WINDOW, FEATURE_NAMES, Tare, fingertip_force, haar_features
from holdfast.plots.envelope import envelope
from holdfast.recordings import GAP_PERIODS, Recording, Tactile
from holdfast.sensors.types import Array

# Colours after Okabe and Ito, told apart by the colour-blind.
COMPONENT_COLOURS = {"F_x": "#0072B2", "F_y": "#E69F00", "F_z": "#CC79A7", "F_a": "#000000"}
STATE_COLOURS = {
    ContactState.STABLE: (0.0, 0.62, 0.45, 0.20),
    ContactState.UNSTABLE: (0.84, 0.37, 0.0, 0.30),
    ContactState.NO_CONTACT: (0.5, 0.5, 0.5, 0.22),
}
INK = "#333333"
MM = 1e3

WIDE = 15.0
"""Sigma is drawn on a logarithmic axis where its peak is so many times its median."""
SIGMA = FEATURE_NAMES.index("sigma")

ROW_HEIGHTS = {"force": 1.75, "sigma": 0.9, "slip": 0.75}
"""Of the axes of a finger [inch]."""
LEGEND_HEIGHT = 0.75
WIDTH = 7.2
"""Of a figure with one column [inch]: the text width of a page in two columns."""
MOST_IN_COLUMN = 3
FAR = 1e5
"""A clock that starts later than this is told apart from the time in the recording [s]."""


@dataclass(frozen=True)
class _Curves:
    """What is drawn of a finger, with a NaN wherever a line must break."""

    times: Array
    features: Array  # (n, 6) as FEATURE_NAMES
    slip: tuple[Array, Array] | None


def plot_recording(
    recording: Recording, tare: Tare | None = None, window: int = DEFAULT_WINDOW
) -> Figure:
    """Forces, sigma, labels and slip of each finger over time.

    Pads (names with "/") are left out where there are fingertips.

    Args:
        recording: to draw.
        tare: how the baseline is found; by default the mean of the first 0.5 s.
        window: N_w of sigma [samples].

    Raises:
        ValueError: a tare by interval finds no samples.
    """
    chosen = tare or Tare.parse(0.5)
    fingers = _fingers(recording)
    origin = recording.start if abs(recording.start) > FAR else 0.0
    curves = {
        name: _curves(recording, name, module, chosen, window) for name, module in fingers.items()
    }
    figure, stacks = _stacks(curves, origin)
    n_columns = _n_columns(curves)
    for place, (name, axes) in enumerate(zip(fingers, stacks, strict=False)):
        _draw_finger(axes, name, fingers[name], curves[name], origin)
        _draw_markers(axes, recording, origin, named=place < n_columns)
        if place + n_columns >= len(fingers):
            axes[-1].set_xlabel(_clock(origin), fontsize=8)
    for axes in stacks[len(fingers) :]:
        for axis in axes:
            axis.set_axis_off()
    figure.align_ylabels()
    figure.suptitle(_title(recording, chosen, window), fontsize=9)
    handles = _legend(list(fingers.values()))
    figure.legend(
        handles=handles, loc="outside lower center", ncols=len(handles), fontsize=7.5,
        frameon=False, handlelength=1.6, columnspacing=1.4,
    )  # fmt: skip
    return figure


def _fingers(recording: Recording) -> dict[str, Tactile]:
    every = {name: module for name, module in recording.modules.items() if module.n_samples}
    return {name: module for name, module in every.items() if "/" not in name} or every


def _curves(recording: Recording, name: str, module: Tactile, tare: Tare, window: int) -> _Curves:
    times = module.times
    if not np.isfinite(module.readings).all(axis=(1, 2)).any():
        return _Curves(times, np.full((len(times), len(FEATURE_NAMES)), np.nan), None)
    force = fingertip_force(module.readings, module.sensor, tare, times)
    breaks = np.flatnonzero(np.diff(times) > GAP_PERIODS * module.period) + 1
    times = np.insert(times, breaks, times[breaks - 1])
    force = np.insert(force, breaks, np.nan, axis=0)
    features = haar_features(force, window)
    features[:, 0] = np.linalg.norm(force, axis=1)  # before the first window is full, too
    features[:, 1:4] = force
    truth = recording.truth
    known = truth.fingers.get(name, {}) if truth is not None else {}
    slip = (truth.times, known["slip_speed"]) if truth and "slip_speed" in known else None
    return _Curves(times, features, slip)


def _n_columns(curves: Mapping[str, _Curves]) -> int:
    return 1 if len(curves) <= MOST_IN_COLUMN else 2


def _stacks(curves: Mapping[str, _Curves], origin: float) -> tuple[Figure, list[list[Axes]]]:
    """A figure with the axes of each finger one above the other, fingers line by line."""
    n_columns = _n_columns(curves)
    n_lines = -(-len(curves) // n_columns)
    rows = [row for row in ROW_HEIGHTS if row != "slip" or _any_slip(curves)]
    heights = [ROW_HEIGHTS[row] for row in rows] * n_lines
    figure = Figure(
        figsize=(WIDTH * (1 if n_columns == 1 else 1.6), sum(heights) + LEGEND_HEIGHT),
        dpi=200,
        layout="constrained",
    )
    grid = figure.subplots(
        len(heights), n_columns, sharex=True, squeeze=False, height_ratios=heights
    )
    start = min(curve.times[0] for curve in curves.values()) - origin
    end = max(curve.times[-1] for curve in curves.values()) - origin
    grid[0, 0].set_xlim(start, end if end > start else start + 1)
    n_rows = len(rows)
    stacks = [
        list(grid[line * n_rows : (line + 1) * n_rows, column])
        for line in range(n_lines)
        for column in range(n_columns)
    ]
    return figure, stacks


def _any_slip(curves: Mapping[str, _Curves]) -> bool:
    return any(curve.slip is not None for curve in curves.values())


def _draw_finger(
    axes: Sequence[Axes], name: str, module: Tactile, curve: _Curves, origin: float
) -> None:
    unit = "counts" if module.unit == "count" else "N"
    for axis in axes:
        _shade(axis, module, origin)
        _style(axis)
    _draw_forces(axes[0], curve, origin)
    axes[0].set_title(name, fontsize=8.5, loc="left")
    axes[0].set_ylabel(f"force [{unit}]", fontsize=8)
    _line(axes[1], curve.times - origin, curve.features[:, SIGMA], INK)
    axes[1].set_ylabel(f"σ [{unit}]", fontsize=8)
    _scale(axes[1], curve.features[:, SIGMA])
    axes[-1].tick_params(labelbottom=True)
    if curve.slip is not None:
        times, speed = curve.slip
        _line(axes[2], times - origin, MM * speed, INK)
        axes[2].set_ylabel("slip [mm/s]", fontsize=8)
        axes[2].set_ylim(bottom=0)
    elif len(axes) > len(ROW_HEIGHTS) - 1:
        axes[2].set_yticks([])
        axes[2].text(
            0.5, 0.5, "slip not known", transform=axes[2].transAxes, fontsize=7.5, color=INK,
            ha="center", va="center",
        )  # fmt: skip


def _scale(axes: Axes, sigma: Array) -> None:
    """Linear, unless the peaks would hide all else: then logarithmic."""
    known = sigma[np.isfinite(sigma) & (sigma > 0)]
    if not len(known) or known.max() < WIDE * np.median(known):
        axes.set_ylim(bottom=0)
        return
    axes.set_yscale("log", nonpositive="clip")
    axes.set_ylim(np.quantile(known, 0.01) / 1.5, known.max() * 1.5)
    axes.yaxis.set_major_locator(LogLocator(numticks=4))
    axes.yaxis.set_minor_locator(NullLocator())


def _draw_forces(axes: Axes, curve: _Curves, origin: float) -> None:
    for name, colour in reversed(COMPONENT_COLOURS.items()):  # F_a lies under its components
        values = curve.features[:, FEATURE_NAMES.index(name)]
        _line(axes, curve.times - origin, values, colour, 1.5 if name == "F_a" else 0.9)
    axes.axhline(0, color=INK, linewidth=0.4, zorder=1)


def _line(axes: Axes, times: Array, values: Array, colour: str, width: float = 0.9) -> None:
    axes.plot(*envelope(times, values), color=colour, linewidth=width, zorder=2)


def _shade(axes: Axes, module: Tactile, origin: float) -> None:
    for label in module.labels:
        axes.axvspan(
            label.start - origin, label.end - origin,
            facecolor=STATE_COLOURS[label.state], edgecolor="none", linewidth=0, zorder=0,
        )  # fmt: skip


def _style(axes: Axes) -> None:
    axes.tick_params(labelsize=7, width=0.6, length=2.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_linewidth(0.6)
    axes.yaxis.set_major_locator(MaxNLocator(4))


def _draw_markers(axes: Sequence[Axes], recording: Recording, origin: float, named: bool) -> None:
    """A dotted line for each marker; its text above the first finger, where there is room."""
    left, right = axes[0].get_xlim()
    letter = 0.011 * (right - left)
    free = left + letter * (len(axes[0].get_title("left")) + 4)
    for time, text in sorted(recording.markers):
        at = time - origin
        if not left <= at <= right:
            continue
        for axis in axes:
            axis.axvline(at, color=INK, linewidth=0.7, linestyle=":", zorder=3)
        if named and at >= free and at + letter * len(text) <= right:
            axes[0].annotate(
                text, (at, 1), xycoords=("data", "axes fraction"), xytext=(0, 2),
                textcoords="offset points", fontsize=6.5, color=INK, ha="left", va="bottom",
            )  # fmt: skip
            free = at + letter * (len(text) + 2)


def _title(recording: Recording, tare: Tare, window: int) -> str:
    what = {
        "seconds": f"tare: first {tare.seconds:g} s",
        "first": "tare: first sample",
        "none": "no tare",
        "interval": f"tare: {tare.interval[0]:g} to {tare.interval[1]:g} s",
    }[tare.kind]
    return f"{recording.name}   ({what}, window of {window} samples)"


def _clock(origin: float) -> str:
    return "time [s]" if origin == 0 else f"time since {origin:.3f} s [s]"


def _legend(modules: Sequence[Tactile]) -> list[Artist]:
    seen = {label.state for module in modules for label in module.labels}
    names = {"F_x": "$F_x$", "F_y": "$F_y$", "F_z": "$F_z$", "F_a": "$F_a$"}
    lines: list[Artist] = [
        Line2D([], [], color=colour, linewidth=1.4, label=names[name])
        for name, colour in COMPONENT_COLOURS.items()
    ]
    return lines + [
        Patch(facecolor=colour, label=state.value.lower().replace("_", " "))
        for state, colour in STATE_COLOURS.items()
        if state in seen
    ]
