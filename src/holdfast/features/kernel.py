"""What happens to one sample of a hand: tare, force, faults, features. Compiled, no objects.

`advance` is the only path from readings to features that a model sees: live, offline and in
training. All memory is laid out beforehand and never grows.
"""

import math
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from holdfast.features.haar import haar_windows

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

# Codes of holdfast.contact.Reason and bits of holdfast.contact.Fault.
READY, TARE, WARM_UP, GAP, FAULT = range(5)
NOT_FINITE, STUCK, SATURATED, TARE_LOADED = 1, 2, 4, 8

TARE_SECONDS, TARE_FIRST, TARE_NONE, TARE_GIVEN = range(4)

NOISE_SECONDS = 0.5
"""How long the noise of a sensor is watched where the tare takes no time [s]."""
STUCK_SECONDS = 0.5
"""Readings that used to change and have not for so long are stuck [s]."""
LOADED_SECONDS = 0.25
"""Pulling for so long means that the tare was taken under load: nothing pulls a skin [s]."""
GAP_LIMIT = 3.0003
"""Sample periods; a longer step is a gap. The part over 3 is for the rounding of times."""


class Layout(NamedTuple):
    """What does not change while a stream runs; taxels of all fingers one after the other."""

    offsets: Integers  # (n_fingers + 1,) first taxel of each finger
    rotations: Array  # (n_taxels, 3, 3)
    limits: Array  # (n_fingers, 2) of the readings; infinite where unknown
    least_noise: Array  # (n_fingers,) of a force component, from the step of the readings
    specs: Integers  # (n_fingers, n_features, 4) kind, window, transform, scope; -1 padding
    floors: Array  # (n_fingers, n_features)
    windows: Integers  # (n_fingers, 2) window of the reported sigma, longest window
    tare_kind: int
    tare_seconds: float
    period: float


class Memory(NamedTuple):
    """What a stream remembers of each finger."""

    baseline: Array  # (n_taxels, 3) sum while the tare runs, then the mean
    previous: Array  # (n_taxels, 3) last finite readings
    history: Array  # (n_fingers, 4, 2 * longest) F_a, F_x, F_y, F_z, each written twice
    clock: Array  # (n_fingers, 2) time of the first finite sample, and of the last sample
    seen: Integers  # (n_fingers,) finite samples
    run: Integers  # (n_fingers,) forces in the present stretch
    gapped: Integers  # (n_fingers,) 1 while a stretch that follows a gap warms up
    tared: Integers  # (n_fingers,) samples in the baseline so far; -1 once it is frozen
    frozen: Integers  # (n_fingers,) samples since the readings last changed
    changes: Integers  # (n_fingers,) samples that changed the readings
    pulling: Integers  # (n_fingers,) samples since the sum of the normal readings turned negative
    noise: Array  # (n_fingers, 3) sum of squared steps of force, their number, the noise
    largest: Array  # (n_fingers,) largest F_a so far
    scratch: Array  # (3, 1)


class Output(NamedTuple):
    """What is known of each finger after a sample."""

    features: Array  # (n_fingers, n_features); NaN while the reason is not READY
    force: Array  # (n_fingers, 3); NaN where there is none
    amplitude: Array  # (n_fingers,)
    sigma: Array  # (n_fingers,)
    reason: Integers  # (n_fingers,)
    faults: Integers  # (n_fingers,) bits


