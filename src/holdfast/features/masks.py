"""Masks: a finger goes on without its faulty taxels. Compiled, no objects.

A masked taxel is filled in: with its last healthy reading beyond rest, scaled by the load of the
healthy taxels. So the force has no step when a taxel is masked, and what is filled in goes with
the load when the finger lets go. What is wrong with it when the taxel comes back fades slowly.
`docs/decisions/0022-masks-of-taxels.md` has the reasons.

The steps are not inlined, since few samples have a mask, and the compiler takes minutes for it.
"""

import math

import numpy as np

from holdfast.compiled import compiled_step
from holdfast.features import arrays as at
from holdfast.features.arrays import Layout, Memory
from holdfast.features.faults import N_MASK_BITS, bit_of
from holdfast.features.motion import MAX_BRIDGED_SECONDS
from holdfast.sensors.types import Array

MIN_HEALTHY_SHARE = 0.5
"""Minimum share of the load that the healthy taxels of a finger carry; of its taxels, where the
load is not known. With less, the finger is UNKNOWN."""
KNOWN_LOAD_TO_NOISE = 10.0
"""The load is known if a taxel has this many times its noise, as a root mean square."""
FADE_SECONDS = 2.0
"""Time constant over which the difference fades when a taxel comes back [s]: slow beside all
features."""
FADED_TO_NOISE = 0.1
"""What fades is gone below this share of the noise of a reading."""
STILL_CHANGES = 2
"""Changes of a finger from which a taxel that did not change with them is still the same."""
LOST_SECONDS = 0.5
"""A taxel without a valid reading for this long in the tare is left out until the next [s]."""


@compiled_step
def note_saturated(
    masks: Array, previous: Array, readings: Array, first: int, last: int, bits: int
) -> None:
    """Let taxels count for their last reading, where that of this sample is at a limit.

    Args:
        masks: memory of all taxels; is changed.
        previous: readings of the sample before.
        readings: of this sample.
        first: first taxel of the finger.
        last: one past its last taxel.
        bits: of the taxels that are at a limit now, and were not masked before.
    """
    for i in range(first, last):
        if bits & bit_of(i - first):
            for axis in range(3):
                masks[i, at.FADE + axis] += previous[i, axis] - readings[i, axis]


@compiled_step
def hold_lost(layout: Layout, memory: Memory, readings: Array, f: int) -> None:
    """Set the readings of the taxels without a tare to a valid number that never changes."""
    first, low, high = (
        layout.offsets[f], layout.constants[f, at.LOW_LIMIT], layout.constants[f, at.HIGH_LIMIT]
    )  # fmt: skip
    neutral = 0.0 if low < 0.0 < high else 0.5 * (low + high)
    for i in range(first, layout.offsets[f + 1]):
        if memory.counts[f, at.LOST] & bit_of(i - first):
            readings[i, 0] = readings[i, 1] = readings[i, 2] = neutral
            memory.taxels[i, at.CHANGED_AT] = memory.counts[f, at.N_CHANGES]  # not still


@compiled_step
def lose_taxels(layout: Layout, memory: Memory, f: int, faults: int, bits: int) -> None:
    """Count a sample of the tare that is not valid, and leave out its taxels if it lasts."""
    counts = memory.counts
    counts[f, at.N_REFUSED] += 1
    lost = counts[f, at.LOST] | bits
    n_used = layout.constants[f, at.N_USED]
    enough = n_used - _n_bits(lost) >= MIN_HEALTHY_SHARE * n_used
    if counts[f, at.N_REFUSED] * layout.period >= LOST_SECONDS and enough and bits:
        counts[f, at.LOST] = lost
        counts[f, at.LOST_FAULTS] |= faults


@compiled_step
def _n_bits(bits: int) -> int:
    n = 0
    while bits:
        bits &= bits - 1
        n += 1
    return n


