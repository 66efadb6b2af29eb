"""Faults that readings show: of single taxels and of whole fingers. Compiled, no objects.

A taxel is compared with the other taxels of its finger. Only samples that changed a reading of
the finger count, because a sample that a server sends twice shows nothing about a taxel.

Loops that run at every sample have an unsigned index. For a signed index, compiled code tests
at each access whether it counts from the end, which takes as long as the sums.
"""

import math

import numpy as np

from holdfast.compiled import compiled_step, inlined, joined_step
from holdfast.features import arrays as at
from holdfast.features.arrays import Layout, Memory
from holdfast.sensors.types import Array, Flags, Integers

# Bits of holdfast.contact.Fault.
NOT_FINITE, STUCK, SATURATED, TARE_LOADED = 1, 2, 4, 8
DEAD, NOISY, OUT_OF_RANGE, TARE_DRIFT = 16, 32, 64, 128
OFFSET, REPEATED = 8192, 16384
SERIOUS = STUCK | NOISY
"""Faults of a finger whose samples no window may hold, though they have a force."""

STUCK_SECONDS = 0.5
"""Readings that changed for this long and then do not change for this long are stuck [s]."""
DEAD_SECONDS = 2.0
"""A taxel that has not changed for this long since the first sample, while others change, is
dead [s]."""
STILL_RATIO = 10.0
"""A taxel stands still by a fault if it does so this many times as long as ever before. Healthy
taxels reached 5 times in 24 randomized hands, and once in real recordings."""
MIN_CHANGES = 10.0
"""Number of changes from which the past of a taxel shows how long it stands still. One that changed
less often is compared with the others."""
MOVING_SHARE = 0.8
"""Minimum share of the other taxels that must move, each in more than half of the samples, before
a taxel that stands still counts as faulty."""
NOISE_SMOOTHING = 0.25
"""Time constant over which the noise of a taxel is smoothed [s]."""
WHITE_RATIO = 2.5
"""Minimum ratio of the mean squares of second and first differences in noise. It is 2 for
independent steps, 3 for white noise, 4 for a value that jumps up and down, and less for motion."""
LONE_SHARE = 0.9
"""Minimum share of a finger's second differences in one noisy taxel. A touch spreads over the
skin to neighbouring taxels."""
LOUD_RATIO = 100.0
"""A taxel is noisy when it exceeds its least possible noise by this factor."""
MIN_TAXELS = 4
"""Number of taxels from which one may count as noisy; of fewer, one may be touched alone."""
N_MASK_BITS = 63
"""Number of taxels that a mask can hold."""
WEIGHT_Y, WEIGHT_Z = math.sqrt(2.0) / 1.5, math.sqrt(3.0) / 1.6
"""Weights of the axes in the sum of the readings, about 1. Whole counts have the same sum only if
the sum of each axis is the same."""
LOADED_SECONDS = 0.25
"""A pull for this long means that the tare was taken under load: nothing pulls a skin [s]."""


