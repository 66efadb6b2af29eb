"""Resample recordings and streams to another rate, or to the true updates of their sensor."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.errors import StreamError
from holdfast.recordings import GAP_PERIODS, Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Flags, Integers

TOLERANCE_PERIODS = 1e-3
"""Tolerance of times in periods of the new rate. The rounding of times, 1e-7 s since 1970, then
moves no sample."""

RATE_TOLERANCE = 0.2
"""A rate that differs from the model's by at most this share is taken as it is."""
MIN_ROWS_PER_UPDATE = 1.5
"""Least number of rows from one change of the readings to the next of a sample-and-hold sensor."""
EVEN_SHARE = 0.95
"""Minimum share of the changes of such a sensor that follow after even numbers of rows."""
MIN_UPDATE_RATE = 30.0
"""Rate of the updates below which a sensor is slow [Hz]: the least of `builtin:any`."""
MIN_COMPARED_TAXELS, CHANGED_SHARE = 4, 0.5
"""Taxels from which a sensor shows that it updates all at once: at least this share of them."""
MIN_HELD_UPDATES = 4
"""Minimum number of steps between changes that show how a sensor updates."""
LATE_UPDATE = 1.6
"""Periods of the updates after which a reading that is still the same counts as a sample."""
HELD_ROWS = 4096
"""Rows at the beginning of a recording that show whether its sensors hold their samples."""


def rows_per_update(changed: Sequence[bool] | Flags) -> float:
    """Return how many rows a sensor holds each of its samples; 1 if it does not.

    A sensor that holds its samples changes its readings after even numbers of rows, but for one.
    One that rests, or whose noise is less than a step, changes them at random.

    Args:
        changed: whether each row differs from the one before; the first does not count.

    Example:
        >>> rows_per_update([True, False, False, False] * 6)
        4.0
        >>> rows_per_update([True, True, True, False] * 6)
        1.0
    """
    steps = np.diff(np.flatnonzero(changed[1:]))  # the sensor may have held the first before
    if len(steps) < MIN_HELD_UPDATES:
        return 1.0
    n_of = np.bincount(steps, minlength=3)
    shorter = int(np.argmax(n_of[:-1] + n_of[1:]))
    even = steps[(steps == shorter) | (steps == shorter + 1)]
    if len(even) < EVEN_SHARE * len(steps) or even.mean() < MIN_ROWS_PER_UPDATE:
        return 1.0
    return float(even.mean())


def held_rows(readings: Array, sensor: Sensor, rate: float) -> float | None:
    """Return how many rows a sensor holds each of its samples; 1 if it does not.

    A slow one may update at uneven times: whenever a reading changes, most taxels do. Zeros of all
    taxels are no update of a sensor that does not rest at zero: it was read too early.

    Args:
        readings: (n, n_taxels, 3).
        sensor: of the readings.
        rate: of the rows [Hz].

    Returns:
        None if no reading changes.
    """
    rows = np.arange(len(readings))
    if not sensor.rests_at_zero:
        rows = np.maximum.accumulate(np.where(readings.any(axis=(1, 2)), rows, 0))
    newer, older = readings[rows[1:]], readings[rows[:-1]]
    differ = differing_taxels(newer, older)
    changed = differ.any(axis=1)
    if not changed.any():
        return None
    # The first row is an update whatever it is.
    n_rows = rows_per_update(np.append(True, changed))
    steps = np.diff(np.flatnonzero(changed))
    if n_rows > 1.0 or len(steps) < MIN_HELD_UPDATES or sensor.n_taxels < MIN_COMPARED_TAXELS:
        return n_rows
    typical = float(np.median(steps))
    at_once = (differ[changed].mean(axis=1) >= CHANGED_SHARE).mean() >= EVEN_SHARE
    is_slow = typical >= MIN_ROWS_PER_UPDATE and rate / typical < MIN_UPDATE_RATE
    return typical if is_slow and at_once else 1.0


def differing_taxels(newer: npt.NDArray[Any], older: npt.NDArray[Any]) -> Flags:
    """Return (..., n_taxels) whether readings (..., n_taxels, 3) differ; NaN is the same as NaN."""
    differ = (newer != older) & ~(np.isnan(newer) & np.isnan(older))
    return np.asarray(differ.any(axis=-1))


