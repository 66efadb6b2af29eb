"""Curves and shades over time, which the figures of recordings and of experiments share."""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from holdfast.detection import DEFAULT_WINDOW, FEATURE_NAMES, Tare
from holdfast.detection.features import stretch_features, tared_force
from holdfast.plots.style import COMPONENT_COLOURS, INK
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

StateCodes = npt.NDArray[np.integer[Any]]

LOG_SCALE_RATIO = 15.0
"""Sigma has a logarithmic axis if its maximum is this many times its median."""
N_STRETCHES = 1500
"""Number of stretches of a long curve; the minimum and the maximum of each are drawn."""


class FingerSeries(NamedTuple):
    """Force, features and labels of one finger over one recording.

    Attributes:
        name: of the finger, or of recording and finger.
        times: (n,) [s].
        force: (n, 3) F_tip [unit].
        amplitude: (n,) F_a [unit].
        mean: (n,) m [unit]; NaN without a full window.
        sigma: (n,) [unit]; NaN without a full window.
        labels: (n,) state codes; UNKNOWN without a label.
        phases: (n,) phase of the experiment; empty where it is not known.
        unit: of the readings, "count" or "N".
        gaps: positions of the first samples after a gap, where curves are interrupted.
        slip: times [s] and slip speed [m/s], if the recording has them.
    """

    name: str
    times: Array
    force: Array
    amplitude: Array
    mean: Array
    sigma: Array
    labels: StateCodes
    phases: npt.NDArray[np.str_]
    unit: str = "count"
    gaps: StateCodes = np.empty(0, dtype=np.int64)
    slip: tuple[Array, Array] | None = None

    @property
    def unit_label(self) -> str:
        """Unit as it stands in a label of an axis."""
        return "[counts]" if self.unit == "count" else f"[{self.unit}]"


def finger_series(
    recording: Recording, finger: str, tare: Tare, window: int = DEFAULT_WINDOW
) -> FingerSeries:
    """Return the series of a finger of a recording.

    Args:
        recording: with ground truth, if phases and slip are to be known.
        finger: name of the module.
        tare: how the baseline is found.
        window: N_w [samples].

    Raises:
        ValueError: no finite sample lies in the time of the tare.
    """
    module, truth = recording.modules[finger], recording.truth
    if np.isfinite(module.readings).all(axis=(1, 2)).any():
        force = tared_force(module, tare).force
    else:  # nothing to take a tare from: drawn as unknown
        force = np.full((module.n_samples, 3), np.nan)
    phases, slip = np.full(module.n_samples, ""), None
    if truth is not None and "phase" in truth.hand and len(truth.times):
        # The truth has its own times: its latest sample that is not later.
        latest = np.searchsorted(truth.times, module.times, side="right") - 1
        phases = np.asarray(truth.hand["phase"])[np.clip(latest, 0, None)].astype(str)
    if truth is not None and "slip_speed" in truth.fingers.get(finger, {}):
        slip = truth.times, truth.fingers[finger]["slip_speed"]
    features, gaps = stretch_features(module, force, window)
    return FingerSeries(
        name=finger,
        times=module.times,
        force=force,
        amplitude=np.asarray(np.linalg.norm(force, axis=1)),
        mean=features[:, FEATURE_NAMES.index("m")],
        sigma=features[:, FEATURE_NAMES.index("sigma")],
        labels=module.label_states,
        phases=phases,
        unit=str(module.unit),
        gaps=gaps,
        slip=slip,
    )


def envelope(times: Array, values: Array, n_stretches: int = 2000) -> tuple[Array, Array]:
    """Return the minimum and the maximum of each of `n_stretches` stretches of samples.

    The earlier one comes first, so that a curve of them looks like the curve of all samples: what
    falls is drawn falling. Short curves are returned unchanged.

    Args:
        times: (n,) [s].
        values: (n,) of any unit; NaN if unknown.
        n_stretches: number of stretches; each gives two points.

    Returns:
        Times of the first and the last sample of each stretch, and values, (2 n_stretches,); NaN
        where a stretch has no value.

    Example:
        >>> times, values = envelope(np.arange(6.0), np.array([0, 1, 2, 9, -9, 0.0]), 2)
        >>> times.tolist(), values.tolist()
        ([0.0, 2.0, 3.0, 5.0], [0.0, 2.0, 9.0, -9.0])
    """
    n = len(values)
    if n <= 2 * n_stretches:
        return times, values
    edges = np.linspace(0, n, n_stretches + 1).astype(int)
    # fmin and fmax pass over NaN: one unknown sample hides no stretch.
    low = np.fmin.reduceat(values, edges[:-1])
    high = np.fmax.reduceat(values, edges[:-1])
    falls = _first_of_each(values, high, edges) < _first_of_each(values, low, edges)
    pairs = np.where(falls, [high, low], [low, high])
    ends = times[np.stack([edges[:-1], edges[1:] - 1], axis=1)]
    return ends.ravel(), pairs.T.ravel()