@joined_step
def scan_readings(
    readings: Array, ignored: Flags, first: int, last: int
) -> tuple[float, float, float]:
    """Return the weighted sum of the readings, their minimum and their maximum.

    The sum is finite if all readings are. The readings of ignored taxels are set to zero.
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
        # min and max over i and the axes of f_i: each a comparison of its own, so that no
        # compiler makes a branch of two, which half of the samples would mispredict.
        low = x if x < y else y
        high = x if x > y else y
        low = z if z < low else low
        high = z if z > high else high
        least = low if low < least else least
        most = high if high > most else most
    return sum_x + WEIGHT_Y * sum_y + WEIGHT_Z * sum_z, least, most


@joined_step
def copy_readings(readings: Array, previous: Array, first: int, last: int) -> None:
    """Copy the readings of a finger. A copy by slices takes three times as long."""
    for i in range(np.uint64(first), np.uint64(last)):
        previous[i, 0], previous[i, 1], previous[i, 2] = (
            readings[i, 0],
            readings[i, 1],
            readings[i, 2],
        )


@compiled_step
def taxels_outside(
    readings: Array, ignored: Flags, first: int, last: int, low: float, high: float
) -> int:
    """Return the bits of the taxels with a reading that is not strictly between low and high."""
    found = 0
    for i in range(first, last):
        for axis in range(3):
            # Bit i: some axis of f_i <= low or >= high.
            if not low < readings[i, axis] < high and not ignored[i]:
                found |= bit_of(i - first)
    return found


@compiled_step
def invalid_taxels(
    readings: Array, ignored: Flags, first: int, last: int, low: float, high: float
) -> tuple[int, int]:
    """Return NOT_FINITE and OUT_OF_RANGE, as far as some taxel has them, and the bits of these.

    Args:
        readings: of all fingers; at least one of this finger is not valid.
        ignored: (n_taxels,) taxels that do not count.
        first: first taxel of the finger.
        last: one past its last taxel.
        low: smallest valid reading.
        high: largest valid reading.
    """
    infinite = taxels_outside(readings, ignored, first, last, -math.inf, math.inf)
    low, high = np.nextafter(low, -math.inf), np.nextafter(high, math.inf)
    bits = taxels_outside(readings, ignored, first, last, low, high)
    faults = NOT_FINITE if infinite else 0
    return (faults | OUT_OF_RANGE if bits != infinite else faults), bits


@inlined
def track_changes(
    layout: Layout, memory: Memory, readings: Array, f: int, time: float, after_gap: bool
) -> None:
    """Count a valid sample of a finger, and compare it with the one before."""
    counts = memory.counts
    first, last = layout.offsets[f], layout.offsets[f + 1]
    if counts[f, at.N_SEEN] == 0:
        memory.levels[f, at.FIRST_TIME] = time
    elif _differ(readings, memory.previous, first, last):
        if not is_stuck(counts, f, layout.period):
            _update_rest(counts, f, layout.period)
        counts[f, at.N_UNCHANGED] = 0
        counts[f, at.N_CHANGES] += 1
        _find_taxel_faults(layout, memory, readings, f, after_gap)
    else:
        counts[f, at.N_UNCHANGED] += 1
    counts[f, at.N_SEEN] += 1


@compiled_step
def is_stuck(counts: Integers, f: int, period: float) -> bool:
    """Return whether the readings of a finger stopped changing after they had changed.

    A sensor with a dead band, or with less noise than a step of its readings, rests while nothing
    moves it.
    """
    # Stuck: more than half of the steps before the rest changed a reading, 0.5 s of changes at
    # least, and the rest lasts max(0.5 s, 10 times the longest rest before).
    n_steps = counts[f, at.N_SEEN] - 1 - counts[f, at.N_UNCHANGED]
    changed_often = 2 * counts[f, at.N_CHANGES] > n_steps
    long = STUCK_SECONDS / period
    rested = STILL_RATIO * counts[f, at.LONGEST_REST]
    still = counts[f, at.N_UNCHANGED] >= max(long, rested)
    return bool(changed_often and still and counts[f, at.N_CHANGES] >= long)


@compiled_step
def _update_rest(counts: Integers, f: int, period: float) -> None:
    """Note that a finger rested, if its readings did not change for long."""
    n = counts[f, at.N_UNCHANGED]
    # longest = max(longest, n), of rests of 0.5 s or more.
    if n >= STUCK_SECONDS / period and n > counts[f, at.LONGEST_REST]:
        counts[f, at.LONGEST_REST] = n


@compiled_step
def is_pulled(counts: Integers, levels: Array, f: int, normal: float, period: float) -> bool:
    """Return whether the normal readings show a pull, well above noise, for a long time.

    Args:
        counts: of all fingers; is changed.
        levels: of all fingers.
        f: the finger.
        normal: sum of its normal readings [unit of the readings].
        period: of the samples [s].
    """
    # Pulled: sum_i z_i < -max(20 noise, 0.1 max F_a), for 0.25 s.
    limit = max(20.0 * levels[f, at.NOISE], 0.1 * levels[f, at.MAX_AMPLITUDE])
    counts[f, at.N_PULLED] = counts[f, at.N_PULLED] + 1 if normal < -limit else 0
    return bool(counts[f, at.N_PULLED] * period >= LOADED_SECONDS)


@compiled_step
def _differ(readings: Array, previous: Array, first: int, last: int) -> bool:
    for i in range(first, last):
        for axis in range(3):
            if readings[i, axis] != previous[i, axis]:
                return True
    return False


@inlined
def _find_taxel_faults(
    layout: Layout, memory: Memory, readings: Array, f: int, after_gap: bool
) -> None:
    """Find the faulty taxels of a finger at a sample that changed a reading."""
    taxels, constants, counts = memory.taxels, layout.constants, memory.counts
    first, last = layout.offsets[f], layout.offsets[f + 1]
    any_still, alone, largest = _update_taxels(layout, memory, readings, f)
    if after_gap:
        _reset_noise(taxels, first, last)
    counts[f, at.TAXEL_FAULTS] = counts[f, at.FAULTY_TAXELS] = counts[f, at.NOISY_TAXELS] = 0
    if any_still:
        low, high, ignored = constants[f, at.LOW_LIMIT], constants[f, at.HIGH_LIMIT], layout.ignored
        at_limit = taxels_outside(readings, ignored, first, last, low, high)
        counts[f, at.TAXEL_FAULTS], counts[f, at.FAULTY_TAXELS] = _still_taxels(
            layout, memory, readings, f, at_limit
        )
    if alone and constants[f, at.N_USED] >= MIN_TAXELS:
        quiet = constants[f, at.ROUNDING_NOISE]
        # Noise of a reading: noise of F / sqrt(n_used), where the step is not known.
        if math.isnan(quiet):  # its share in the noise of the finger
            quiet = memory.levels[f, at.NOISE] / math.sqrt(constants[f, at.N_USED])
        loudest = _loudest(taxels, first, last, largest)
        if _is_noisy(taxels, loudest, quiet):
            counts[f, at.TAXEL_FAULTS] |= NOISY
            counts[f, at.NOISY_TAXELS] = bit_of(loudest - first)
            counts[f, at.FAULTY_TAXELS] |= counts[f, at.NOISY_TAXELS]


@inlined
def _update_taxels(
    layout: Layout, memory: Memory, readings: Array, f: int
) -> tuple[bool, bool, float]:
    """Update the memory of each taxel of a finger with a sample that changed a reading.

    Returns:
        Whether any taxel did not change for so long, whether one taxel has most of the second
        differences, and its `SECOND_POWER`.
    """
    taxels, previous, n_changes = memory.taxels, memory.previous, memory.counts[f, at.N_CHANGES]
    first, last = layout.offsets[f], layout.offsets[f + 1]
    # s = T / tau: the weight of a sample in a first order mean.
    long, share = STUCK_SECONDS / layout.period, min(1.0, layout.period / NOISE_SMOOTHING)
    any_still = False
    total = largest = 0.0
    for i in range(np.uint64(first), np.uint64(last)):
        # D1 = f_i(k) - f_i(k-1), D2 = D1 - D1 of the last change:
        # P1 = (1 - s) P1 + s |D1|^2, P2 = (1 - s) P2 + s |D2|^2. Without a change D1 = D2 = 0.
        x = readings[i, 0] - previous[i, 0]
        y = readings[i, 1] - previous[i, 1]
        z = readings[i, 2] - previous[i, 2]
        square = x * x + y * y + z * z
        power, power_2 = (
            (1.0 - share) * taxels[i, at.FIRST_POWER],
            (1.0 - share) * taxels[i, at.SECOND_POWER],
        )
        if square > 0.0:
            second = _second_square(layout.period, memory, f, i, x, y, z)
            if _has_reading(readings, i) and _has_reading(previous, i):
                power += share * square
                power_2 += share * second
            else:
                _reset_change(taxels, i)
        elif n_changes - taxels[i, at.CHANGED_AT] >= long:
            # still: n_changes - n(last change) >= 0.5 s of changes.
            any_still = True
        taxels[i, at.FIRST_POWER], taxels[i, at.SECOND_POWER] = power, power_2
        total += power_2
        largest = power_2 if power_2 > largest else largest
    return any_still, largest >= LONE_SHARE * total, largest


@compiled_step
def _loudest(taxels: Array, first: int, last: int, largest: float) -> int:
    """Return the first taxel of a finger that has the largest `SECOND_POWER`."""
    for i in range(first, last):
        if taxels[i, at.SECOND_POWER] == largest:
            return i
    return first


@inlined
def _second_square(
    period: float, memory: Memory, f: int, i: int, x: float, y: float, z: float
) -> float:
    """Note the change (x, y, z) of taxel i. Return the square of its second difference."""
    taxels, n_changes = memory.taxels, memory.counts[f, at.N_CHANGES]
    still = n_changes - taxels[i, at.CHANGED_AT] - 1.0
    if still != 0.0 or taxels[i, at.N_CHANGED] == 0.0:
        _note_still(period, memory, f, i, still)
    # |D2|^2, with D2 = D1 - D1 of the last change.
    dx = x - taxels[i, at.LAST_CHANGE]
    dy = y - taxels[i, at.LAST_CHANGE + 1]
    dz = z - taxels[i, at.LAST_CHANGE + 2]
    taxels[i, at.LAST_CHANGE] = x
    taxels[i, at.LAST_CHANGE + 1] = y
    taxels[i, at.LAST_CHANGE + 2] = z
    taxels[i, at.N_CHANGED] += 1.0
    taxels[i, at.CHANGED_AT] = n_changes
    return float(dx * dx + dy * dy + dz * dz)


@compiled_step
def _note_still(period: float, memory: Memory, f: int, i: int, still: float) -> None:
    """Note that a taxel which changes now did not before, or never did."""
    taxels = memory.taxels
    if (still + 1.0) * min(1.0, period / NOISE_SMOOTHING) > 1.0:  # jumps follow faster
        _reset_change(taxels, i)
    if taxels[i, at.N_CHANGED] == 0.0:
        taxels[i, at.LONGEST_STILL] = memory.counts[f, at.N_SEEN] - 1.0
    elif still > taxels[i, at.LONGEST_STILL]:
        _update_longest(taxels, i, still, STUCK_SECONDS / period)


@compiled_step
def _update_longest(taxels: Array, i: int, still: float, long: float) -> None:
    """Update the longest time without a change, unless it was by a fault."""
    # longest = still, unless still >= max(0.5 s, 10 (longest + 1)): that was a fault.
    few = taxels[i, at.N_CHANGED] < MIN_CHANGES
    if few or still < max(long, STILL_RATIO * (taxels[i, at.LONGEST_STILL] + 1.0)):
        taxels[i, at.LONGEST_STILL] = still


@compiled_step
def _has_reading(readings: Array, i: int) -> bool:
    """Return False for zeros: a sensor with a dead band jumps to and from zero without noise."""
    return bool(readings[i, 0] != 0.0 or readings[i, 1] != 0.0 or readings[i, 2] != 0.0)


@compiled_step
def _reset_change(taxels: Array, i: int) -> None:
    taxels[i, at.LAST_CHANGE] = taxels[i, at.LAST_CHANGE + 1] = taxels[i, at.LAST_CHANGE + 2] = 0.0


@compiled_step
def _reset_noise(taxels: Array, first: int, last: int) -> None:
    """Reset the noise of the taxels after a gap, over which a change is no noise."""
    for i in range(first, last):
        _reset_change(taxels, i)
        taxels[i, at.FIRST_POWER] = taxels[i, at.SECOND_POWER] = 0.0


@compiled_step
def _is_noisy(taxels: Array, i: int, quiet: float) -> bool:
    """Return whether a taxel that has most of the second differences is noisy.

    Args:
        taxels: memory of all taxels.
        i: the taxel.
        quiet: least noise of a reading [unit of the readings]; NaN while unknown.
    """
    # Noisy: P2 > 2.5 P1 (white noise has 3 P1), and P2 > 6 (100 noise)^2: D2 of white noise
    # of a reading has the variance 6 noise^2.
    white = taxels[i, at.SECOND_POWER] > WHITE_RATIO * taxels[i, at.FIRST_POWER]
    return bool(white and taxels[i, at.SECOND_POWER] > 6.0 * (LOUD_RATIO * quiet) ** 2)


@inlined
def _still_taxels(
    layout: Layout, memory: Memory, readings: Array, f: int, at_limit: int
) -> tuple[int, int]:
    """Return the faults DEAD and STUCK, and the bits of their taxels, if the others move.

    Args:
        layout: of the stream.
        memory: of the stream.
        readings: of this sample.
        f: the finger.
        at_limit: bits of the taxels at a limit of their range: they are saturated, not stuck.
    """
    taxels, n_changes, period = memory.taxels, memory.counts[f, at.N_CHANGES], layout.period
    first, last = layout.offsets[f], layout.offsets[f + 1]
    faults = bits = 0
    others = _longest_still_of_moving(layout, memory, readings, f)
    # Fewer than none if too few move: no taxel is tested then.
    for i in range(first, last if others >= 0.0 else first):
        changed, still = taxels[i, at.N_CHANGED], n_changes - taxels[i, at.CHANGED_AT]
        if layout.ignored[i] or not _is_still(taxels, i, n_changes, period):
            continue
        if not _has_reading(readings, i):
            continue  # zeros: nothing touches a sensor with a dead band
        # Too few changes of its own: compared with the others, still >= 10 (others + 1).
        if changed < MIN_CHANGES and still < STILL_RATIO * (others + 1.0):
            continue
        bit = bit_of(i - first)
        if changed == 0.0:
            faults |= DEAD
            bits |= bit
        elif at_limit & bit == 0:
            faults |= STUCK
            bits |= bit
    return faults, bits


@inlined
def _longest_still_of_moving(layout: Layout, memory: Memory, readings: Array, f: int) -> float:
    """Return for how many samples a moving taxel stood still at most; -1 if too few move.

    A taxel that was ever still for long does not count as moving, because the noise of such a
    sensor is less than a step of its readings: it is still while nothing moves it.
    """
    taxels, n_changes, period = memory.taxels, memory.counts[f, at.N_CHANGES], layout.period
    n_live, n_moving, longest, long = 0, 0, 0.0, STUCK_SECONDS / period
    for i in range(layout.offsets[f], layout.offsets[f + 1]):
        changed, changed_at = taxels[i, at.N_CHANGED], taxels[i, at.CHANGED_AT]
        silent = changed == 0.0 and not _has_reading(readings, i)
        if layout.ignored[i] or silent or _is_still(taxels, i, n_changes, period):
            continue
        n_live += 1
        # Moving: changed in the last 0.25 s and in more than half of the samples.
        often = 2.0 * (n_changes - changed_at) < long and 2.0 * changed > changed_at
        if often and taxels[i, at.LONGEST_STILL] < long:
            n_moving += 1
            longest = max(longest, taxels[i, at.LONGEST_STILL])
    # At least 80 % of the live taxels move.
    return longest if n_moving > 0 and n_moving >= MOVING_SHARE * n_live else -1.0


@compiled_step
def _is_still(taxels: Array, i: int, n_changes: int, period: float) -> bool:
    """Return whether a taxel does not change for far longer than ever before."""
    # Still: 2 s at first; later max(0.5 s, 10 (longest + 1 sample)).
    still = n_changes - taxels[i, at.CHANGED_AT]
    if taxels[i, at.N_CHANGED] < MIN_CHANGES:
        return bool(still >= DEAD_SECONDS / period)
    least = STILL_RATIO * (taxels[i, at.LONGEST_STILL] + 1.0)
    return bool(still >= max(STUCK_SECONDS / period, least))


@compiled_step
def bit_of(taxel: int) -> int:
    """Return the bit of a taxel in a mask; 0 for a taxel that the mask cannot hold."""
    return 1 << taxel if taxel < N_MASK_BITS else 0
