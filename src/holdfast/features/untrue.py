"""Samples that are valid but cannot be true: faults of a whole finger. Compiled, no objects.

They are judged by the readings alone, whatever the tare, and refused: they reach no tare, force
or window. Each rule costs a few comparisons at a sample that is true.
"""

import math

import numpy as np

from holdfast.compiled import compiled_step, inlined, joined_step
from holdfast.features import arrays as at
from holdfast.features.arrays import Layout, Memory
from holdfast.features.faults import (
    OFFSET,
    OUT_OF_RANGE,
    REPEATED,
    SATURATED,
    scan_readings,
)
from holdfast.sensors.types import Array, Flags, Integers

LEAST_READING = 1e-37
"""No sensor sends readings that are all smaller than this but not all zero. It is a number of
single precision too, for the exported header."""
END_SHARE = 0.01
"""A reading is near an end of the range within this share of it. Real readings were never nearer
than 23 %."""
OFFSET_SHARE = 0.25
"""Share of the range by which the mean of all readings cannot change. A uSkin that is pressed with
the full range of every taxel changes by 7 %; real recordings had 0.5 %."""
MIN_PERIOD, LONG_PERIOD, MAX_PERIOD = 3, 12, 64
"""Periods of a ring: the shortest, the first of the long ones, the longest [samples]."""
MIN_VARYING = 12
"""Number of readings of a finger that change in a ring: few may repeat by chance."""
N_RING_SUMS = 128
"""Sums that are kept: a power of two of at least twice `MAX_PERIOD`."""
LAST_SUM = N_RING_SUMS - 1


@inlined
def find_untrue(
    layout: Layout, memory: Memory, readings: Array, f: int, total: float, least: float, most: float
) -> int:
    """Return the faults of a finger whose readings cannot be true; 0 without any.

    Args:
        layout: of the stream.
        memory: of the stream; is changed.
        readings: of all fingers, all valid.
        f: the finger.
        total: weighted sum of its readings, see `scan_readings`.
        least: smallest reading.
        most: largest reading.
    """
    counts, constants = memory.counts, layout.constants
    first, last = layout.offsets[f], layout.offsets[f + 1]
    faults = 0
    if follow_ring(counts, memory.sums, memory.rings, readings, f, first, last, total):
        faults = REPEATED
    low, high = constants[f, at.LOW_END], constants[f, at.HIGH_END]
    # More than half of the taxels have a reading near an end.
    if least < low or most > high:
        n = _n_outside(readings, layout.ignored, first, last, low, high)
        if 2 * n > constants[f, at.N_USED]:
            faults |= SATURATED
    if counts[f, at.N_TARED] < 0:
        if math.isnan(memory.levels[f, at.REST_SUM]):
            memory.levels[f, at.REST_SUM] = _rest_sum(layout, memory, f, total)
        # |sum f_i - sum f_i(rest)|: all readings have left together.
        if abs(total - memory.levels[f, at.REST_SUM]) > constants[f, at.MAX_OFFSET]:
            faults |= OFFSET
    # 0 < max |f| < 1e-37: bytes of another number type.
    largest = max(most, -least)
    if 0.0 < largest < LEAST_READING:
        faults |= OUT_OF_RANGE
    return faults


@compiled_step
def _n_outside(
    readings: Array, ignored: Flags, first: int, last: int, low: float, high: float
) -> int:
    """Return the number of taxels with a reading below low or above high."""
    n = 0
    for i in range(first, last):
        outside = False
        for axis in range(3):
            if readings[i, axis] < low or readings[i, axis] > high:
                outside = True
        if outside and not ignored[i]:
            n += 1
    return n


@compiled_step
def _rest_sum(layout: Layout, memory: Memory, f: int, total: float) -> float:
    """Return the weighted sum of the tare; of the first sample where there is none."""
    if layout.tare_kind == at.TARE_NONE:
        return total
    first, last = layout.offsets[f], layout.offsets[f + 1]
    return float(scan_readings(memory.baseline, layout.ignored, first, last)[0])


