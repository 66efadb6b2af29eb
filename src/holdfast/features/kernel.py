"""One sample of a hand: tare, force, faults and features. Compiled, no objects.

`advance` is the only path from readings to the features that a model receives: live, offline and
in training. All memory is allocated beforehand and never grows. Steps that take all arrays are
inlined: passing the arrays costs as much as the step.
"""

import math

from holdfast.compiled import compiled_step, inlined, joined_step
from holdfast.features import arrays as at
from holdfast.features.arrays import Layout, Memory, Output
from holdfast.features.faults import (
    N_MASK_BITS,
    NOT_FINITE,
    SATURATED,
    SERIOUS,
    STUCK,
    TARE_LOADED,
    copy_readings,
    invalid_taxels,
    is_pulled,
    is_stuck,
    scan_readings,
    taxels_outside,
    track_changes,
)
from holdfast.features.force import sum_taxels
from holdfast.features.haar import N_SUMS, append_pair, newest_moments, newest_variance
from holdfast.features.masks import (
    hold_lost,
    lose_taxels,
    mask_taxels,
    note_saturated,
    replace_invalid,
)
from holdfast.features.motion import GAP_LIMIT_PERIODS, append_taxels, update_motion
from holdfast.features.specs import FEATURE_KINDS, SCOPES, TRANSFORMS, VALUE_KINDS
from holdfast.features.tare import update_baseline
from holdfast.features.untrue import find_untrue
from holdfast.sensors.types import Array, Flags, Integers

# Codes of features: positions in the lists of holdfast.features.specs.
FIRST_RELATIVE = len(VALUE_KINDS)
OF_M, OF_SIGMA, OF_SIGMA_XYZ, OF_CHANGE = map(
    FEATURE_KINDS.index, ("m", "sigma", "sigma_xyz", "change")
)
NO_TRANSFORM, LOG = map(TRANSFORMS.index, ("none", "log"))
OF_HAND = SCOPES.index("hand")


@joined_step
def advance(
    layout: Layout, memory: Memory, output: Output, readings: Array, present: Flags, time: float
) -> None:
    """Process one sample of the fingers that are present, and fill the output.

    Args:
        layout: of the hand.
        memory: is changed.
        output: is filled.
        readings: (n_taxels, 3) of all fingers. Those of absent fingers are not read, and those
            of ignored taxels are set to zero, and those of faulty ones filled in.
        present: (n_fingers,) True for each finger with a sample.
        time: of the sample [s].
    """
    counts, status = memory.counts, output.status
    for f in range(len(present)):
        # A gap: t - t_last > 3 T, with the period T; or > 0.1 s where all windows are in seconds.
        # False while LAST_TIME is NaN.
        if time - memory.levels[f, at.LAST_TIME] > layout.constants[f, at.MAX_STEP]:
            counts[f, at.N_STRETCH] = counts[f, at.N_UNCHANGED] = counts[f, at.N_PULLED] = 0
            _clear(memory.own, f)
            memory.relative[f] = math.nan
            counts[f, at.AFTER_GAP] = 1
            status[f, at.REASON], status[f, at.FAULTS], status[f, at.TAXELS] = at.GAP, 0, 0
            _clear(output.values, f)
        if present[f]:
            status[f, at.REASON], status[f, at.FAULTS], status[f, at.TAXELS] = _process(
                layout, memory, output.values, readings, time, f
            )
    for f in range(len(present)):
        if present[f]:
            _compute_own(layout, memory, output, f)
    if layout.alike:
        for place in range(layout.specs.shape[1]):
            if layout.specs[0, place, at.SCOPE] == OF_HAND:
                memory.hand[place] = _largest(memory.own, place)
    for f in range(len(present)):
        if status[f, at.REASON] != at.READY:
            _clear(output.features, f)
        elif present[f]:
            # Phi = [F_a, F_x, F_y, F_z, m, sigma], or what the model asks for.
            total = _fill_features(layout, memory, output, f)
            if math.isnan(total):  # the noise is not known yet
                status[f, at.REASON] = at.TARE


