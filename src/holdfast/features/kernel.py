"""What happens to one sample of a hand: tare, force, faults, features. Compiled, no objects.

`advance` is the only path from readings to features that a model sees: live, offline and in
training. All memory is laid out beforehand and never grows. What belongs to one finger is a
row of an array, and columns have names: a slice would cost as much as the sum it is for.
"""

import math

import numpy as np

from holdfast.compiled import compiled, inlined
from holdfast.features.arrays import (
    AMPLITUDE,
    CHANGES,
    END,
    FAULT,
    FAULTS,
    FIRST,
    FROZEN,
    GAP,
    GAPPED,
    LARGEST,
    LAST,
    LEAST,
    LONGEST,
    MEAN,
    MOST,
    N_USED,
    N_VALUES,
    NOISE,
    PULLING,
    READY,
    REASON,
    ROUNDING,
    RUN,
    SEEN,
    SIGMA,
    SIGMA_WINDOW,
    TARE,
    TARE_SECONDS,
    TAXELS,
    WARM_UP,
    WRONG,
    WRONG_TAXELS,
    Array,
    Flags,
    Integers,
    Layout,
    Memory,
    Output,
)
from holdfast.features.baseline import prepared
from holdfast.features.faults import (
    LEAST_TAXELS,
    NOISE_SMOOTHING,
    NOISY,
    NOT_FINITE,
    OUT_OF_RANGE,
    SATURATED,
    SPOILING,
    STUCK,
    STUCK_SECONDS,
    TARE_LOADED,
    bit_of,
    differ,
    forget_noise,
    is_noisy,
    outside,
    still_taxels,
    survey,
    watch_taxels,
)
from holdfast.features.force import sum_taxels
from holdfast.features.values import blank, fill_features, moments, own_features

LOADED_SECONDS = 0.25
"""Pulling for so long means that the tare was taken under load: nothing pulls a skin [s]."""
GAP_LIMIT = 3.0003
"""Sample periods; a longer step is a gap. The part over 3 is for the rounding of times."""


@compiled
def advance(
    layout: Layout, memory: Memory, output: Output, readings: Array, present: Flags, time: float
) -> None:
    """Takes one sample of the fingers that are present, and fills the output.

    Args:
        layout: of the hand.
        memory: is changed.
        output: is filled.
        readings: (n_taxels, 3) of all fingers; those of absent ones are not looked at, and
            those of ignored taxels become zero.
        present: (n_fingers,) which fingers have a sample.
        time: of the sample [s].
    """
    counts, status = memory.counts, output.status
    for f in range(len(present)):
        if time - memory.levels[f, LAST] > GAP_LIMIT * layout.period:  # False while LAST is NaN
            counts[f, RUN] = counts[f, FROZEN] = counts[f, PULLING] = 0
            blank(memory.own, f)
            counts[f, GAPPED] = 1
            status[f, REASON], status[f, FAULTS], status[f, TAXELS] = GAP, 0, 0
            blank(output.values, f)
        if present[f]:
            status[f, REASON], status[f, FAULTS], status[f, TAXELS] = _take(
                layout, memory, output.values, readings, time, f
            )
    for f in range(len(present)):
        if present[f]:
            own_features(layout, memory, output, f)
    for f in range(len(present)):
        if status[f, REASON] != READY:
            blank(output.features, f)
        elif present[f]:
            total = fill_features(layout, memory, output, f)
            if math.isnan(total):  # the noise is not known yet
                status[f, REASON] = TARE


@inlined
def _take(
    layout: Layout, memory: Memory, values: Array, readings: Array, time: float, f: int
) -> tuple[int, int, int]:
    """One finger's sample up to its force; the reason, the faults and their taxels after it."""
    counts, levels, constants, ignored = (
        memory.counts,
        memory.levels,
        layout.constants,
        layout.ignored,
    )
    first, last = layout.offsets[f], layout.offsets[f + 1]
    low, high = constants[f, LEAST], constants[f, MOST]
    for column in range(N_VALUES):
        values[f, column] = math.nan
    fresh = time - levels[f, LAST] > GAP_LIMIT * layout.period
    levels[f, LAST] = time
    total, least, most = survey(readings, ignored, first, last)
    if not math.isfinite(total):
        counts[f, RUN] = 0
        return FAULT, NOT_FINITE, outside(readings, ignored, first, last, -math.inf, math.inf)
    if least < low or most > high:
        counts[f, RUN] = 0
        low, high = np.nextafter(low, -math.inf), np.nextafter(high, math.inf)
        return FAULT, OUT_OF_RANGE, outside(readings, ignored, first, last, low, high)
    _watch(layout, memory, readings, f, time, fresh)
    elapsed = time - levels[f, FIRST] + 0.5 * layout.period  # half: rounding moves no sample
    if not prepared(layout, memory, readings, f, elapsed):
        return TARE, 0, 0
    faults, bits = counts[f, WRONG], counts[f, WRONG_TAXELS]
    if least <= low or most >= high:
        faults |= SATURATED
        bits |= outside(readings, ignored, first, last, low, high)
    return _feel(layout, memory, values, readings, f, faults, bits)