@joined_step
def follow_ring(
    counts: Integers,
    sums: Array,
    rings: Array,
    readings: Array,
    f: int,
    first: int,
    last: int,
    total: float,
) -> bool:
    """Return whether the last 3 p samples of a finger repeat with a period p.

    Samples are compared by their weighted sums, and one of each period exactly. A period that is
    found is followed until a sample differs from that a period before; then another is sought.

    Args:
        counts: of all fingers; is changed.
        sums: of the last samples of all fingers, a ring. Is changed.
        rings: memory of all taxels; is changed.
        readings: of all fingers.
        f: the finger.
        first: its first taxel.
        last: one past its last taxel.
        total: weighted sum of its readings.
    """
    # S(k) = S(k - p) for the last 2 p samples k. Each sample tries a third of the short periods and
    # a ninth of the others: a ring is found so early that it is followed for a period by then.
    n, period = counts[f, at.N_FRAMES], counts[f, at.RING_PERIOD]
    counts[f, at.N_FRAMES] = n + 1
    sums[f, np.uint64(n & LAST_SUM)] = total
    if period > 0:
        if sums[f, np.uint64((n - period) & LAST_SUM)] == total:
            return _has_repeated(counts, sums, rings, readings, f, first, last)
        counts[f, at.RING_PERIOD] = 0  # equal by chance, or at an end
    found = _equal_lag(sums, f, n, total, MIN_PERIOD + n % 3, LONG_PERIOD, 3)
    if found == 0:
        found = _equal_lag(sums, f, n, total, LONG_PERIOD + n % 9, MAX_PERIOD + 1, 9)
    if found > 0:
        _begin_ring(counts, sums, rings, readings, f, first, last, found)
    return False


@joined_step
def _equal_lag(sums: Array, f: int, n: int, total: float, begin: int, end: int, step: int) -> int:
    """Return the first lag of a range at which the sum of the readings was the same; else 0."""
    for lag in range(begin, end, step):
        if sums[f, np.uint64((n - lag) & LAST_SUM)] == total:
            return lag
    return 0


@compiled_step
def _begin_ring(
    counts: Integers,
    sums: Array,
    rings: Array,
    readings: Array,
    f: int,
    first: int,
    last: int,
    period: int,
) -> None:
    """Follow a ring, and count how many samples it has lasted, as far as the sums reach."""
    n, length = counts[f, at.N_FRAMES] - 1, 1
    while (
        length + period < N_RING_SUMS
        and sums[f, (n - length) & LAST_SUM] == sums[f, (n - length - period) & LAST_SUM]
    ):
        length += 1
    counts[f, at.RING_PERIOD], counts[f, at.RING_LENGTH] = period, length
    counts[f, at.RING_AGE] = counts[f, at.RING_VARIES] = 0
    for i in range(first, last):
        for axis in range(3):
            rings[i, at.ANCHOR + axis] = readings[i, axis]
            rings[i, at.VARIES + axis] = 0.0


@compiled_step
def _has_repeated(
    counts: Integers, sums: Array, rings: Array, readings: Array, f: int, first: int, last: int
) -> bool:
    """Return whether a ring that goes on has lasted for three periods, and is no rest."""
    period = counts[f, at.RING_PERIOD]
    counts[f, at.RING_LENGTH] += 1
    counts[f, at.RING_AGE] += 1
    if counts[f, at.RING_AGE] <= period:
        n_varying, is_equal = 0, True
        for i in range(first, last):
            for axis in range(3):
                if readings[i, axis] != rings[i, at.ANCHOR + axis]:
                    rings[i, at.VARIES + axis], is_equal = 1.0, False
                if rings[i, at.VARIES + axis] > 0.0:
                    n_varying += 1
        if counts[f, at.RING_AGE] == period:
            if not is_equal:
                counts[f, at.RING_PERIOD] = 0
                return False
            if n_varying >= MIN_VARYING and _n_distinct(counts, sums, f) >= MIN_PERIOD:
                counts[f, at.RING_VARIES] = 1
    return bool(counts[f, at.RING_VARIES] and counts[f, at.RING_LENGTH] >= 2 * period)


@compiled_step
def _n_distinct(counts: Integers, sums: Array, f: int) -> int:
    """Return at least 3 if three samples of a ring differ, else how many do."""
    n, n_distinct = counts[f, at.N_FRAMES] - 1, 1
    one = other = sums[f, n & LAST_SUM]
    for lag in range(1, counts[f, at.RING_PERIOD]):
        value = sums[f, (n - lag) & LAST_SUM]
        if value != one and value != other:  # noqa: PLR1714 (C has no `in`)
            n_distinct += 1
            other = value
    return n_distinct