@inlined
def _process(
    layout: Layout, memory: Memory, values: Array, readings: Array, time: float, f: int
) -> tuple[int, int, int]:
    """Process a sample of one finger. Return its reason, its faults and their taxels."""
    counts, levels, ignored = memory.counts, memory.levels, layout.ignored
    constants = layout.constants
    first, last = layout.offsets[f], layout.offsets[f + 1]
    low, high = constants[f, at.LOW_LIMIT], constants[f, at.HIGH_LIMIT]
    for column in range(at.VALUES_WIDTH):
        values[f, column] = math.nan
    after_gap = time - levels[f, at.LAST_TIME] > GAP_LIMIT_PERIODS * layout.period
    levels[f, at.LAST_TIME] = time
    if after_gap:
        counts[f, at.N_STRETCH] = 0
    lost, faults = counts[f, at.LOST], counts[f, at.LOST_FAULTS]
    if lost:
        hold_lost(layout, memory, readings, f)
    total, least, most = scan_readings(readings, ignored, first, last)
    bits = lost
    # Valid: finite, and low <= every reading <= high.
    if not math.isfinite(total) or least < low or most > high:
        invalid = _replace_or_refuse(layout, memory, readings, f, math.isfinite(total))
        faults, bits = faults | invalid[1], bits | invalid[2]
        if not invalid[0]:
            counts[f, at.N_STRETCH] = 0
            return at.FAULT, faults, bits
        total, least, most = scan_readings(readings, ignored, first, last)
    untrue = find_untrue(layout, memory, readings, f, total, least, most)
    if untrue:
        counts[f, at.N_STRETCH] = 0
        return at.FAULT, faults | untrue, bits
    track_changes(layout, memory, readings, f, time, after_gap)
    # Half a period of tolerance: the rounding of times moves no sample.
    elapsed = time - levels[f, at.FIRST_TIME] + 0.5 * layout.period
    # Saturated: a reading at low or at high.
    at_limit, is_saturated = 0, least <= low or most >= high
    if is_saturated:
        at_limit = taxels_outside(readings, ignored, first, last, low, high)
        if counts[f, at.N_TARED] < 0 and last - first <= N_MASK_BITS:
            new = at_limit & ~counts[f, at.MASKED]
            note_saturated(memory.masks, memory.previous, readings, first, last, new)
    if not _update_tare(layout, memory, readings, f, elapsed):
        return at.TARE, faults, bits
    faults, bits = faults | counts[f, at.TAXEL_FAULTS], bits | counts[f, at.FAULTY_TAXELS]
    if is_saturated:
        faults, bits = faults | SATURATED, bits | at_limit
    enough = True
    if faults | counts[f, at.MASKED] | counts[f, at.FADING]:
        enough = mask_taxels(layout, memory, readings, f, bits, time)
    return _process_force(layout, memory, values, readings, f, faults, bits, enough)


@inlined
def _replace_or_refuse(
    layout: Layout, memory: Memory, readings: Array, f: int, finite: bool
) -> tuple[bool, int, int]:
    """Replace the readings of a sample that are not valid, if enough are valid.

    Returns:
        Whether the sample can be used, its faults, and the bits of their taxels.
    """
    counts, constants = memory.counts, layout.constants
    first, last = layout.offsets[f], layout.offsets[f + 1]
    low, high = constants[f, at.LOW_LIMIT], constants[f, at.HIGH_LIMIT]
    faults, bits = invalid_taxels(readings, layout.ignored, first, last, low, high)
    if not finite:
        faults |= NOT_FINITE  # also of taxels beyond the mask
    if counts[f, at.N_TARED] >= 0:
        lose_taxels(layout, memory, f, faults, bits)
        return False, faults, bits
    return replace_invalid(layout, memory, readings, f, bits), faults, bits