@compiled_step
def replace_invalid(layout: Layout, memory: Memory, readings: Array, f: int, bits: int) -> bool:
    """Replace readings that are not valid by the last that were. Return whether enough are valid.

    Args:
        layout: of the stream.
        memory: of the stream, after the tare.
        readings: of all fingers; are changed.
        f: the finger.
        bits: of the taxels whose readings are not valid.
    """
    counts, previous = memory.counts, memory.previous
    first, last = layout.offsets[f], layout.offsets[f + 1]
    if bits == 0 or last - first > N_MASK_BITS:
        return False
    for i in range(first, last):
        if bits & bit_of(i - first):
            for axis in range(3):
                readings[i, axis] = previous[i, axis]
            memory.taxels[i, at.CHANGED_AT] = counts[f, at.N_CHANGES]  # no taxel that is still
    bits |= counts[f, at.MASKED] | counts[f, at.FAULTY_TAXELS] | counts[f, at.LOST]
    if bits == counts[f, at.MASKED]:
        return bool(counts[f, at.TOO_MANY] == 0)
    known, enough = _weigh(layout, memory, readings, f, bits)
    if not (known or enough):  # what they would carry stays unknown under a load as well
        for i in range(first, last):
            if bits & bit_of(i - first):
                memory.masks[i, at.UNWEIGHED] = 1.0
    return bool(enough)


@compiled_step
def mask_taxels(
    layout: Layout, memory: Memory, readings: Array, f: int, bits: int, time: float
) -> bool:
    """Fill in the faulty taxels of a finger. Return False, and fill none, if they carry too much.

    Args:
        layout: of the stream.
        memory: of the stream; is changed.
        readings: of all fingers, all valid; are changed.
        f: the finger.
        bits: of its faulty taxels.
        time: of the sample [s].
    """
    counts = memory.counts
    if layout.offsets[f + 1] - layout.offsets[f] > N_MASK_BITS:
        return False
    if bits != counts[f, at.MASKED] or counts[f, at.TOO_MANY] or counts[f, at.UNLOADED]:
        _change_mask(layout, memory, readings, f, bits, time)
    if counts[f, at.TOO_MANY]:
        return False
    _fill_taxels(layout, memory, readings, f)
    return True


@compiled_step
def _beyond_rest(
    rotations: Array, reference: Array, baseline: Array, readings: Array, i: int
) -> tuple[float, float, float]:
    """Return the reading of a taxel beyond that at rest, in its own frame."""
    # h_i = f_i - b_i - R_i^T g_i(reference).
    x, y, z = reference[i, 0], reference[i, 1], reference[i, 2]
    turn = rotations[i]
    return (
        readings[i, 0] - baseline[i, 0] - (turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z),
        readings[i, 1] - baseline[i, 1] - (turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z),
        readings[i, 2] - baseline[i, 2] - (turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z),
    )


@compiled_step
def _load_of(
    layout: Layout, memory: Memory, readings: Array, f: int, i: int
) -> tuple[float, float, float]:
    """Return what a taxel counts for before the mask changes: filled in, fading, or as it is."""
    masks, bit = memory.masks, bit_of(i - layout.offsets[f])
    if (memory.counts[f, at.NOISY_TAXELS] | memory.counts[f, at.LOST]) & bit:
        return 0.0, 0.0, 0.0  # not known
    if memory.counts[f, at.MASKED] & bit and memory.counts[f, at.TOO_MANY] == 0:
        ratio = memory.levels[f, at.FILL_RATIO]
        return (
            ratio * masks[i, at.LAST_HEALTHY],
            ratio * masks[i, at.LAST_HEALTHY + 1],
            ratio * masks[i, at.LAST_HEALTHY + 2],
        )
    x, y, z = _beyond_rest(layout.rotations, memory.reference, memory.baseline, readings, i)
    return x + masks[i, at.FADE], y + masks[i, at.FADE + 1], z + masks[i, at.FADE + 2]