class UpdateFilter:
    """Filter that drops the repeated samples of a sample-and-hold sensor, row by row.

    A reading that remains the same for longer than an update takes is a sample again, so that a
    sensor that stands still is found.

    Args:
        rate: of the updates [Hz].
        skips_zeros: zeros of all taxels are no update.

    Example:
        >>> repeats = UpdateFilter(rate=10.0)
        >>> [repeats.is_update(k / 40, np.full((1, 3), k // 4)) for k in range(6)]
        [True, False, False, False, True, False]
    """

    def __init__(self, rate: float, *, skips_zeros: bool = False) -> None:
        self._longest, self._skips_zeros = LATE_UPDATE / rate, skips_zeros
        self._time = -np.inf
        self._reading: npt.NDArray[Any] = np.empty(0)

    def is_update(self, time: float, reading: npt.ArrayLike) -> bool:
        """Return whether a row is a sample: it has changed, or it is late [s]."""
        if time - self._time < self._longest and (
            np.array_equal(self._reading, reading, equal_nan=True)
            or (self._skips_zeros and not np.any(reading))
        ):
            return False
        self._time, self._reading = time, np.array(reading)
        return True


def true_updates(recording: Recording) -> Recording:
    """Return the recording with the true updates of its sensors, if all of them hold samples.

    A sensor that updates at 50 Hz in rows of 200 Hz repeats each reading four times. The rows
    between are no samples: in their features the motion would be slower, with pauses. A slow
    sensor, under 30 Hz, gets its true updates also beside sensors that do not hold their samples.

    Returns:
        The same object if a sensor does not hold its samples, and none is slow.
    """
    modules = {name: module for name, module in recording.modules.items() if module.n_samples}
    held = {
        name: held_rows(module.readings[:HELD_ROWS], module.sensor, module.rate)
        for name, module in modules.items()
    }
    counted_rows = [n_rows for n_rows in held.values() if n_rows is not None]
    every = min(counted_rows, default=1.0) > 1.0
    updates = {}
    for name, module in modules.items():
        n_rows = held[name] or (min(counted_rows) if every else 1.0)
        rate = 1 / (n_rows * module.period)
        if n_rows == 1.0 or not (every or rate < MIN_UPDATE_RATE):
            continue
        repeats = UpdateFilter(rate, skips_zeros=not module.sensor.rests_at_zero)
        rows = zip(module.times.tolist(), module.readings, strict=True)
        kept = [repeats.is_update(time, reading) for time, reading in rows]
        times, readings = module.times[kept], module.readings[kept]
        updates[name] = replace(module, times=times, readings=readings)
    if not updates:
        return recording
    return replace(recording, modules={**recording.modules, **updates})


def at_rate(recording: Recording, rate: float | None) -> Recording:
    """Return the true updates of a recording, resampled unless their rate is near another.

    Args:
        recording: at any rate.
        rate: of a model [Hz]; None for one of any rate. Within 20 % of it nothing is resampled.
    """
    # The true updates first: the rows of a sensor that holds its samples are no rate of its own.
    recording = true_updates(recording)
    if rate is None or abs(recording.rate / rate - 1) <= RATE_TOLERANCE:
        return recording
    return resample(recording, rate)


def resample(recording: Recording, rate: float) -> Recording:
    """Return the recording with every module at another rate.

    From a slower source, samples are interpolated linearly. From a faster source, each new
    sample is the mean of the samples since the new sample before, so that noise and vibration
    are not aliased. Each stretch between gaps begins at its own first sample. Labels stay as they
    are, up to the last sample. Every new sample depends only on samples up to the first one at
    or after its time, so `Resampler` gives the same result live.

    Args:
        recording: at any rate.
        rate: new rate [Hz].

    Raises:
        ValueError: the rate is not above 0.
    """
    _check_rate(rate)
    modules = dict(recording.modules)
    for name, module in recording.modules.items():
        if not module.n_samples:
            continue
        cuts = np.flatnonzero(np.diff(module.times) > GAP_PERIODS * module.period) + 1
        bounds = [0, *cuts.tolist(), module.n_samples]
        pieces = []
        for first, last in pairwise(bounds):
            stretch_times = module.times[first:last]
            values = np.asarray(module.readings[first:last], dtype=np.float64)
            reached = ((stretch_times - stretch_times[0] + TOLERANCE_PERIODS / rate) * rate).astype(
                np.int64
            )
            change = _interpolated if rate * module.period >= 1 else _averaged
            pieces.append(change(stretch_times, values, reached, rate))
        times = np.concatenate([times for times, _ in pieces])
        readings = np.concatenate([readings for _, readings in pieces])
        bare = replace(module, times=times, readings=readings, labels=())
        end = float(times[-1]) + bare.period  # labels may reach past what the new samples reach
        labels = [replace(x, end=min(x.end, end)) for x in module.labels if x.start < end]
        modules[name] = replace(bare, labels=tuple(labels))
    return replace(recording, modules=modules)


