"""Recordings at another rate."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from holdfast.recordings import GAP_PERIODS, Recording, Tactile
from holdfast.sensors.values import Array

TOLERANCE = 1e-3
"""Of a period of the wanted rate: rounding of times, 1e-7 s since 1970, moves no sample."""


def resample(recording: Recording, rate: float) -> Recording:
    """The recording with every module at another rate.

    Linear between samples; where the source is faster, each new sample is the mean of those
    since the one before, so that noise and vibration do not fold. Each stretch between gaps
    begins at its own first sample; labels stay as they are, up to the last sample. Every value
    rests on samples up to the first one at or after its time, so it can be had live.

    Args:
        recording: at any rate.
        rate: wanted [Hz].

    Raises:
        ValueError: a rate that is not above 0.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise ValueError(f"a rate above 0 Hz expected, {rate} given")
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
    tolerance = TOLERANCE / rate
    n_steps = int((times[-1] - times[0] + tolerance) * rate)
    wanted = times[0] + np.arange(n_steps + 1) / rate
    if rate * module.period >= 1:  # slower source: linear between its samples
        after = np.clip(np.searchsorted(times, wanted), 1, max(len(times) - 1, 1))
        if len(times) == 1:
            return wanted[:1], readings
        share = (wanted - times[after - 1]) / (times[after] - times[after - 1])
        share = np.clip(share, 0, 1)[:, None, None]
        return wanted, (1 - share) * readings[after - 1] + share * readings[after]
    ends = np.searchsorted(times, wanted + tolerance, side="right")
    starts = np.concatenate([[0], ends[:-1]])
    kept = ends > starts
    sums = np.add.reduceat(readings[: ends[-1]], starts[kept], axis=0)
    return wanted[kept], sums / (ends - starts)[kept, None, None]
