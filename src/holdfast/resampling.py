"""Resample recordings and streams to another rate."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from holdfast.errors import StreamError
from holdfast.recordings import GAP_PERIODS, Recording, Tactile
from holdfast.sensors.types import Array, Integers

TOLERANCE_PERIODS = 1e-3
"""Tolerance of times in periods of the new rate. The rounding of times, 1e-7 s since 1970, then
moves no sample."""


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
    modules = {name: _resample(module, rate) for name, module in recording.modules.items()}
    return replace(recording, modules=modules)


def _resample(module: Tactile, rate: float) -> Tactile:
    if not module.n_samples:
        return module
    cuts = np.flatnonzero(np.diff(module.times) > GAP_PERIODS * module.period) + 1
    bounds = [0, *cuts.tolist(), module.n_samples]
    pieces = [_resample_stretch(module, first, last, rate) for first, last in pairwise(bounds)]
    times = np.concatenate([times for times, _ in pieces])
    readings = np.concatenate([readings for _, readings in pieces])
    bare = replace(module, times=times, readings=readings, labels=())
    end = float(times[-1]) + bare.period  # labels may reach past what the new samples reach
    labels = [replace(x, end=min(x.end, end)) for x in module.labels if x.start < end]
    return replace(bare, labels=tuple(labels))


def _resample_stretch(module: Tactile, first: int, last: int, rate: float) -> tuple[Array, Array]:
    times = module.times[first:last]
    readings = np.asarray(module.readings[first:last], dtype=np.float64)
    reached = ((times - times[0] + TOLERANCE_PERIODS / rate) * rate).astype(np.int64)
    if rate * module.period >= 1:
        return _interpolated(times, readings, reached, rate)
    return _averaged(times, readings, reached, rate)


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
