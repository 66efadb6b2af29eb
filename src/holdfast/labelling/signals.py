"""What a page draws of a recording: force and sigma at any zoom, in a few milliseconds."""

from collections.abc import Mapping
from typing import NamedTuple

import msgspec
import numpy as np

from holdfast.features import Tare, fingertip_force, haar_features
from holdfast.features.tare import TareArgument
from holdfast.recordings import GAP_PERIODS, Recording, Tactile
from holdfast.sensors.types import Array

SERIES = ("F_a", "F_x", "F_y", "F_z", "sigma")
"""What is drawn of a finger: the amplitude of its force, its components, the instability."""

POINTS = 1200
"""Places side by side on a page, where nobody says how many."""
MOST_POINTS = 10_000

DIGITS = 6
"""Digits of a value that are told: far more than a screen has."""

BLOCK = 16_384
"""Samples whose readings are turned into force at a time: memory stays small."""

Series = dict[str, list[float | None]]


class Drawn(msgspec.Struct, frozen=True):
    """Part of a recording, to be drawn.

    Attributes:
        start: of the part [s].
        end: of the part [s].
        exact: every sample is told; otherwise the least and the most of each few.
        fingers: by finger, `t` [s] and each of `SERIES`; None where it is not known.
    """

    start: float
    end: float
    exact: bool
    fingers: dict[str, Series]


class _Level(NamedTuple):
    """Neighbouring samples by twos, fours, eights, ...: the least and the most of each.

    Attributes:
        times: (n, 2) of the first sample, and of one half way to the last [s].
        low: (n, n_series); NaN where there are none.
        high: the same.
    """

    times: Array
    low: Array
    high: Array


class FingerSignals:
    """Force and sigma of one finger, and a pyramid of them.

    Args:
        module: readings of the finger.
        tare: how the baseline is found; it counts for the time before it too.

    Raises:
        ValueError: the tare finds no samples.
    """

    def __init__(self, module: Tactile, tare: TareArgument | Tare = 0.5) -> None:
        self.times, self.values = _with_gaps(module, _values(module, Tare.parse(tare)))
        self._levels: list[_Level] = []
        level = _Level(np.column_stack([self.times, self.times]), self.values, self.values)
        while len(level.times) > 2:
            level = _halved(level)
            self._levels.append(level)

    def draw(self, start: float, end: float, points: int) -> tuple[bool, Series]:
        """Whether every sample is told, and the series between two times [s].

        One sample more is told on either side, so that lines reach the edges.

        Args:
            start: of what is drawn [s].
            end: of what is drawn [s].
            points: at most twice as many values a series.
        """
        first = max(int(np.searchsorted(self.times, start)) - 1, 0)
        last = min(int(np.searchsorted(self.times, end, side="right")) + 1, len(self.times))
        n = last - first
        if n <= 2 * points:
            return True, _series(self.times[first:last], self.values[first:last])
        depth = max(int(np.ceil(np.log2(n / max(points - 2, 1)))), 1)
        depth = min(depth, len(self._levels))
        level = self._levels[depth - 1]
        part = slice(first >> depth, ((last - 1) >> depth) + 1)
        pairs = np.stack([level.low[part], level.high[part]], axis=1)
        return False, _series(level.times[part].ravel(), pairs.reshape(-1, len(SERIES)))


class Signals:
    """Force and sigma of every finger of a recording, computed once.

    Args:
        recording: whose samples are drawn.
        tare: how the baseline is found.

    Raises:
        ValueError: an unknown tare, or it finds no samples.
    """

    def __init__(self, recording: Recording, tare: TareArgument | Tare = 0.5) -> None:
        self.start, self.end = recording.start, recording.end
        self.fingers: Mapping[str, FingerSignals] = {
            name: FingerSignals(module, tare) for name, module in recording.modules.items()
        }

    def draw(
        self, start: float | None = None, end: float | None = None, points: float = POINTS
    ) -> Drawn:
        """What is to be drawn between two times.

        Args:
            start: of the part [s]; that of the recording by default.
            end: of the part [s]; that of the recording by default.
            points: places side by side on the page; twice as many values a series at most.

        Raises:
            ValueError: the part does not end after its start, or another number of points
                than 2 to `MOST_POINTS`.
        """
        first = self.start if start is None else start
        last = self.end if end is None else end
        if not (np.isfinite([first, last]).all() and first <= last):
            raise ValueError(f"a part ends after its start; [{first}, {last}] s given")
        if not 2 <= points <= MOST_POINTS:
            raise ValueError(f"2 to {MOST_POINTS} points expected, {points:g} given")
        n = int(points)
        drawn = {name: each.draw(first, last, n) for name, each in self.fingers.items()}
        exact = all(one for one, _ in drawn.values())
        return Drawn(first, last, exact, {name: series for name, (_, series) in drawn.items()})