@inlined
def _update_tare(layout: Layout, memory: Memory, readings: Array, f: int, elapsed: float) -> bool:
    """Add a sample to the noise and to the tare. Return whether the tare is complete."""
    counts, kind, seconds = memory.counts, layout.tare_kind, layout.tare_seconds
    first, last = layout.offsets[f], layout.offsets[f + 1]
    if math.isnan(memory.levels[f, at.NOISE]):
        # noise = sqrt(sum |F(k) - F(k-1)|^2 / (6 n)), over the first n steps.
        _measure_noise(layout, memory, readings, f, elapsed >= layout.noise_seconds)
    copy_readings(readings, memory.previous, first, last)
    if counts[f, at.N_TARED] < 0:
        return True
    # b_i = mean of f_i over the samples with t - t_first < tare_seconds.
    counts[f, at.N_REFUSED] = 0
    running = elapsed < seconds or counts[f, at.N_TARED] == 0  # one sample at least
    return bool(update_baseline(readings, memory.baseline, counts, f, first, last, kind, running))


@compiled_step
def _measure_noise(layout: Layout, memory: Memory, readings: Array, f: int, complete: bool) -> None:
    """Measure the noise of a force component by the steps from sample to sample.

    A step has the noise of two samples, in three components: sixfold the variance.
    """
    levels = memory.levels
    if complete:
        # noise = max(sqrt(sum |step|^2 / (6 n)), noise of the rounding).
        measured = math.sqrt(levels[f, at.SQUARED_STEPS] / (6.0 * max(levels[f, at.N_STEPS], 1.0)))
        levels[f, at.NOISE] = max(measured, layout.constants[f, at.MIN_NOISE])
    elif memory.counts[f, at.N_SEEN] > 1:
        first = layout.offsets[f]
        # step = sum_i R_i (f_i(k) - f_i(k-1)).
        n = layout.n_taxels[f]
        x, y, z, _ = sum_taxels(readings, memory.previous, layout.rotations, first, n)
        levels[f, at.SQUARED_STEPS] += x * x + y * y + z * z
        levels[f, at.N_STEPS] += 1.0


@inlined
def _process_force(
    layout: Layout,
    memory: Memory,
    values: Array,
    readings: Array,
    f: int,
    faults: int,
    bits: int,
    enough: bool,
) -> tuple[int, int, int]:
    """Compute the force of a sample, given its faults so far. Return the same as `_process`.

    Args:
        layout: of the hand.
        memory: is changed.
        values: of the output; are filled.
        readings: of all fingers.
        f: the finger.
        faults: of its taxels.
        bits: of these taxels.
        enough: whether it goes on without them.
    """
    counts, levels, windows = memory.counts, memory.levels, layout.windows
    # F_tip = sum_i R_i (f_i - b_i).
    if len(layout.lags):
        x, y, z, normal = append_taxels(layout, memory, readings, f, levels[f, at.LAST_TIME])
    else:
        first, n = layout.offsets[f], layout.n_taxels[f]
        x, y, z, normal = sum_taxels(readings, memory.baseline, layout.rotations, first, n)
    _append(memory.history, counts, values, f, x, y, z)
    _append_blocks(memory.history, memory.blocks, counts, f, layout.n_levels)
    if len(layout.lags):
        update_motion(layout, memory, f, levels[f, at.LAST_TIME])
    finger_faults = 0 if enough else faults
    if is_stuck(counts, f, layout.period):
        finger_faults |= STUCK
    faults |= finger_faults
    if finger_faults & SERIOUS:
        counts[f, at.N_STRETCH] = counts[f, at.N_MOTION] = counts[f, at.N_PULLED] = 0
        return at.FAULT, faults, bits
    # max over k of F_a(k).
    levels[f, at.MAX_AMPLITUDE] = max(levels[f, at.MAX_AMPLITUDE], values[f, at.AMPLITUDE])
    # m and sigma over the reported window: equations 1 and 2 of the paper.
    if counts[f, at.N_STRETCH] >= windows[f, at.SIGMA_WINDOW]:
        found = _moments(memory.blocks, counts, f, 0, windows[f, at.SIGMA_WINDOW])
        values[f, at.MEAN], values[f, at.SIGMA] = found
    if layout.tare_kind == at.TARE_SECONDS and is_pulled(counts, levels, f, normal, layout.period):
        finger_faults |= TARE_LOADED
        faults |= TARE_LOADED
    if finger_faults:
        return at.FAULT, faults, bits
    n_known = counts[f, at.N_MOTION if windows[f, at.BRIDGES] else at.N_STRETCH]
    if n_known < windows[f, at.READY_WINDOW]:
        return at.GAP if counts[f, at.AFTER_GAP] else at.WARM_UP, faults, bits
    counts[f, at.AFTER_GAP] = 0
    return at.READY, faults, bits