@inlined
def _feel(
    layout: Layout, memory: Memory, values: Array, readings: Array, f: int, faults: int, bits: int
) -> tuple[int, int, int]:
    """The force of a sample, with its faults so far; what `_take` returns."""
    counts, levels, windows = memory.counts, memory.levels, layout.windows
    first, last = layout.offsets[f], layout.offsets[f + 1]
    x, y, z, pressing = sum_taxels(readings, memory.baseline, layout.rotations, first, last)
    _remember(memory.history, counts, values, f, x, y, z)
    if _stuck(counts, f, layout.period):
        faults |= STUCK
    if faults & SPOILING:
        counts[f, RUN] = counts[f, PULLING] = 0
        return FAULT, faults, bits
    levels[f, LARGEST] = max(levels[f, LARGEST], values[f, AMPLITUDE])
    if counts[f, RUN] >= windows[f, SIGMA_WINDOW]:
        found = moments(memory.history, counts, f, 0, windows[f, SIGMA_WINDOW])
        values[f, MEAN], values[f, SIGMA] = found
    if layout.tare_kind == TARE_SECONDS and _pulled(counts, levels, f, pressing, layout.period):
        faults |= TARE_LOADED
    if faults:
        return FAULT, faults, bits
    if counts[f, RUN] < windows[f, LONGEST]:
        return GAP if counts[f, GAPPED] else WARM_UP, 0, 0
    counts[f, GAPPED] = 0
    return READY, 0, 0


@inlined
def _watch_taxels(layout: Layout, memory: Memory, readings: Array, f: int, fresh: bool) -> None:
    """Takes a sample that changed something, and finds the taxels that are at fault."""
    first, last, period = layout.offsets[f], layout.offsets[f + 1], layout.period
    taxels, constants, counts = memory.taxels, layout.constants, memory.counts
    n_changes, long = counts[f, CHANGES], STUCK_SECONDS / period
    share = min(1.0, period / NOISE_SMOOTHING)
    any_still, alone, which = watch_taxels(
        readings, memory.previous, taxels, first, last, n_changes, long, share
    )
    if fresh:
        forget_noise(taxels, first, last)
    counts[f, WRONG] = counts[f, WRONG_TAXELS] = 0
    if any_still:
        low, high, ignored = constants[f, LEAST], constants[f, MOST], layout.ignored
        at_limit = outside(readings, ignored, first, last, low, high)
        counts[f, WRONG], counts[f, WRONG_TAXELS] = still_taxels(
            taxels, ignored, first, last, n_changes, period, at_limit
        )
    if alone and constants[f, N_USED] >= LEAST_TAXELS:
        quiet = constants[f, ROUNDING]
        if math.isnan(quiet):  # its share in the noise of the finger
            quiet = memory.levels[f, NOISE] / math.sqrt(constants[f, N_USED])
        if is_noisy(taxels, which, quiet):
            counts[f, WRONG] |= NOISY
            counts[f, WRONG_TAXELS] |= bit_of(which - first)


@inlined
def _watch(
    layout: Layout, memory: Memory, readings: Array, f: int, time: float, fresh: bool
) -> None:
    """Counts the sample, and what it changes."""
    counts = memory.counts
    first, last = layout.offsets[f], layout.offsets[f + 1]
    if counts[f, SEEN] == 0:
        memory.levels[f, FIRST] = time
    elif differ(readings, memory.previous, first, last):
        counts[f, FROZEN] = 0
        counts[f, CHANGES] += 1
        _watch_taxels(layout, memory, readings, f, fresh)
    else:
        counts[f, FROZEN] += 1
    counts[f, SEEN] += 1


@compiled
def _remember(
    history: Array,
    counts: Integers,
    values: Array,
    f: int,
    x: float,
    y: float,
    z: float,
) -> None:
    amplitude = math.sqrt(x * x + y * y + z * z)
    length = history.shape[2] // 2
    place = counts[f, RUN] % length
    counts[f, RUN] += 1
    counts[f, END] = place + length + 1
    history[f, 0, place] = history[f, 0, place + length] = amplitude
    history[f, 1, place] = history[f, 1, place + length] = x
    history[f, 2, place] = history[f, 2, place + length] = y
    history[f, 3, place] = history[f, 3, place + length] = z
    values[f, 0], values[f, 1], values[f, 2] = x, y, z
    values[f, AMPLITUDE] = amplitude


@compiled
def _stuck(counts: Integers, f: int, period: float) -> bool:
    """Whether nothing of the finger changes any more, though it used to."""
    lively = 2 * counts[f, CHANGES] > counts[f, SEEN] - 1 - counts[f, FROZEN]
    long = STUCK_SECONDS / period
    return bool(lively and counts[f, FROZEN] >= long and counts[f, CHANGES] >= long)


@compiled
def _pulled(counts: Integers, levels: Array, f: int, pressing: float, period: float) -> bool:
    """Whether the normal readings say that something pulls, well above noise, and for long."""
    limit = max(20.0 * levels[f, NOISE], 0.1 * levels[f, LARGEST])
    counts[f, PULLING] = counts[f, PULLING] + 1 if pressing < -limit else 0
    return bool(counts[f, PULLING] * period >= LOADED_SECONDS)