@numba.njit(cache=True, error_model="numpy")
def advance(
    layout: Layout,
    memory: Memory,
    output: Output,
    readings: Array,
    present: npt.NDArray[np.bool_],
    time: float,
) -> None:  # pragma: no cover (compiled)
    """Takes one sample of the fingers that are present, and fills the output.

    Args:
        layout: of the hand.
        memory: is changed.
        output: is filled.
        readings: (n_taxels, 3) of all fingers; those of absent ones are not looked at.
        present: (n_fingers,) which fingers have a sample.
        time: of the sample [s].
    """
    for finger in range(len(present)):
        if present[finger]:
            first, last = layout.offsets[finger], layout.offsets[finger + 1]
            _take(layout, memory, output, finger, readings[first:last], time)
        elif memory.seen[finger] > 0 and _is_gap(layout, memory, finger, time):
            _break(memory, finger)
            _silence(output, finger, GAP, 0)
    for finger in range(len(present)):
        if present[finger] and output.reason[finger] == READY:
            _fill_features(layout, memory, output, finger)


@numba.njit(cache=True, error_model="numpy")
def force_of(
    readings: Array, baseline: Array, rotations: Array
) -> tuple[float, float, float]:  # pragma: no cover (compiled)
    """F_tip = sum over taxels of R_i (f_i - baseline_i)."""
    fx = fy = fz = 0.0
    for i in range(len(readings)):
        x = readings[i, 0] - baseline[i, 0]
        y = readings[i, 1] - baseline[i, 1]
        z = readings[i, 2] - baseline[i, 2]
        turn = rotations[i]
        fx += turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z
        fy += turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z
        fz += turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
    return fx, fy, fz


@numba.njit(cache=True, error_model="numpy")
def _take(
    layout: Layout, memory: Memory, output: Output, finger: int, readings: Array, time: float
) -> None:  # pragma: no cover (compiled)
    if _is_gap(layout, memory, finger, time):
        _break(memory, finger)
    memory.clock[finger, 1] = time
    if not _all_finite(readings):
        memory.run[finger] = 0
        _silence(output, finger, FAULT, NOT_FINITE)
        return
    _watch(layout, memory, finger, readings, time)
    if not _tare(layout, memory, finger, readings, time):
        _silence(output, finger, TARE, 0)
        return
    first, last = layout.offsets[finger], layout.offsets[finger + 1]
    baseline = memory.baseline[first:last]
    x, y, z = force_of(readings, baseline, layout.rotations[first:last])
    _remember(memory, output, finger, x, y, z)
    output.sigma[finger] = _sigma(memory, finger, layout.windows[finger, 0])
    output.faults[finger] = _faults(layout, memory, finger, readings, baseline)
    output.reason[finger] = _reason(layout, memory, output, finger)
    if output.reason[finger] != READY:
        output.features[finger] = math.nan


@numba.njit(cache=True, error_model="numpy")
def _is_gap(
    layout: Layout, memory: Memory, finger: int, time: float
) -> bool:  # pragma: no cover (compiled)
    return bool(time - memory.clock[finger, 1] > GAP_LIMIT * layout.period)  # False against NaN


@numba.njit(cache=True, error_model="numpy")
def _break(memory: Memory, finger: int) -> None:  # pragma: no cover (compiled)
    memory.run[finger] = 0
    memory.gapped[finger] = 1
    memory.frozen[finger] = 0
    memory.pulling[finger] = 0


@numba.njit(cache=True, error_model="numpy")
def _silence(
    output: Output, finger: int, reason: int, faults: int
) -> None:  # pragma: no cover (compiled)
    output.features[finger] = math.nan
    output.force[finger] = math.nan
    output.amplitude[finger] = math.nan
    output.sigma[finger] = math.nan
    output.reason[finger] = reason
    output.faults[finger] = faults


@numba.njit(cache=True, error_model="numpy")
def _all_finite(readings: Array) -> bool:  # pragma: no cover (compiled)
    for i in range(len(readings)):
        for axis in range(3):
            if not math.isfinite(readings[i, axis]):
                return False
    return True