def _values(module: Tactile, tare: Tare) -> Array:
    """(n, n_series) force and sigma at every sample; NaN where they are not known."""
    force = _force(module, tare)
    sigma = haar_features(force)[:, 5:]
    return np.concatenate([np.linalg.norm(force, axis=1, keepdims=True), force, sigma], axis=1)


def _force(module: Tactile, tare: Tare) -> Array:
    """(n, 3) force with one baseline for all samples, those that it is taken from among them.

    The force is linear in the readings: that of the baseline is the mean of the forces in its
    time, and no reading need be touched twice.
    """
    force = np.empty((module.n_samples, 3))
    for row in range(0, module.n_samples, BLOCK):
        part = slice(row, row + BLOCK)
        readings, times = module.readings[part], module.times[part]
        force[part] = fingertip_force(readings, module.sensor, "none", times)
    taken = np.isfinite(force).all(axis=1)
    if tare.kind == "none" or not taken.any():
        return force
    first = int(taken.argmax())
    start, end = float(module.times[first]), float(module.times[first]) + tare.seconds
    if tare.kind == "interval":
        start, end = tare.interval
    inside = taken & (module.times >= start) & (module.times < end)
    if tare.kind != "interval":
        inside[first] = True  # one sample at least
    if not inside.any():
        raise ValueError(f"tare {tare}: no finite sample in that time")
    return np.asarray(force - force[inside].mean(axis=0))


def _with_gaps(module: Tactile, values: Array) -> tuple[Array, Array]:
    """Times and values with a row of NaN in every gap, over which no line is drawn."""
    times = module.times
    gaps = np.flatnonzero(np.diff(times) > GAP_PERIODS * module.period) + 1
    if not len(gaps):
        return times, values
    middles = (times[gaps - 1] + times[gaps]) / 2
    return np.insert(times, gaps, middles), np.insert(values, gaps, np.nan, axis=0)


def _halved(level: _Level) -> _Level:
    """The level above: two neighbours become one; the last may stay alone."""
    n = len(level.times) // 2 * 2
    times = np.column_stack([level.times[0:n:2, 0], level.times[1:n:2, 0]])
    low = np.fmin(level.low[0:n:2], level.low[1:n:2])
    high = np.fmax(level.high[0:n:2], level.high[1:n:2])
    if n == len(level.times):
        return _Level(times, low, high)
    halves = zip((times, low, high), level, strict=True)
    return _Level(*(np.concatenate([half, own[n:]]) for half, own in halves))


def _series(times: Array, values: Array) -> Series:
    told = rounded(values)
    columns = zip(SERIES, told.T, strict=True)
    return {"t": times.tolist(), **{name: column.tolist() for name, column in columns}}


def rounded(values: Array) -> Array:
    """The values to `DIGITS` significant digits, which are short to write.

    Example:
        >>> rounded(np.array([1234.56789, -0.000123456789, 0.0])).tolist()
        [1234.57, -0.000123457, 0.0]
    """
    size = np.abs(values)
    with np.errstate(divide="ignore", over="ignore"):
        power = np.where(size > 0, DIGITS - 1 - np.floor(np.log10(size)), 0.0)
        power = np.clip(np.nan_to_num(power), -300, 300)
        scale = 10.0 ** np.abs(power)
        finer, coarser = np.rint(values * scale) / scale, np.rint(values / scale) * scale
    return np.asarray(np.where(power >= 0, finer, coarser))
