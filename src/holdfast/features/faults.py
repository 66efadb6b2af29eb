"""What the readings of a finger show of faulty taxels. Compiled, no objects.

A taxel is judged beside the others of its finger, over the samples that changed any of them:
a server that sends a sample twice says nothing of a taxel.

Loops that run at every sample count without a sign: of a signed index, compiled code asks each
time whether it counts from the end, which takes as long as the sums.
"""

import math

import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

# Bits of holdfast.contact.Fault.
NOT_FINITE, STUCK, SATURATED, TARE_LOADED = 1, 2, 4, 8
DEAD, NOISY, OUT_OF_RANGE, TARE_DRIFT = 16, 32, 64, 128
SPOILING = STUCK | NOISY
"""Faults whose samples no window may hold, though they have a force."""

STUCK_SECONDS = 0.5
"""Readings that changed for so long and then have not for so long are stuck [s]."""
DEAD_SECONDS = 2.0
"""A taxel that has not changed so long after the first sample, while others did, is dead [s]."""
COMPANY = 0.8
"""Share of the taxels that must move, each in more than half of the samples, for others to be
at fault that stand still."""
BUSY = 0.9
"""Who changed in more of the samples has noise of about a count, and cannot stand still by
chance: readings that flicker between two counts change in half, three of them in 7 of 8."""
NOISE_SMOOTHING = 0.25
"""Over which the noise of a taxel is smoothed [s]."""
WHITE = 2.5
"""Mean square of second over that of first differences: 2 for steps that know nothing of each
other, 3 for white noise, 4 for a value that jumps to and fro; less for all that moves."""
LONE = 0.9
"""Share of a finger's second differences in one taxel: skin spreads a touch to neighbours."""
LOUD = 100.0
"""So many times as loud as a taxel's least noise is no noise of the sensor."""
LEAST_TAXELS = 4
"""Of fewer, one alone may well feel a touch."""
N_BITS = 63
"""Taxels that a mask can tell."""

# Columns of Memory.taxels.
STEP = 0  # its last change, in three axes
N_CHANGED = 3  # samples that changed it
CHANGED_AT = 4  # changes of its finger when it last changed
ROUGH = 5  # mean square of its changes, smoothed
ROUGHER = 6  # mean square of the change from one to the next, smoothed
N_TAXEL = 7


@compiled
def survey(readings: Array, ignored: Flags, first: int, last: int) -> tuple[float, float, float]:
    """A sum that is finite where all readings are, and the smallest and largest of them.

    Those of ignored taxels become zero.
    """
    sum_x = sum_y = sum_z = 0.0
    least, most = math.inf, -math.inf
    for i in range(np.uint64(first), np.uint64(last)):
        if ignored[i]:
            readings[i, 0] = readings[i, 1] = readings[i, 2] = 0.0
            continue
        x, y, z = readings[i, 0], readings[i, 1], readings[i, 2]
        sum_x += x
        sum_y += y
        sum_z += z
        low, high = (x, y) if x < y else (y, x)  # half as long as min and max take
        low = z if z < low else low
        high = z if z > high else high
        least = low if low < least else least
        most = high if high > most else most
    return sum_x + sum_y + sum_z, least, most


@compiled
def keep(readings: Array, previous: Array, first: int, last: int) -> None:
    """Copies the readings of a finger: a copy by slices would take three times as long."""
    for i in range(np.uint64(first), np.uint64(last)):
        previous[i, 0], previous[i, 1], previous[i, 2] = (
            readings[i, 0],
            readings[i, 1],
            readings[i, 2],
        )


@compiled
def differ(readings: Array, previous: Array, first: int, last: int) -> bool:
    """Whether any reading changed."""
    for i in range(first, last):
        for axis in range(3):
            if readings[i, axis] != previous[i, axis]:
                return True
    return False


@compiled
def outside(readings: Array, ignored: Flags, first: int, last: int, low: float, high: float) -> int:
    """A bit for each taxel that has a reading not strictly between low and high."""
    found = 0
    for i in range(first, last):
        for axis in range(3):
            if not low < readings[i, axis] < high and not ignored[i]:
                found |= bit_of(i - first)
    return found