def _first_of_each(values: Array, extremes: Array, edges: StateCodes) -> StateCodes:
    """Return the position of the first sample of each stretch that equals its extreme.

    Without one, because the extreme is NaN, it is that of a later stretch, or the last edge.
    """
    indices = np.flatnonzero(values == np.repeat(extremes, np.diff(edges)))
    return np.append(indices, len(values))[np.searchsorted(indices, edges[:-1])]


def draw_curve(
    axes: Axes, series: FingerSeries, values: Array, colour: str, width: float = 1.0
) -> None:
    """Draw (n,) values of a finger over time, interrupted at gaps."""
    # A NaN interrupts a line of matplotlib.
    times = np.insert(series.times, series.gaps, series.times[series.gaps - 1])
    draw_line(axes, times, np.insert(values, series.gaps, np.nan), colour, width)


def draw_line(
    axes: Axes, times: Array, values: Array, colour: str = INK, width: float = 1.0
) -> None:
    """Draw values over time; of a long curve the envelope."""
    axes.plot(*envelope(times, values, N_STRETCHES), color=colour, linewidth=width, zorder=2)


def draw_components(axes: Axes, series: FingerSeries) -> None:
    """Draw the components of the fingertip force, and the zero line."""
    for column, name in enumerate(("F_x", "F_y", "F_z")):
        draw_curve(axes, series, series.force[:, column], COMPONENT_COLOURS[name])
    axes.axhline(0, color=INK, linewidth=0.4, zorder=1)


def draw_sigma(axes: Axes, series: FingerSeries) -> None:
    """Draw sigma; on a logarithmic axis if peaks would flatten everything else."""
    draw_curve(axes, series, series.sigma, INK, 0.8)
    sigma = series.sigma[np.isfinite(series.sigma) & (series.sigma > 0)]
    if not len(sigma) or sigma.max() <= LOG_SCALE_RATIO * np.median(sigma):
        axes.set_ylim(bottom=0)
        axes.yaxis.set_major_locator(MaxNLocator(4))
        return
    # From the 0.5 % quantile: single values near 0 would take most of a logarithmic axis.
    axes.set_yscale("log", nonpositive="clip")
    axes.set_ylim(np.quantile(sigma, 0.005) / 1.5, sigma.max() * 1.5)
    axes.yaxis.set_major_locator(LogLocator(numticks=4))
    axes.yaxis.set_minor_locator(NullLocator())


def equal_spans(times: Array, values: npt.NDArray[Any]) -> Iterator[tuple[int, float, float]]:
    """Yield the position of the first sample, the start and the end [s] of each equal run."""
    if len(times) < 2:
        return
    period = float(np.median(np.diff(times)))
    ends = np.append(times[1:], times[-1] + period)
    for first, stop in equal_runs(values):
        yield first, float(times[first]), float(ends[stop - 1])


def equal_runs(values: npt.NDArray[Any]) -> Iterator[tuple[int, int]]:
    """Yield the first position and the end of each run of equal values.

    Example:
        >>> list(equal_runs(np.array([3, 3, 1])))
        [(0, 2), (2, 3)]
    """
    edges = np.flatnonzero(values[1:] != values[:-1]) + 1
    return pairwise([0, *edges.tolist(), len(values)]) if len(values) else iter(())


def component_handles(names: Iterable[str] = ("F_x", "F_y", "F_z")) -> list[Artist]:
    """Return the legend handles of components of the force."""
    return [line_handle(COMPONENT_COLOURS[name], f"${name}$") for name in names]


def line_handle(colour: str, label: str) -> Line2D:
    """Return the legend handle of a curve."""
    return Line2D([], [], color=colour, linewidth=1.4, label=label)