@numba.njit(cache=True, error_model="numpy")
def _watch(
    layout: Layout, memory: Memory, finger: int, readings: Array, time: float
) -> None:  # pragma: no cover (compiled)
    """Counts changes of the readings, and measures their noise by steps while it is new."""
    first, last = layout.offsets[finger], layout.offsets[finger + 1]
    previous = memory.previous[first:last]
    if memory.seen[finger] == 0:
        memory.clock[finger, 0] = time
    else:
        changed = False
        for i in range(len(readings)):
            for axis in range(3):
                changed = changed or readings[i, axis] != previous[i, axis]
        memory.frozen[finger] = 0 if changed else memory.frozen[finger] + 1
        memory.changes[finger] += changed
        if math.isnan(memory.noise[finger, 2]):
            _measure_noise(layout, memory, finger, readings, time)
    memory.seen[finger] += 1
    previous[:] = readings


@numba.njit(cache=True, error_model="numpy")
def _measure_noise(
    layout: Layout, memory: Memory, finger: int, readings: Array, time: float
) -> None:  # pragma: no cover (compiled)
    noise = memory.noise[finger]
    seconds = layout.tare_seconds if layout.tare_kind == TARE_SECONDS else NOISE_SECONDS
    if _elapsed(layout, memory, finger, time) < seconds:
        first, last = layout.offsets[finger], layout.offsets[finger + 1]
        previous = memory.previous[first:last]
        x, y, z = force_of(readings, previous, layout.rotations[first:last])
        noise[0] += x * x + y * y + z * z
        noise[1] += 1.0
    else:
        # A step holds the noise of two samples, and three components.
        measured = math.sqrt(noise[0] / (6.0 * max(noise[1], 1.0)))
        noise[2] = max(measured, layout.least_noise[finger])


@numba.njit(cache=True, error_model="numpy")
def _elapsed(
    layout: Layout, memory: Memory, finger: int, time: float
) -> float:  # pragma: no cover (compiled)
    """Since the first finite sample, and half a period more, so that rounding moves no sample."""
    return float(time - memory.clock[finger, 0] + 0.5 * layout.period)


@numba.njit(cache=True, error_model="numpy")
def _tare(
    layout: Layout, memory: Memory, finger: int, readings: Array, time: float
) -> bool:  # pragma: no cover (compiled)
    """Whether the baseline is frozen; takes this sample into it while it is not."""
    if memory.tared[finger] < 0:
        return True
    first, last = layout.offsets[finger], layout.offsets[finger + 1]
    baseline = memory.baseline[first:last]
    if layout.tare_kind == TARE_FIRST:
        baseline[:] = readings
    elif layout.tare_kind == TARE_SECONDS:
        if _elapsed(layout, memory, finger, time) < layout.tare_seconds:
            baseline += readings
            memory.tared[finger] += 1
            return False
        baseline /= max(memory.tared[finger], 1)
    memory.tared[finger] = -1
    return True


@numba.njit(cache=True, error_model="numpy")
def _remember(
    memory: Memory, output: Output, finger: int, x: float, y: float, z: float
) -> None:  # pragma: no cover (compiled)
    amplitude = math.sqrt(x * x + y * y + z * z)
    history = memory.history[finger]
    longest = history.shape[1] // 2
    place = memory.run[finger] % longest
    memory.run[finger] += 1
    for channel, value in enumerate((amplitude, x, y, z)):
        history[channel, place] = value
        history[channel, place + longest] = value
    memory.largest[finger] = max(memory.largest[finger], amplitude)
    output.amplitude[finger] = amplitude
    output.force[finger, 0] = x
    output.force[finger, 1] = y
    output.force[finger, 2] = z


@numba.njit(cache=True, error_model="numpy")
def _window(
    memory: Memory, finger: int, channel: int, window: int
) -> Array:  # pragma: no cover (compiled)
    """The last `window` values of a channel, contiguous; the stretch must hold so many."""
    longest = memory.history.shape[2] // 2
    end = (memory.run[finger] - 1) % longest + longest + 1
    return memory.history[finger, channel, end - window : end]


