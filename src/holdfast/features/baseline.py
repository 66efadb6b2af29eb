"""The baseline and the noise of a finger, sample by sample, and its force. Compiled, no objects."""

import math

from holdfast.compiled import compiled, inlined
from holdfast.features.arrays import (
    LEAST_NOISE,
    N_STEPS,
    NOISE,
    SEEN,
    STEPS,
    TARE_SECONDS,
    TARED,
    Array,
    Layout,
    Memory,
)
from holdfast.features.faults import keep
from holdfast.features.force import sum_taxels
from holdfast.features.tare import update_baseline

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
    return bool(update_baseline(readings, memory.baseline, counts, f, first, last, kind, running))


@compiled
def _listen(layout: Layout, memory: Memory, readings: Array, f: int, watched: bool) -> None:
    """The noise of a force component: a step holds that of two samples, in three components."""
    levels = memory.levels
    if watched:
        measured = math.sqrt(levels[f, STEPS] / (6.0 * max(levels[f, N_STEPS], 1.0)))
        levels[f, NOISE] = max(measured, layout.constants[f, LEAST_NOISE])
    elif memory.counts[f, SEEN] > 1:
        first, last = layout.offsets[f], layout.offsets[f + 1]
        x, y, z, _ = sum_taxels(readings, memory.previous, layout.rotations, first, last)
        levels[f, STEPS] += x * x + y * y + z * z
        levels[f, N_STEPS] += 1.0