@compiled
def watch_taxels(
    readings: Array,
    previous: Array,
    taxels: Array,
    first: int,
    last: int,
    n_changes: int,
    long: float,
    share: float,
) -> tuple[bool, bool, int]:
    """Takes a sample that changed something.

    Args:
        readings: of this sample.
        previous: of the last.
        taxels: is changed.
        first: taxel of the finger.
        last: one past its last.
        n_changes: samples that changed the finger, this one too.
        long: so many of them without a change are suspicious.
        share: of this sample in what is smoothed.

    Returns:
        Whether any taxel stood still for so long; whether one has most of the second
        differences, and which.
    """
    any_still = False
    total = loudest = 0.0
    which = first
    for i in range(np.uint64(first), np.uint64(last)):
        x = readings[i, 0] - previous[i, 0]
        y = readings[i, 1] - previous[i, 1]
        z = readings[i, 2] - previous[i, 2]
        square = x * x + y * y + z * z
        rough, rougher = (1.0 - share) * taxels[i, ROUGH], (1.0 - share) * taxels[i, ROUGHER]
        if square > 0.0:
            if (n_changes - taxels[i, CHANGED_AT]) * share > 1.0:  # to and fro takes less
                taxels[i, STEP] = taxels[i, STEP + 1] = taxels[i, STEP + 2] = 0.0
            if _has_reading(readings, i) and _has_reading(previous, i):
                dx, dy, dz = x - taxels[i, STEP], y - taxels[i, STEP + 1], z - taxels[i, STEP + 2]
                rough += share * square
                rougher += share * (dx * dx + dy * dy + dz * dz)
                taxels[i, STEP], taxels[i, STEP + 1], taxels[i, STEP + 2] = x, y, z
            else:
                taxels[i, STEP] = taxels[i, STEP + 1] = taxels[i, STEP + 2] = 0.0
            taxels[i, N_CHANGED] += 1.0
            taxels[i, CHANGED_AT] = n_changes
        elif n_changes - taxels[i, CHANGED_AT] >= long:
            any_still = True
        taxels[i, ROUGH], taxels[i, ROUGHER] = rough, rougher
        total += rougher
        if rougher > loudest:
            loudest, which = rougher, int(np.int64(i))
    return any_still, loudest >= LONE * total, which


@compiled
def _has_reading(readings: Array, i: int) -> bool:
    """False for zeros: a sensor with a dead band jumps to and from them, which is no noise."""
    return bool(readings[i, 0] != 0.0 or readings[i, 1] != 0.0 or readings[i, 2] != 0.0)


@compiled
def forget_noise(taxels: Array, first: int, last: int) -> None:
    """After a gap, over which a change says nothing of noise."""
    for i in range(first, last):
        taxels[i, STEP] = taxels[i, STEP + 1] = taxels[i, STEP + 2] = 0.0
        taxels[i, ROUGH] = taxels[i, ROUGHER] = 0.0


@compiled
def is_noisy(taxels: Array, i: int, quiet: float) -> bool:
    """Whether a taxel that has most of the second differences shows noise, and loud.

    Args:
        taxels: what is remembered of them.
        i: the taxel.
        quiet: the least noise of a reading [unit of the readings]; NaN while it is not known.
    """
    white = taxels[i, ROUGHER] > WHITE * taxels[i, ROUGH]
    return bool(white and taxels[i, ROUGHER] > 6.0 * (LOUD * quiet) ** 2)


@compiled
def still_taxels(
    taxels: Array,
    ignored: Flags,
    first: int,
    last: int,
    n_changes: int,
    period: float,
    at_limit: int,
) -> tuple[int, int]:
    """DEAD or STUCK or neither, and a bit for each such taxel, where enough others move.

    Args:
        taxels: what is remembered of them.
        ignored: taxels that are not looked at.
        first: taxel of the finger.
        last: one past its last.
        n_changes: samples that changed the finger.
        period: of the samples [s].
        at_limit: bits of taxels at a limit of their range: they are saturated, not stuck.
    """
    faults = bits = n_used = n_moving = 0
    long = STUCK_SECONDS / period
    for i in range(first, last):
        changed, changed_at = taxels[i, N_CHANGED], taxels[i, CHANGED_AT]
        still = n_changes - changed_at
        if ignored[i]:
            continue
        n_used += 1
        if 2.0 * still < long:
            n_moving += 2.0 * changed > changed_at
        elif changed == 0.0 and still >= DEAD_SECONDS / period:
            faults |= DEAD
            bits |= bit_of(i - first)
        elif still >= long and _was_busy(changed, changed_at, long):
            at_it = at_limit & bit_of(i - first) != 0
            faults |= 0 if at_it else STUCK
            bits |= 0 if at_it else bit_of(i - first)
    return (faults, bits) if n_moving >= COMPANY * n_used else (0, 0)


@compiled
def _was_busy(changed: float, changed_at: float, long: float) -> bool:
    return bool(changed >= long and changed > BUSY * changed_at)


@compiled
def bit_of(taxel: int) -> int:
    """The bit of a taxel in a mask; none for those that a mask cannot tell."""
    return 1 << taxel if taxel < N_BITS else 0