def _interpolated(
    times: Array, readings: Array, reached: Integers, rate: float
) -> tuple[Array, Array]:
    """Interpolate a slower source between the samples before and after each new sample."""
    steps = np.arange(1, reached[-1] + 1)
    after = np.searchsorted(reached, steps)
    wanted = times[0] + steps / rate
    share = (wanted - times[after - 1]) / (times[after] - times[after - 1])
    share = np.clip(share, 0, 1)[:, None, None]
    between = (1 - share) * readings[after - 1] + share * readings[after]
    return np.concatenate([times[:1], wanted]), np.concatenate([readings[:1], between])


def _averaged(times: Array, readings: Array, reached: Integers, rate: float) -> tuple[Array, Array]:
    """Average a faster source since the new sample before, where there are any samples."""
    closing = np.diff(reached, prepend=-1) > 0
    on_time = times <= times[0] + reached / rate + TOLERANCE_PERIODS / rate
    steps = np.where(closing & on_time, reached, reached + 1)  # new sample of each old one
    steps = steps[steps <= reached[-1]]
    kept, starts, counts = np.unique(steps, return_index=True, return_counts=True)
    sums = readings[starts]
    for k in range(1, int(counts.max())):  # one after the other, with the same rounding as live
        more = counts > k
        sums[more] += readings[starts[more] + k]
    return times[0] + kept / rate, sums / counts[:, None, None]


class Resampler:
    """Resampler of one module, sample by sample, with the same result as `resample`.

    Args:
        source_rate: measured rate of the module [Hz].
        rate: new rate [Hz].

    Raises:
        ValueError: a rate is not above 0.

    Example:
        >>> resampler = Resampler(source_rate=200.0, rate=100.0)
        >>> [resampler.push(k / 200, np.full((1, 3), k)) != [] for k in range(5)]
        [True, False, True, False, True]
    """

    def __init__(self, source_rate: float, rate: float) -> None:
        for checked in (source_rate, rate):
            _check_rate(checked)
        self._rate = rate
        self._gap = GAP_PERIODS / source_rate
        self._push = self._interpolate if rate / source_rate >= 1 else self._average
        self._start = self._last = -np.inf
        self._step = 0  # the next new sample
        self._reading: Array = np.empty(0)  # the last one; the sum, where samples are averaged
        self._n_summed = 0

    def push(self, time: float, reading: npt.ArrayLike) -> list[tuple[float, Array]]:
        """Process a sample.

        Args:
            time: of the sample, later than the last [s].
            reading: (n_taxels, 3) [count or N].

        Returns:
            Time [s] and reading of each new sample that is complete now, oldest first.

        Raises:
            StreamError: the time does not increase.
        """
        time = float(time)
        if not self._last < time < np.inf:
            after = "" if self._last == -np.inf else f" after {self._last:.15g} s"
            raise StreamError(f"time {time:.15g} s given{after}; finite, increasing times expected")
        values = np.array(reading, dtype=np.float64)
        # The first sample of a stretch is a new sample; nothing is interpolated over a gap.
        if time - self._last > self._gap:
            self._start, self._step, self._n_summed = time, 1, 0
            self._last, self._reading = time, values
            return [(time, values.copy())]
        reached = int((time - self._start + TOLERANCE_PERIODS / self._rate) * self._rate)
        samples = self._push(time, values, reached)
        self._last = time
        return samples

    def _interpolate(self, time: float, values: Array, reached: int) -> list[tuple[float, Array]]:
        samples = []
        while self._step <= reached:
            wanted = self._start + self._step / self._rate
            share = min(max((wanted - self._last) / (time - self._last), 0.0), 1.0)
            samples.append((wanted, (1 - share) * self._reading + share * values))
            self._step += 1
        self._reading = values
        return samples

    def _average(self, time: float, values: Array, reached: int) -> list[tuple[float, Array]]:
        samples = []
        on_time = time <= self._start + reached / self._rate + TOLERANCE_PERIODS / self._rate
        if reached >= self._step:
            if self._n_summed and (reached > self._step or not on_time):
                samples.append(self._mean(self._step))
            self._step = reached + 1
            if on_time:
                self._add(values)
                return [*samples, self._mean(reached)]
        self._add(values)
        return samples

    def _add(self, values: Array) -> None:
        self._reading = self._reading + values if self._n_summed else values
        self._n_summed += 1

    def _mean(self, step: int) -> tuple[float, Array]:
        mean = self._reading / self._n_summed
        self._n_summed = 0
        return self._start + step / self._rate, mean


def _check_rate(rate: float) -> None:
    if not (np.isfinite(rate) and rate > 0):
        raise ValueError(f"a rate above 0 Hz expected, {rate} given")