@compiled_step
def _weigh(layout: Layout, memory: Memory, readings: Array, f: int, bits: int) -> tuple[bool, bool]:
    """Return whether the load is known, and whether the other taxels carry enough.

    Args:
        layout: of the stream.
        memory: of the stream.
        readings: of all fingers.
        f: the finger.
        bits: of the faulty taxels.
    """
    first, n_used = layout.offsets[f], layout.constants[f, at.N_USED]
    carried = healthy = all_squares = 0.0
    n_masked = n_unweighed = 0
    for i in range(first, layout.offsets[f + 1]):
        if layout.ignored[i]:
            continue
        x, y, z = _load_of(layout, memory, readings, f, i)
        square = x * x + y * y + z * z
        all_squares += square
        if bits & bit_of(i - first):
            carried += math.sqrt(square)
            n_masked += 1
            n_unweighed += _is_unweighed(memory, f, i, bit_of(i - first))
        else:
            healthy += math.sqrt(square)
    # Enough: sum over the healthy |h_i| >= half of that over all; and where loads are not known,
    # n - n_unknown >= n / 2.
    known = all_squares > _known_squares(layout, memory, f)  # False for NaN
    if known:
        left = n_used - n_unweighed
        enough = healthy >= MIN_HEALTHY_SHARE * (healthy + carried) and n_masked < n_used
    else:
        left = n_used - n_masked
        enough = n_masked < n_used
    return known, enough and left >= MIN_HEALTHY_SHARE * n_used


@compiled_step
def _known_squares(layout: Layout, memory: Memory, f: int) -> float:
    """Return the sum of squares of the taxels of a finger beyond which its load is known."""
    # sum |h_i|^2 > n (10 noise)^2, with the noise of a reading: noise of F / sqrt(n).
    return float((KNOWN_LOAD_TO_NOISE * memory.levels[f, at.NOISE]) ** 2)


@compiled_step
def _is_unweighed(memory: Memory, f: int, i: int, bit: int) -> bool:
    """Return whether the load of a masked taxel is not known even if that of the finger is."""
    if memory.counts[f, at.MASKED] & bit:
        return bool(memory.masks[i, at.UNWEIGHED] > 0.0)
    unknown = (memory.counts[f, at.NOISY_TAXELS] | memory.counts[f, at.LOST]) & bit
    still = memory.masks[i, at.UNWEIGHED] > 0.0  # since a mask before
    return bool(unknown != 0 or still or memory.taxels[i, at.N_CHANGED] == 0.0)


@compiled_step
def _change_mask(
    layout: Layout, memory: Memory, readings: Array, f: int, bits: int, time: float
) -> None:
    """Mask other taxels than before, and let those that come back fade in."""
    counts, levels, masks = memory.counts, memory.levels, memory.masks
    first, last = layout.offsets[f], layout.offsets[f + 1]
    before = 0 if counts[f, at.TOO_MANY] else counts[f, at.MASKED]
    known, enough = _weigh(layout, memory, readings, f, bits)
    squares = 0.0
    for i in range(first, last):
        bit = bit_of(i - first)
        x, y, z = _load_of(layout, memory, readings, f, i)
        if bits & bit:
            unweighed = not known or _is_unweighed(memory, f, i, bit)
            masks[i, at.UNWEIGHED] = 1.0 if unweighed else 0.0
            masks[i, at.FADE] = masks[i, at.FADE + 1] = masks[i, at.FADE + 2] = 0.0
            if before & bit == 0:
                masks[i, at.MASKED_AT] = time
        elif counts[f, at.N_CHANGES] - memory.taxels[i, at.CHANGED_AT] < STILL_CHANGES:
            masks[i, at.UNWEIGHED] = 0.0
        if before & bit & ~bits:
            _return_taxel(layout, memory, readings, f, i, time)
            x, y, z = _beyond_rest(layout.rotations, memory.reference, memory.baseline, readings, i)
            x, y, z = (
                x + masks[i, at.FADE], y + masks[i, at.FADE + 1], z + masks[i, at.FADE + 2]
            )  # fmt: skip
        masks[i, at.LAST_HEALTHY], masks[i, at.LAST_HEALTHY + 1], masks[i, at.LAST_HEALTHY + 2] = (
            x,
            y,
            z,
        )
        if not (bits & bit or layout.ignored[i]):
            squares += x * x + y * y + z * z
    # No window holds the samples of a taxel that became noisy, nor both ways to sum a finger.
    noisy = counts[f, at.NOISY_TAXELS] & ~counts[f, at.MASKED]
    if noisy or (not enough and before):
        counts[f, at.N_STRETCH] = counts[f, at.N_MOTION] = 0
    counts[f, at.MASKED], counts[f, at.TOO_MANY] = bits, 0 if enough else 1
    counts[f, at.LOAD_KNOWN] = 1 if known and squares > 0.0 else 0
    counts[f, at.UNLOADED] = 0
    levels[f, at.FILL_SQUARES], levels[f, at.FILL_RATIO] = squares, 1.0


