"""What happens to one sample of a hand: tare, force, faults, features. Compiled, no objects.

`advance` is the only path from readings to features that a model sees: live, offline and in
training. All memory is laid out beforehand and never grows. What belongs to one finger is a
row of an array, and columns have names: a slice would cost as much as the sum it is for.
"""

import math
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled
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
from holdfast.features.haar import haar_window

_inlined = numba.njit(error_model="numpy", inline="always")
"""For steps that take all arrays: handing them over costs as much as the step."""

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

# Codes of holdfast.contact.Reason.
READY, TARE, WARM_UP, GAP, FAULT = range(5)

TARE_SECONDS, TARE_FIRST, TARE_NONE, TARE_GIVEN = range(4)

NOISE_SECONDS = 0.5
"""How long the noise of a sensor is watched where the tare takes no time [s]."""
LOADED_SECONDS = 0.25
"""Pulling for so long means that the tare was taken under load: nothing pulls a skin [s]."""
GAP_LIMIT = 3.0003
"""Sample periods; a longer step is a gap. The part over 3 is for the rounding of times."""

# Columns of Memory.counts.
SEEN = 0  # samples that made sense
RUN = 1  # forces in the present stretch
GAPPED = 2  # 1 while a stretch that follows a gap warms up
TARED = 3  # samples in the baseline so far; -1 once it is frozen
FROZEN = 4  # samples since the readings last changed
CHANGES = 5  # samples that changed the readings
PULLING = 6  # samples since the normal readings together turned negative
END = 7  # one past the newest value in the history, before which a window is contiguous
WRONG = 8  # faults of taxels by themselves, by the last sample that changed any
WRONG_TAXELS = 9  # bits of those taxels
N_COUNTS = 10

# Columns of Memory.levels.
FIRST = 0  # time of the first finite sample [s]
LAST = 1  # time of the last sample [s]
STEPS = 2  # sum of squared steps of the force, while the noise is measured
N_STEPS = 3  # their number
NOISE = 4  # standard deviation of a force component by noise alone; NaN while unknown
LARGEST = 5  # largest F_a so far, of samples that nothing spoiled
N_LEVELS = 6

# Columns of Layout.constants.
LEAST, MOST = 0, 1  # readings that the sensor can send
LEAST_NOISE = 2  # of a force component, by the step of the readings
ROUNDING = 3  # noise of a reading by its step; NaN where the step is not known
N_USED = 4  # taxels that are not ignored
N_CONSTANTS = 5

# Columns of Layout.specs.
KIND, WINDOW, TRANSFORM, SCOPE, SAME_AS = range(5)

# Columns of Layout.windows.
SIGMA_WINDOW, LONGEST = 0, 1

# Columns of Output.values: F_tip, then
AMPLITUDE, MEAN, SIGMA = 3, 4, 5  # F_a, and m and sigma over the reported window
N_VALUES = 6

FIRST_WINDOWED = 4
"""Kinds of features before it look at one sample: the channels of the history."""
SIGMA_XYZ, CHANGE = 6, 7
"""Kinds beyond the paper's six, in the order of holdfast.features.specs.KINDS."""

# Columns of Output.status.
REASON, FAULTS = 0, 1
TAXELS = 2  # bit i is taxel i of the finger, where it is at fault by itself
N_STATUS = 3


class Layout(NamedTuple):
    """What does not change while a stream runs; taxels of all fingers one after the other."""

    offsets: Integers  # (n_fingers + 1,) first taxel of each finger
    rotations: Array  # (n_taxels, 3, 3)
    constants: Array  # (n_fingers, N_CONSTANTS)
    specs: Integers  # (n_fingers, n_features, 5) as `spec_codes` gives them
    floors: Array  # (n_fingers, n_features)
    windows: Integers  # (n_fingers, 2) of the reported sigma, and the longest
    ignored: Flags  # (n_taxels,) those that contribute nothing
    alike: bool  # whether all fingers have the same features
    tare_kind: int
    tare_seconds: float
    period: float