@compiled_step
def _append(
    history: Array, counts: Integers, values: Array, f: int, x: float, y: float, z: float
) -> None:
    """Append a force to the history of a finger, and write it to the output."""
    # F_a = |F_tip|. A ring of `length` values, each written twice: every window is contiguous.
    amplitude = math.sqrt(x * x + y * y + z * z)
    length = history.shape[2] // 2
    place = counts[f, at.N_STRETCH] % length
    counts[f, at.N_STRETCH] += 1
    counts[f, at.HISTORY_END] = place + length + 1
    history[f, 0, place] = history[f, 0, place + length] = amplitude
    history[f, 1, place] = history[f, 1, place + length] = x
    history[f, 2, place] = history[f, 2, place + length] = y
    history[f, 3, place] = history[f, 3, place + length] = z
    values[f, 0], values[f, 1], values[f, 2] = x, y, z
    values[f, at.AMPLITUDE] = amplitude


@compiled_step
def _append_blocks(history: Array, blocks: Array, counts: Integers, f: int, n_levels: int) -> None:
    """Append the blocks of pairs that end with the newest value, of each channel that needs it."""
    end, width = counts[f, at.HISTORY_END], N_SUMS * n_levels
    for channel in range(blocks.shape[2] // width):
        # The pair (x_0, x_1) = (x(k-1), x(k)): P = x_0 + x_1, D = x_0 - x_1, S = 0 (haar.py).
        older, newer = history[f, channel, end - 2], history[f, channel, end - 1]
        append_pair(older, newer, blocks[f], end - 1 - blocks.shape[1], width * channel, n_levels)


@inlined
def _compute_own(layout: Layout, memory: Memory, output: Output, f: int) -> None:
    """Compute the features of a finger by itself; NaN where its stretch is too short."""
    specs, floors, reported = layout.specs, layout.floors, layout.windows[f, at.SIGMA_WINDOW]
    history, counts, levels, own = memory.history, memory.counts, memory.levels, memory.own
    for place in range(specs.shape[1]):
        kind, window = specs[f, place, at.KIND], specs[f, place, at.WINDOW]
        if kind < 0:
            own[f, place] = 0.0  # padding
        elif specs[f, place, at.SAME_AS] < place:
            own[f, place] = own[f, specs[f, place, at.SAME_AS]]
        elif kind >= FIRST_RELATIVE:
            own[f, place] = memory.relative[f, kind - FIRST_RELATIVE, window]
        elif counts[f, at.N_STRETCH] < max(window, 1):
            own[f, place] = math.nan
        else:
            if window == reported and kind == OF_M:
                value = output.values[f, at.MEAN]  # is computed already
            elif window == reported and kind == OF_SIGMA:
                value = output.values[f, at.SIGMA]
            else:
                value = _feature(kind, window, history, memory.blocks, counts, layout.n_levels, f)
            noise, floor = levels[f, at.NOISE], floors[f, place]
            own[f, place] = _transform(value, specs[f, place, at.TRANSFORM], window, noise, floor)


@inlined
def _fill_features(layout: Layout, memory: Memory, output: Output, f: int) -> float:
    """Fill the features of a finger, with the maximum of the hand by scope. Return their sum."""
    total = 0.0
    for place in range(layout.specs.shape[1]):
        value = memory.own[f, place]
        if layout.specs[f, place, at.SCOPE] == OF_HAND:
            if layout.alike:
                value = memory.hand[place]
            else:
                value = _largest_of_others(layout, memory, f, place)
        output.features[f, place] = value
        total += value
    return total


@joined_step
def _largest(own: Array, place: int) -> float:
    """Return the maximum over the fingers of a feature that all have."""
    # max over the fingers, of those that have the feature.
    value = own[0, place]
    for f in range(1, len(own)):
        rival = own[f, place]
        if rival > value or math.isnan(value):
            value = rival
    return float(value)


@compiled_step
def _largest_of_others(layout: Layout, memory: Memory, f: int, place: int) -> float:
    """Return the maximum over the fingers of a feature of finger f."""
    value = memory.own[f, place]
    for other in range(len(memory.own)):
        rival = _feature_of_other(layout, memory, f, place, other)
        if rival > value or math.isnan(value):
            value = rival
    return float(value)


@compiled_step
def _feature_of_other(layout: Layout, memory: Memory, f: int, place: int, other: int) -> float:
    """Return a feature of finger f for another finger; NaN where its stretch is too short."""
    kind, window = layout.specs[f, place, at.KIND], layout.specs[f, place, at.WINDOW]
    if kind >= FIRST_RELATIVE:
        return float(memory.relative[other, kind - FIRST_RELATIVE, window])
    if memory.counts[other, at.N_STRETCH] < max(window, 1):
        return math.nan
    value = _feature(
        kind, window, memory.history, memory.blocks, memory.counts, layout.n_levels, other
    )
    transform, floor = layout.specs[f, place, at.TRANSFORM], layout.floors[f, place]
    return float(_transform(value, transform, window, memory.levels[other, at.NOISE], floor))


@joined_step
def _feature(
    kind: int, window: int, history: Array, blocks: Array, counts: Integers, n_levels: int, f: int
) -> float:
    """Return a value of a finger whose stretch is long enough for it."""
    newest = counts[f, at.HISTORY_END] - 1
    if kind < at.N_CHANNELS:
        # F_a, F_x, F_y or F_z of the newest sample.
        return float(history[f, kind, newest])
    # m or sigma of F_a: equations 1 and 2.
    if kind == OF_M:
        return _moments(blocks, counts, f, 0, window)[0]
    if kind == OF_SIGMA:
        return _moments(blocks, counts, f, 0, window)[1]
    # change = |F_tip(k) - F_tip(k - N_w + 1)|.
    # sigma_xyz = sqrt(sigma(F_x)^2 + sigma(F_y)^2 + sigma(F_z)^2).
    total = 0.0
    for axis in range(1, 4):
        if kind == OF_CHANGE:
            value = history[f, axis, newest] - history[f, axis, newest + 1 - window]
            total += value * value
        elif kind == OF_SIGMA_XYZ:
            row, first = newest - blocks.shape[1], N_SUMS * n_levels * axis
            total += newest_variance(blocks[f], row, first, window)[1]
    return math.sqrt(total)


@compiled_step
def _moments(
    blocks: Array, counts: Integers, f: int, first: int, window: int
) -> tuple[float, float]:
    """Return m and sigma of the last `window` values; the stretch must have as many."""
    return newest_moments(blocks[f], counts[f, at.HISTORY_END] - 1 - blocks.shape[1], first, window)


@compiled_step
def _transform(value: float, transform: int, window: int, noise: float, floor: float) -> float:
    # none: v. log: log(sqrt(v^2 + floor^2)).
    # noise: log(max(v, sigma_n / 1000) / sigma_n), with sigma_n = `noise_sigma`.
    if transform == NO_TRANSFORM:
        return float(value)
    if transform == LOG:
        return math.log(math.sqrt(value * value + floor * floor))
    expected = noise_sigma(noise, window)
    return math.log(max(value, 1e-3 * expected) / expected)


@compiled_step
def noise_sigma(noise: float, window: int) -> float:
    """Return the sigma that noise of a standard deviation gives."""
    # E[sigma^2] of white noise: d = (x_0 - x_1) / sqrt(2) has the variance noise^2, and
    # sum (d - mean d)^2 over N_w / 2 pairs, divided by N_w, has (N_w / 2 - 1) / N_w of it.
    return noise * math.sqrt((window - 2.0) / (2.0 * window))


@compiled_step
def _clear(values: Array, f: int) -> None:
    """Set the values of a finger to NaN."""
    for place in range(values.shape[1]):
        values[f, place] = math.nan