@compiled_step
def _return_taxel(
    layout: Layout, memory: Memory, readings: Array, f: int, i: int, time: float
) -> None:
    """Note how far what was filled in for a taxel is from its reading, if it was long."""
    masks = memory.masks
    if time - masks[i, at.MASKED_AT] <= MAX_BRIDGED_SECONDS:
        return
    # fade_i = ratio shape_i - h_i.
    ratio = memory.levels[f, at.FILL_RATIO]
    x, y, z = _beyond_rest(layout.rotations, memory.reference, memory.baseline, readings, i)
    masks[i, at.FADE] = ratio * masks[i, at.LAST_HEALTHY] - x
    masks[i, at.FADE + 1] = ratio * masks[i, at.LAST_HEALTHY + 1] - y
    masks[i, at.FADE + 2] = ratio * masks[i, at.LAST_HEALTHY + 2] - z
    memory.counts[f, at.FADING] = 1


@compiled_step
def _fill_taxels(layout: Layout, memory: Memory, readings: Array, f: int) -> None:
    """Fill in the masked taxels of a finger, and let those fade that came back."""
    counts, levels, masks = memory.counts, memory.levels, memory.masks
    first, last, bits = layout.offsets[f], layout.offsets[f + 1], counts[f, at.MASKED]
    if counts[f, at.FADING]:
        _fade_taxels(layout, memory, readings, f)
    if bits == 0:
        return
    # ratio = sum over the healthy h_i . shape_i / sum |shape_i|^2: linear in the readings.
    ratio = levels[f, at.FILL_RATIO]
    if counts[f, at.LOAD_KNOWN]:
        ratio = squares = 0.0
        for i in range(first, last):
            if bits & bit_of(i - first) or layout.ignored[i]:
                continue
            x, y, z = _beyond_rest(layout.rotations, memory.reference, memory.baseline, readings, i)
            ratio += x * masks[i, at.LAST_HEALTHY]
            ratio += y * masks[i, at.LAST_HEALTHY + 1]
            ratio += z * masks[i, at.LAST_HEALTHY + 2]
            squares += x * x + y * y + z * z
        ratio /= levels[f, at.FILL_SQUARES]
        counts[f, at.UNLOADED] = 1 if squares < _known_squares(layout, memory, f) else 0
    levels[f, at.FILL_RATIO] = ratio
    # f_i = f_i(rest) + ratio shape_i.
    for i in range(first, last):
        if bits & bit_of(i - first):
            x, y, z = _beyond_rest(layout.rotations, memory.reference, memory.baseline, readings, i)
            readings[i, 0] += ratio * masks[i, at.LAST_HEALTHY] - x
            readings[i, 1] += ratio * masks[i, at.LAST_HEALTHY + 1] - y
            readings[i, 2] += ratio * masks[i, at.LAST_HEALTHY + 2] - z


@compiled_step
def _fade_taxels(layout: Layout, memory: Memory, readings: Array, f: int) -> None:
    """Add what is left of the difference of taxels that came back, and reduce it."""
    masks = memory.masks
    # fade_i(k+1) = (1 - T / tau) fade_i(k), until all are below 0.1 times the noise of a reading.
    keep = 1.0 - min(1.0, layout.period / FADE_SECONDS)
    largest = 0.0
    for i in range(np.int64(layout.offsets[f]), np.int64(layout.offsets[f + 1])):
        for axis in range(3):
            fade = masks[i, at.FADE + axis]
            readings[i, axis] += fade
            masks[i, at.FADE + axis] = keep * fade
            largest = max(largest, abs(fade))
    noise = memory.levels[f, at.NOISE] / math.sqrt(layout.constants[f, at.N_USED])
    if not largest > FADED_TO_NOISE * noise:
        memory.counts[f, at.FADING] = 0
        for i in range(layout.offsets[f], layout.offsets[f + 1]):
            masks[i, at.FADE] = masks[i, at.FADE + 1] = masks[i, at.FADE + 2] = 0.0