class Memory(NamedTuple):
    """What a stream remembers."""

    baseline: Array  # (n_taxels, 3) a sum while the tare runs, then the mean
    previous: Array  # (n_taxels, 3) readings of the last sample that made sense
    taxels: Array  # (n_taxels, N_TAXEL) of holdfast.features.faults
    history: Array  # (n_fingers, 4, 2 * longest) F_a, F_x, F_y, F_z, each written twice
    counts: Integers  # (n_fingers, N_COUNTS)
    levels: Array  # (n_fingers, N_LEVELS)
    own: Array  # (n_fingers, n_features) each finger's own values, before the hand's largest


class Output(NamedTuple):
    """What is known after a sample; NaN where nothing is."""

    features: Array  # (n_fingers, n_features)
    values: Array  # (n_fingers, N_VALUES)
    status: Integers  # (n_fingers, N_STATUS)


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
            memory.own[f] = math.nan
            counts[f, GAPPED] = 1
            status[f, REASON], status[f, FAULTS], status[f, TAXELS] = GAP, 0, 0
            output.values[f] = math.nan
        if present[f]:
            status[f, REASON], status[f, FAULTS], status[f, TAXELS] = _take(
                layout, memory, output.values, readings, time, f
            )
    for f in range(len(present)):
        if present[f]:
            _own_features(layout, memory, output, f)
    for f in range(len(present)):
        if status[f, REASON] != READY:
            output.features[f] = math.nan
        elif present[f]:
            _fill_features(layout, memory, output, f)
            if math.isnan(output.features[f].sum()):  # the noise is not known yet
                status[f, REASON] = TARE


@_inlined
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
    values[f] = math.nan
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
    if not _prepared(layout, memory, readings, f, elapsed):
        return TARE, 0, 0
    faults, bits = counts[f, WRONG], counts[f, WRONG_TAXELS]
    if least <= low or most >= high:
        faults |= SATURATED
        bits |= outside(readings, ignored, first, last, low, high)
    return _feel(layout, memory, values, readings, f, faults, bits)


@_inlined
def _feel(
    layout: Layout, memory: Memory, values: Array, readings: Array, f: int, faults: int, bits: int
) -> tuple[int, int, int]:
    """The force of a sample, with its faults so far; what `_take` returns."""
    counts, levels, windows = memory.counts, memory.levels, layout.windows
    first, last = layout.offsets[f], layout.offsets[f + 1]
    x, y, z, pressing = force_of(readings, memory.baseline, layout.rotations, first, last)
    _remember(memory.history, counts, values, f, x, y, z)
    if _stuck(counts, f, layout.period):
        faults |= STUCK
    if faults & SPOILING:
        counts[f, RUN] = counts[f, PULLING] = 0
        return FAULT, faults, bits
    levels[f, LARGEST] = max(levels[f, LARGEST], values[f, AMPLITUDE])
    if counts[f, RUN] >= windows[f, SIGMA_WINDOW]:
        moments = _moments(memory.history, counts, f, 0, windows[f, SIGMA_WINDOW])
        values[f, MEAN], values[f, SIGMA] = moments
    if layout.tare_kind == TARE_SECONDS and _pulled(counts, levels, f, pressing, layout.period):
        faults |= TARE_LOADED
    if faults:
        return FAULT, faults, bits
    if counts[f, RUN] < windows[f, LONGEST]:
        return GAP if counts[f, GAPPED] else WARM_UP, 0, 0
    counts[f, GAPPED] = 0
    return READY, 0, 0


@_inlined
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


@compiled
def force_of(
    readings: Array, baseline: Array, rotations: Array, first: int, last: int
) -> tuple[float, float, float, float]:
    """F_tip = sum over taxels of R_i (f_i - baseline_i), and the sum of the normal readings."""
    fx = fy = fz = pressing = 0.0
    for i in range(first, last):
        x = readings[i, 0] - baseline[i, 0]
        y = readings[i, 1] - baseline[i, 1]
        z = readings[i, 2] - baseline[i, 2]
        fx += rotations[i, 0, 0] * x + rotations[i, 0, 1] * y + rotations[i, 0, 2] * z
        fy += rotations[i, 1, 0] * x + rotations[i, 1, 1] * y + rotations[i, 1, 2] * z
        fz += rotations[i, 2, 0] * x + rotations[i, 2, 1] * y + rotations[i, 2, 2] * z
        pressing += z
    return fx, fy, fz, pressing