@numba.njit(cache=True, error_model="numpy")
def _moments(
    memory: Memory, finger: int, window: int
) -> tuple[float, float]:  # pragma: no cover (compiled)
    m, sigma, scratch = memory.scratch[0], memory.scratch[1], memory.scratch[2]
    haar_windows(_window(memory, finger, 0, window), window, m, sigma, scratch)
    return m[0], sigma[0]


@numba.njit(cache=True, error_model="numpy")
def _sigma(memory: Memory, finger: int, window: int) -> float:  # pragma: no cover (compiled)
    return _moments(memory, finger, window)[1] if memory.run[finger] >= window else math.nan


@numba.njit(cache=True, error_model="numpy")
def _faults(
    layout: Layout, memory: Memory, finger: int, readings: Array, baseline: Array
) -> int:  # pragma: no cover (compiled)
    faults = 0
    moving = memory.seen[finger] - 1 - memory.frozen[finger]
    lively = 2 * memory.changes[finger] > moving
    if lively and memory.frozen[finger] * layout.period >= STUCK_SECONDS:
        faults |= STUCK
    least, largest = layout.limits[finger, 0], layout.limits[finger, 1]
    pressing = 0.0
    for i in range(len(readings)):
        pressing += readings[i, 2] - baseline[i, 2]
        for axis in range(3):
            if readings[i, axis] <= least or readings[i, axis] >= largest:
                faults |= SATURATED
    if _pulled(layout, memory, finger, pressing):
        faults |= TARE_LOADED
    return faults


@numba.njit(cache=True, error_model="numpy")
def _pulled(
    layout: Layout, memory: Memory, finger: int, pressing: float
) -> bool:  # pragma: no cover (compiled)
    """Whether the normal readings say that something pulls, well above noise, and for long."""
    if layout.tare_kind != TARE_SECONDS:
        return False
    limit = max(20.0 * memory.noise[finger, 2], 0.1 * memory.largest[finger])
    memory.pulling[finger] = memory.pulling[finger] + 1 if pressing < -limit else 0
    return bool(memory.pulling[finger] * layout.period >= LOADED_SECONDS)


@numba.njit(cache=True, error_model="numpy")
def _reason(
    layout: Layout, memory: Memory, output: Output, finger: int
) -> int:  # pragma: no cover (compiled)
    if memory.run[finger] < layout.windows[finger, 1]:
        warming = GAP if memory.gapped[finger] else WARM_UP
        return FAULT if output.faults[finger] else warming
    memory.gapped[finger] = 0
    return FAULT if output.faults[finger] else READY


@numba.njit(cache=True, error_model="numpy")
def _fill_features(
    layout: Layout, memory: Memory, output: Output, finger: int
) -> None:  # pragma: no cover (compiled)
    for place in range(layout.specs.shape[1]):
        kind, window, transform, scope = layout.specs[finger, place]
        if kind < 0:
            break
        floor = layout.floors[finger, place]
        value = _feature(memory, finger, kind, window, transform, floor)
        if scope == 1:
            for other in range(len(memory.run)):
                if memory.run[other] >= max(window, 1):
                    rival = _feature(memory, other, kind, window, transform, floor)
                    value = max(value, rival)
        output.features[finger, place] = value
        if math.isnan(value):  # the noise is not known yet
            output.reason[finger] = TARE


@numba.njit(cache=True, error_model="numpy")
def _feature(
    memory: Memory, finger: int, kind: int, window: int, transform: int, floor: float
) -> float:  # pragma: no cover (compiled)
    if kind < 4:
        value = _window(memory, finger, kind, 1)[0]
    else:
        value = _moments(memory, finger, window)[kind - 4]
    if transform == 0:
        return float(value)
    if transform == 1:
        return math.log(math.sqrt(value * value + floor * floor))
    expected = memory.noise[finger, 2] * math.sqrt((window - 2.0) / (2.0 * window))
    return math.log(max(value, 1e-3 * expected) / expected)
