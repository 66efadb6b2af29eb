"""Signals that the labelling page plots: force and sigma at any zoom, and change points.

Zooming takes a few milliseconds: minima and maxima of 16, 256, ... neighbouring samples are
computed once. Edges of labels snap to change points. A change point is where the force begins or
ends to change: within the next instants it moves much farther than it moved in the instants
before, or the other way round.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.detection import DEFAULT_WINDOW, Tare, haar_features
from holdfast.detection.features import tared_force
from holdfast.detection.plan import TareArgument
from holdfast.recordings import GAP_PERIODS, Tactile
from holdfast.sensors.types import Array

SERIES = ("F_a", "F_x", "F_y", "F_z", "sigma")
"""Signals of a finger: amplitude and components of the force, and the instability."""

DEFAULT_POINTS = 1200
"""Horizontal positions on a page that does not give their number."""
MAX_POINTS = 10_000
"""Largest number of horizontal positions."""

PLOTTED_NUMBER = np.float32
"""Number type of the signals that are kept for plots: half the memory."""
SIGNIFICANT_DIGITS = 6
"""Digits of a value in JSON, far more than a screen shows."""

SMOOTHING_TIME = 0.03
"""Time over which the force is averaged before change points are detected [s]."""
COMPARED_TIME = 0.2
"""Time before and after an instant in which the movement of the force is compared [s]."""
MAX_COMPARED_STEPS = 16
"""Largest number of instants that are compared in each direction."""
MIN_DISTANCE = 0.1
"""Shortest time between two change points; the clearer one is kept [s]."""
MIN_RATIO = 2.5
"""Least ratio of the movement on one side to that on the other."""
MOVEMENT_NOISE_FACTOR = 2.0
"""Movement below this multiple of its median is noise."""
NOISE_SHARE = 0.01
"""Movement below this share of the largest force is noise, invisible on a plot."""

LEVEL_FACTOR = 16
"""Each level of minima and maxima has so many times fewer values than the one before."""
PART_SAMPLES = 1 << 16
"""Samples of which sigma and movements are computed at a time; it bounds the memory."""

Series = dict[str, list[float | None]]


class SignalPart(msgspec.Struct, frozen=True):
    """Signals of a part of a recording.

    Attributes:
        start: of the part [s].
        end: of the part [s].
        exact: whether all samples are included; otherwise minima and maxima of neighbours.
        fingers: by finger, `t` [s] and each of `SERIES`; None where a value is unknown. Where
            not `exact`, two values of a series belong to each block of neighbours: minimum and
            maximum, the earlier one first.
    """

    start: float
    end: float
    exact: bool
    fingers: dict[str, Series]


class FingerSignals:
    """Force and sigma of one finger, with minima and maxima at every zoom.

    Args:
        module: readings of the finger.
        tare: how the baseline is found; it is subtracted from earlier samples too.

    Raises:
        ValueError: the tare is unknown, or no finite sample lies in its time.
    """

    def __init__(self, module: Tactile, tare: TareArgument | Tare = 0.5) -> None:
        values = signal_values(module, tare, number=PLOTTED_NUMBER)
        # A row of NaN in every gap interrupts the line of a plot.
        self.times, self.values = module.times, values
        gaps = np.flatnonzero(np.diff(module.times) > GAP_PERIODS * module.period) + 1
        if len(gaps):
            middles = (module.times[gaps - 1] + module.times[gaps]) / 2
            self.times = np.insert(module.times, gaps, middles)
            self.values = np.insert(values, gaps, np.nan, axis=0)
        # Times and values: of all samples, then of minima and maxima of more and more of them.
        self._levels = [(self.times, self.values)]
        while len(self._levels[-1][0]) > 2 * LEVEL_FACTOR:
            self._levels.append(extremes(*self._levels[-1], 2 * LEVEL_FACTOR))

    def part(self, start: float, end: float, points: int) -> tuple[bool, Series]:
        """Return whether all samples are included, and the series between two times.

        One more sample is included on either side, so that lines reach the edges of a plot.

        Args:
            start: of the part [s].
            end: of the part [s].
            points: a series has at most twice as many values.
        """
        for times, values in reversed(self._levels):
            first = max(int(np.searchsorted(times, start)) - 1, 0)
            last = min(int(np.searchsorted(times, end, side="right")) + 1, len(times))
            # The coarsest level with enough values.
            if last - first >= 4 * points or times is self.times:
                part = times[first:last], values[first:last]
                break
        size = -(-(last - first) // points)
        return (True, _series(*part)) if size <= 2 else (False, _series(*extremes(*part, size)))


def extremes(
    times: Array, values: npt.NDArray[np.floating], size: int
) -> tuple[Array, npt.NDArray[np.floating]]:
    """Return two values of each block of neighbours: minimum and maximum, the earlier one first.

    A line through them goes the way that the values go, and so does one through extremes of
    extremes.

    Args:
        times: (n,) increasing [s].
        values: (n, n_series); NaN where one is unknown.
        size: number of neighbours in a block.

    Returns:
        The times of the first and last of each block (2 n_blocks,), and (2 n_blocks, n_series).

    Example:
        >>> extremes(np.arange(4.0), np.array([[3.0], [1.0], [2.0], [2.5]]), 4)[1].ravel().tolist()
        [3.0, 1.0]
    """
    n_blocks = -(-len(times) // size)
    filled = np.full((n_blocks * size, values.shape[1]), np.nan, values.dtype)
    filled[: len(values)] = values
    blocks = filled.reshape(n_blocks, size, -1)
    unknown = np.isnan(blocks)
    low = np.where(unknown, np.inf, blocks).argmin(axis=1)
    high = np.where(unknown, -np.inf, blocks).argmax(axis=1)
    indices = np.stack([np.minimum(low, high), np.maximum(low, high)], axis=1)
    kept = np.take_along_axis(blocks, indices, axis=1).reshape(2 * n_blocks, -1)
    begins = np.arange(n_blocks) * size
    ends = np.minimum(begins + size, len(times)) - 1
    return times[np.stack([begins, ends], axis=1).ravel()], kept


class Signals(NamedTuple):
    """Force and sigma of every finger of a recording.

    Attributes:
        start: of the recording [s].
        end: of the recording [s].
        fingers: signals by finger.
    """

    start: float
    end: float
    fingers: Mapping[str, FingerSignals]

    def part(
        self, start: float | None = None, end: float | None = None, points: float = DEFAULT_POINTS
    ) -> SignalPart:
        """Return the signals between two times.

        Args:
            start: of the part [s]; by default the start of the recording.
            end: of the part [s]; by default the end of the recording.
            points: horizontal positions on the page; a series has at most twice as many values.

        Raises:
            ValueError: the part ends before its start, or `points` is not 2 to `MAX_POINTS`.
        """
        first = self.start if start is None else start
        last = self.end if end is None else end
        if not (np.isfinite([first, last]).all() and first <= last):
            raise ValueError(f"an end after the start expected, [{first}, {last}] s given")
        if not 2 <= points <= MAX_POINTS:
            raise ValueError(f"2 to {MAX_POINTS} points expected, {points:g} given")
        parts = {
            name: finger.part(first, last, int(points)) for name, finger in self.fingers.items()
        }
        exact = all(complete for complete, _ in parts.values())
        return SignalPart(first, last, exact, {name: series for name, (_, series) in parts.items()})


def signal_values(
    module: Tactile,
    tare: TareArgument | Tare,
    window: int = DEFAULT_WINDOW,
    number: npt.DTypeLike = np.float64,
) -> npt.NDArray[np.floating]:
    """Return (n, n_series) force and sigma of every sample [unit of the readings].

    The baseline is subtracted from all samples, also during the tare. Unknown values are
    NaN.

    Args:
        module: readings of the finger.
        tare: how the baseline is found.
        window: N_w of sigma.
        number: type of the result; all is computed in float64.

    Raises:
        ValueError: the tare is unknown, or no finite sample lies in its time.
    """
    values = np.empty((module.n_samples, len(SERIES)), number)
    try:
        force = tared_force(module, tare, offline=True).force
    except ValueError:
        # A module without any finite sample has no tare, and is plotted as unknown.
        if np.isfinite(module.readings).all(axis=(1, 2)).any():
            raise
        force = np.full((module.n_samples, 3), np.nan)
    for start in range(0, module.n_samples, PART_SAMPLES):
        part = values[start : start + PART_SAMPLES]
        end, history = start + len(part), min(start, window - 1)
        part[:, 0] = np.linalg.norm(force[start:end], axis=1)
        part[:, 1:4] = force[start:end]
        part[:, 4] = haar_features(force[start - history : end], window)[history:, 5]
    return values


def _series(times: Array, values: npt.NDArray[np.floating]) -> Series:
    columns = zip(SERIES, rounded(np.asarray(values, dtype=np.float64)).T, strict=True)
    return {"t": times.tolist(), **{name: column.tolist() for name, column in columns}}


def rounded(values: Array) -> Array:
    """Round values to `SIGNIFICANT_DIGITS`, which makes JSON short.

    Example:
        >>> rounded(np.array([1234.56789, -0.000123456789, 0.0])).tolist()
        [1234.57, -0.000123457, 0.0]
    """
    size = np.abs(values)
    with np.errstate(divide="ignore", over="ignore"):
        power = np.where(size > 0, SIGNIFICANT_DIGITS - 1 - np.floor(np.log10(size)), 0.0)
        power = np.clip(np.nan_to_num(power), -300, 300)
        scale = 10.0 ** np.abs(power)
        finer, coarser = np.rint(values * scale) / scale, np.rint(values / scale) * scale
    return np.asarray(np.where(power >= 0, finer, coarser))


def change_points(times: Array, force: npt.NDArray[np.floating], period: float) -> Array:
    """Return the times at which the force on a finger begins or ends to change.

    Args:
        times: (n,) strictly increasing [s].
        force: (n, 3) [any unit]; NaN where it is unknown.
        period: of the samples [s].

    Returns:
        Increasing times [s].

    Example:
        >>> times = np.arange(300) / 150
        >>> ramp = np.clip((times - 0.5) / 0.5, 0, 1)
        >>> force = np.column_stack([ramp, 0 * ramp, 0 * ramp])
        >>> change_points(times, force, 1 / 150).round(2).tolist()
        [0.49, 1.01]
    """
    from scipy.ndimage import maximum_filter1d, uniform_filter1d

    is_finite = np.isfinite(force).all(axis=1)
    known_times, values = (
        (times, force) if is_finite.all() else (times[is_finite], force[is_finite])
    )
    n = max(round(COMPARED_TIME / period), 1)
    if len(known_times) <= 2 * n:
        return np.empty(0)
    values = uniform_filter1d(values, 2 * round(SMOOTHING_TIME / period / 2) + 1, axis=0)
    after, before = _movements(values, n)
    zero = np.broadcast_to(np.zeros_like(values[0]), values.shape)
    largest = float(np.quantile(_distances(values, zero), 0.99))
    tiny = float(np.finfo(float).tiny)
    noise = max(MOVEMENT_NOISE_FACTOR * float(np.median(after)), NOISE_SHARE * largest, tiny)
    after += noise
    before += noise
    contrast = np.divide(after, before, out=after)  # in place: a recording may be hours long
    np.abs(np.log(contrast, out=contrast), out=contrast)
    width = 2 * max(round(MIN_DISTANCE / period), 1) + 1
    peaks = (contrast >= math.log(MIN_RATIO)) & (contrast == maximum_filter1d(contrast, width))
    return np.asarray(known_times[peaks])


def _movements(force: npt.NDArray[np.floating], n: int) -> tuple[Array, Array]:
    """Return (n_samples,) mean distances of the force to its next n samples, and to its last n.

    Before the first and after the last sample the force is taken as constant.
    """
    steps = np.unique(np.linspace(1, n, min(n, MAX_COMPARED_STEPS)).round().astype(int))
    after, before = np.zeros(len(force)), np.zeros(len(force))
    for step in steps.tolist():
        moved = _distances(force[step:], force[:-step])
        after[:-step] += moved
        before[step:] += moved
        after[-step:] += np.linalg.norm(force[-1] - force[-step:], axis=1)
        before[:step] += np.linalg.norm(force[0] - force[:step], axis=1)
    after /= len(steps)
    before /= len(steps)
    return after, before


def _distances(a: npt.NDArray[np.floating], b: npt.NDArray[np.floating]) -> Array:
    """Return (n,) distances of the rows of two arrays, computed in parts to bound the memory."""
    distances = np.empty(len(a))
    for start in range(0, len(a), PART_SAMPLES):
        part = slice(start, start + PART_SAMPLES)
        distances[part] = np.linalg.norm(a[part] - b[part], axis=1)
    return distances