@_inlined
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


@_inlined
def _prepared(layout: Layout, memory: Memory, readings: Array, f: int, elapsed: float) -> bool:
    """Whether the tare is complete; takes the sample into it, and into the noise, until then."""
    counts, kind, seconds = memory.counts, layout.tare_kind, layout.tare_seconds
    first, last = layout.offsets[f], layout.offsets[f + 1]
    if math.isnan(memory.levels[f, NOISE]):
        watched = elapsed >= (seconds if kind == TARE_SECONDS else NOISE_SECONDS)
        _listen(layout, memory, readings, f, watched)
    memory.previous[first:last] = readings[first:last]
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


@compiled
def _moments(
    history: Array, counts: Integers, f: int, channel: int, window: int
) -> tuple[float, float]:
    """The m and sigma of the last `window` values; the stretch must hold so many."""
    end = counts[f, END]
    return haar_window(history[f, channel, end - window : end], window)


@_inlined
def _own_features(layout: Layout, memory: Memory, output: Output, f: int) -> None:
    """The values of a finger's features by itself; NaN where its stretch is too short."""
    specs, floors, reported = layout.specs, layout.floors, layout.windows[f, SIGMA_WINDOW]
    _, _, _, history, counts, levels, own = memory
    for place in range(specs.shape[1]):
        kind, window = specs[f, place, KIND], specs[f, place, WINDOW]
        if kind < 0:
            own[f, place] = 0.0  # in place of those that pad
        elif specs[f, place, SAME_AS] < place:
            own[f, place] = own[f, specs[f, place, SAME_AS]]
        elif counts[f, RUN] < max(window, 1):
            own[f, place] = math.nan
        else:
            if window == reported and kind < SIGMA_XYZ:
                value = output.values[f, MEAN + kind - FIRST_WINDOWED]
            else:
                value = _feature(kind, window, history, counts, f)
            noise, floor = levels[f, NOISE], floors[f, place]
            own[f, place] = _transform(value, specs[f, place, TRANSFORM], window, noise, floor)


@_inlined
def _fill_features(layout: Layout, memory: Memory, output: Output, f: int) -> None:
    own = memory.own
    for place in range(layout.specs.shape[1]):
        value = own[f, place]
        if layout.specs[f, place, SCOPE] == 1:
            for other in range(len(own)):
                rival = own[other, place]
                if not layout.alike:
                    rival = _of_other(layout, memory, f, place, other)
                if rival > value or math.isnan(value):
                    value = rival
        output.features[f, place] = value


@compiled
def _of_other(layout: Layout, memory: Memory, f: int, place: int, other: int) -> float:
    """A feature of finger f, of another finger; NaN where its stretch is too short."""
    kind, window = layout.specs[f, place, KIND], layout.specs[f, place, WINDOW]
    if memory.counts[other, RUN] < max(window, 1):
        return math.nan
    value = _feature(kind, window, memory.history, memory.counts, other)
    transform, floor = layout.specs[f, place, TRANSFORM], layout.floors[f, place]
    return float(_transform(value, transform, window, memory.levels[other, NOISE], floor))


@compiled
def _feature(kind: int, window: int, history: Array, counts: Integers, f: int) -> float:
    if kind < FIRST_WINDOWED:
        return float(history[f, kind, counts[f, END] - 1])
    if kind < SIGMA_XYZ:
        return _moments(history, counts, f, 0, window)[kind - FIRST_WINDOWED]
    total = 0.0
    for axis in range(1, 4):
        if kind == CHANGE:
            value = history[f, axis, counts[f, END] - 1] - history[f, axis, counts[f, END] - window]
        else:
            value = _moments(history, counts, f, axis, window)[1]
        total += value * value
    return math.sqrt(total)


@compiled
def _transform(value: float, transform: int, window: int, noise: float, floor: float) -> float:
    if transform == 0:
        return float(value)
    if transform == 1:
        return math.log(math.sqrt(value * value + floor * floor))
    expected = noise_sigma(noise, window)
    return math.log(max(value, 1e-3 * expected) / expected)


@compiled
def noise_sigma(noise: float, window: int) -> float:
    """The sigma that noise alone gives."""
    return noise * math.sqrt((window - 2.0) / (2.0 * window))
