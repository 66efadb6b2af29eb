"""The baseline and the noise of a finger, sample by sample, and its force. Compiled, no objects."""

import math

import numpy as np

from holdfast.compiled import compiled, inlined
from holdfast.features.faults import keep
from holdfast.features.layout import (
    LEAST_NOISE,
    N_STEPS,
    NOISE,
    SEEN,
    STEPS,
    TARE_FIRST,
    TARE_SECONDS,
    TARED,
    Array,
    Integers,
    Layout,
    Memory,
)

NOISE_SECONDS = 0.5
"""How long the noise of a sensor is watched where the tare takes no time [s]."""


@inlined
def prepared(layout: Layout, memory: Memory, readings: Array, f: int, elapsed: float) -> bool:
    """Whether the tare is complete; takes the sample into it, and into the noise, until then."""
    counts, kind, seconds = memory.counts, layout.tare_kind, layout.tare_seconds
    first, last = layout.offsets[f], layout.offsets[f + 1]
    if math.isnan(memory.levels[f, NOISE]):
        watched = elapsed >= (seconds if kind == TARE_SECONDS else NOISE_SECONDS)
        _listen(layout, memory, readings, f, watched)
    keep(readings, memory.previous, first, last)
    if counts[f, TARED] < 0:
        return True
    running = elapsed < seconds or counts[f, TARED] == 0  # one sample at least
    return bool(_tare(readings, memory.baseline, counts, f, first, last, kind, running))


@compiled
def _listen(layout: Layout, memory: Memory, readings: Array, f: int, watched: bool) -> None:
    """The noise of a force component: a step holds that of two samples, in three components."""
    levels = memory.levels
    if watched:
        measured = math.sqrt(levels[f, STEPS] / (6.0 * max(levels[f, N_STEPS], 1.0)))
        levels[f, NOISE] = max(measured, layout.constants[f, LEAST_NOISE])
    elif memory.counts[f, SEEN] > 1:
        first, last = layout.offsets[f], layout.offsets[f + 1]
        x, y, z, _ = force_of(readings, memory.previous, layout.rotations, first, last)
        levels[f, STEPS] += x * x + y * y + z * z
        levels[f, N_STEPS] += 1.0


@compiled
def _tare(
    readings: Array,
    baseline: Array,
    counts: Integers,
    f: int,
    first: int,
    last: int,
    kind: int,
    running: bool,
) -> bool:
    """Whether the baseline is frozen now; takes this sample into it while it is not."""
    if kind == TARE_FIRST:
        baseline[first:last] = readings[first:last]
    elif kind == TARE_SECONDS:
        if running:
            baseline[first:last] += readings[first:last]
            counts[f, TARED] += 1
            return False
        baseline[first:last] /= max(counts[f, TARED], 1)
    counts[f, TARED] = -1
    return True


@compiled
def force_of(
    readings: Array, baseline: Array, rotations: Array, first: int, last: int
) -> tuple[float, float, float, float]:
    """F_tip = sum over taxels of R_i (f_i - baseline_i), and the sum of the normal readings."""
    fx = fy = fz = pressing = 0.0
    for i in range(np.uint64(first), np.uint64(last)):
        x = readings[i, 0] - baseline[i, 0]
        y = readings[i, 1] - baseline[i, 1]
        z = readings[i, 2] - baseline[i, 2]
        fx += rotations[i, 0, 0] * x + rotations[i, 0, 1] * y + rotations[i, 0, 2] * z
        fy += rotations[i, 1, 0] * x + rotations[i, 1, 1] * y + rotations[i, 1, 2] * z
        fz += rotations[i, 2, 0] * x + rotations[i, 2, 1] * y + rotations[i, 2, 2] * z
        pressing += z
    return fx, fy, fz, pressing
