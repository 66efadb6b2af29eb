"""Relative features: how force and taxels move, relative to load or noise. Compiled, no objects.

They look back by a lag in seconds, and have no unit: counts, newtons, gains and grips cancel, so
that they carry over from one hand to another. Decision 10 says why they are as they are.
"""

import math

import numpy as np

from holdfast.compiled import compiled_step, inlined, joined_step
from holdfast.features import arrays as at
from holdfast.features.arrays import Layout, Memory
from holdfast.features.specs import RELATIVE_KINDS
from holdfast.features.taxel_sums import residual, second_differences, turn_taxels
from holdfast.sensors.types import Array, Integers

# Rows of Memory.relative.
(
    FORCE_CHANGE, SHEAR_CHANGE, RESIDUAL, SHEAR_RESIDUAL,
    PRESSURE_SHIFT, MOMENT_CHANGE, LOAD_TO_NOISE,
    SECOND, _, _, _, _,  # of all taxels, shared, shear, own and top
    MEAN_SECOND, _, _, _, _,  # in the same order
    SHEAR_GAIN, NORMAL_GAIN, RATIO_GAIN,
) = range(len(RELATIVE_KINDS))  # fmt: skip

GAP_LIMIT_PERIODS = 3.0003
"""A step in time of more sample periods is a gap. The part over 3 allows for rounding."""
MAX_BRIDGED_SECONDS = 0.10001
"""Longest gap that windows in seconds bridge: 0.1 s, with an allowance for rounding."""
EVEN_STEPS = 0.02
"""Difference of two spacings, as a share of their sum, up to which they count as equal."""
LOAD_DECAY_SECONDS = 5.0
"""Time constant with which the largest load so far is forgotten [s]."""
NOISE_BLOCK_SECONDS, MIN_BLOCK_STEPS = 0.2, 5
"""A block over which noise is measured has at least this duration [s] and these steps."""
NOISE_WEIGHT = 100.0
"""Noise in the denominator: changes of a load below this many times its noise count less."""
MOVE_SECONDS, MOVED_TO_NOISE = 0.133, 5.0
"""A force moves if it changes within this time [s] by this many times its noise."""
RELEASED_SHARE = 0.08
"""Share of the largest load that a released skin may still show."""
LEAST_FALL = 0.25
"""Share of a released force that is normal, at least: friction held the rest. It allows for a
friction of 2, and for readings that show shear twice as much."""
PRESSURE_FLOOR = 1e-3
"""Least shift of the centre of pressure, in radii of the patch."""
ONE_AXIS, TWO_AXES = 1.0 / 3.0, 2.0 / 3.0
"""Squared noise of one and of two axes, as a share of that of all three."""
NOISE_SQUARES = 4.0
"""Squared noise that is subtracted from a squared change, which has that of two samples: 2, and
as much again, because the noise is the least that was measured."""
LEAST_CHANGE = 0.005
"""A change by less than this share of the load counts as none."""
SECOND_NOISE = 6.0
"""Squared noise of a second difference, of three samples: 1 + 4 + 1 times that of a sample."""
SECOND_FLOOR = SECOND_NOISE / 16.0
"""Squared second difference that counts as none, in squared noise: a quarter of its noise."""
AVERAGE_SECONDS = 0.02
"""Time constant of averages of squared second differences [s]."""
NORMAL_NOISE_WEIGHT = 10.0
"""Noise in the denominator of the ratio of forces: a light touch has no large ratio."""


@inlined
def update_motion(layout: Layout, memory: Memory, f: int, time: float) -> None:
    """Compute the relative features of a finger after `append_taxels`.

    The sample is already counted in N_MOTION.

    Args:
        layout: of the stream.
        memory: is changed; `memory.relative` holds the features.
        f: the finger.
        time: of the sample [s].
    """
    n, length = memory.counts[f, at.N_MOTION], len(memory.taxel_forces)
    now, times, period = (n - 1) % length, memory.track[f, at.TRACK_TIME], layout.period
    n_before = min(n, length) - 1
    step = period if n < 2 else time - times[_place(now, 1, length)]
    _update_noise(layout, memory.motion, memory.counts, f, time)
    _update_load(layout, memory, f, now, step)
    _update_contact_load(layout, memory, f, now, step)
    _update_movement(layout, memory, f, now, time)
    if layout.has_ratios:
        _update_ratio(layout, memory, f, now)
    if n < 2:
        _forget_features(memory, f)
        return
    gain = layout.average_gain
    if abs(step - period) > EVEN_STEPS * period:
        gain = -math.expm1(-min(step, GAP_LIMIT_PERIODS * period) / AVERAGE_SECONDS)
    load_to_noise = math.nan
    if layout.has_centres:
        # log(L / noise): the same for all lags.
        noise = memory.motion[f, at.NOISE_NOW]
        load_to_noise = math.log(_load_floor(memory.motion, f) / noise)
    for lag in range(len(layout.lags)):
        families, seconds = layout.families[lag], layout.lag_seconds[lag]
        back = _samples_back(times, now, n_before, time - seconds, layout.lags[lag])
        if families[at.LAGS] or families[at.RATIOS]:
            then = _place(now, back, length)
            if families[at.LAGS]:
                _fill_lag(layout, memory, f, now, then, lag)
                memory.relative[f, LOAD_TO_NOISE, lag] = load_to_noise
            if families[at.RATIOS]:
                _fill_ratios(layout, memory, f, now, then, lag)
        if families[at.SECONDS]:
            _fill_seconds(layout, memory, f, now, back, n_before, lag, gain)


@joined_step
def _samples_back(times: Array, now: int, n_before: int, when: float, likely: int) -> int:
    """Return how many samples before the newest that lies which is nearest to a time; 1 or more.

    Args:
        times: of the samples, a ring [s].
        now: place of the newest sample.
        n_before: number of samples before it.
        when: the time [s].
        likely: the number if the samples come at even times, from which the search begins.
    """
    length = len(times)
    back = max(min(likely, n_before), 1)
    while back < n_before and times[_place(now, back, length)] > when:
        back += 1
    while back > 1 and times[_place(now, back - 1, length)] <= when:
        back -= 1
    # t(back) <= when < t(back - 1), as far as there are samples: the nearer; of equals the likely.
    older, newer = times[_place(now, back, length)], times[_place(now, back - 1, length)]
    is_newer = newer - when < when - older
    if abs((newer - when) - (when - older)) <= EVEN_STEPS * (newer - older):
        is_newer = likely < back
    return back - 1 if is_newer and back > 1 else back


@compiled_step
def _place(now: int, back: int, length: int) -> int:
    """Return the place in a ring of the sample before that of `now` by `back`."""
    place = now - back
    return place if place >= 0 else place + length


@inlined
def _forget_features(memory: Memory, f: int) -> None:
    """Set the relative features of a finger, and their averages, to NaN."""
    for lag in range(memory.relative.shape[2]):
        for kind in range(memory.relative.shape[1]):
            memory.relative[f, kind, lag] = math.nan
        for place in range(at.N_SECONDS):
            memory.averages[f, place, lag] = math.nan


@compiled_step
def _next_place(layout: Layout, memory: Memory, f: int, time: float) -> tuple[int, int, bool, bool]:
    """Store the time of a sample. After a gap that is not bridged, the history starts again.

    Returns:
        Place of the sample, place of the sample before, whether there is a sample before, and
        whether their difference shows the noise: the force may change in a gap that is bridged.
    """
    times, n_before = memory.track[f, at.TRACK_TIME], memory.counts[f, at.N_MOTION]
    now, before = n_before % len(times), (n_before - 1) % len(times)
    step, limit = time - times[before], GAP_LIMIT_PERIODS * layout.period
    if n_before > 0 and step > max(limit, MAX_BRIDGED_SECONDS):
        now = n_before = 0
    memory.counts[f, at.N_MOTION] = n_before + 1
    times[now] = time
    return now, before, n_before > 0, n_before > 0 and step <= limit


@inlined
def append_taxels(
    layout: Layout, memory: Memory, readings: Array, f: int, time: float
) -> tuple[float, float, float, float]:
    """Append taxel forces, centre of pressure and moment of a sample to the history.

    The history starts again after a gap that is not bridged.

    Returns:
        F_tip, with the bits of `sum_taxels`, and the sum of the normal readings.
    """
    track = memory.track
    now, before, has_previous, shows_noise = _next_place(layout, memory, f, time)
    fx, fy, fz, normal, weight, pressure_squares, squares, moved, cx, cy, cz, moment = turn_taxels(
        layout, memory, readings, f, now, before
    )
    weight = max(weight, 1e-300)
    # step = |F(k) - F(k-1)|^2.
    step = 0.0
    if has_previous:
        dx, dy, dz = fx - track[f, 0, before], fy - track[f, 1, before], fz - track[f, 2, before]
        step = dx * dx + dy * dy + dz * dz
    track[f, 0, now], track[f, 1, now], track[f, 2, now] = fx, fy, fz
    track[f, at.TRACK_PRESSURE, now] = cx / weight
    track[f, at.TRACK_PRESSURE + 1, now] = cy / weight
    track[f, at.TRACK_PRESSURE + 2, now] = cz / weight
    track[f, at.TRACK_MOMENT, now] = moment
    memory.motion[f, at.PRESSURE], memory.motion[f, at.PRESSURE_SQUARES] = weight, pressure_squares
    memory.motion[f, at.TAXEL_LOAD] = math.sqrt(squares)
    is_new = memory.counts[f, at.N_UNCHANGED] == 0 and shows_noise
    _add_to_block(memory.motion, f, step, moved, is_new, has_previous)
    return fx, fy, fz, normal


@inlined
def _add_to_block(
    motion: Array, f: int, step: float, moved: float, is_new: bool, has_previous: bool
) -> None:
    """Add the squares of a step to the block over which the noise is measured."""
    # Sums over the block: squares of steps of F and of all g_i. Repeated samples do not count.
    if is_new and has_previous:
        motion[f, at.BLOCK_SQUARES] += step
        motion[f, at.BLOCK_TAXEL_SQUARES] += moved
        motion[f, at.BLOCK_STEPS] += 1.0
    elif not has_previous:
        motion[f, at.BLOCK_SQUARES] = motion[f, at.BLOCK_TAXEL_SQUARES] = motion[
            f, at.BLOCK_STEPS
        ] = 0.0
        motion[f, at.BLOCK_START] = math.nan


@inlined
def _update_load(layout: Layout, memory: Memory, f: int, now: int, step: float) -> None:
    """Update the reference, and the load beyond it.

    A skin can only be pressed. So the least normal force since the start belongs to the least
    load that is known, whatever the load was when the tare was taken.
    """
    track, motion = memory.track, memory.motion
    nx, ny, nz = layout.normals[f, 0], layout.normals[f, 1], layout.normals[f, 2]
    x, y, z = track[f, 0, now], track[f, 1, now], track[f, 2, now]
    # The reference: F and g_i at the least F . n so far.
    normal = x * nx + y * ny + z * nz
    if normal < motion[f, at.LEAST_NORMAL]:
        motion[f, at.LEAST_NORMAL] = normal
        motion[f, at.REFERENCE], motion[f, at.REFERENCE + 1], motion[f, at.REFERENCE + 2] = x, y, z
        for i in range(np.uint64(layout.offsets[f]), np.uint64(layout.offsets[f + 1])):
            for axis in range(3):
                memory.reference[i, axis] = memory.taxel_forces[now, i, axis]
        motion[f, at.TAXEL_LOAD] = 0.0
    x, y, z = (
        x - motion[f, at.REFERENCE],
        y - motion[f, at.REFERENCE + 1],
        z - motion[f, at.REFERENCE + 2],
    )
    # load = |F - F_ref|, peak(k) = max(load(k), exp(-step / tau) peak(k-1)); the same for taxels.
    keep = math.exp(-step / LOAD_DECAY_SECONDS)
    motion[f, at.LOAD] = math.sqrt(x * x + y * y + z * z)
    motion[f, at.PEAK_LOAD] = max(motion[f, at.LOAD], keep * motion[f, at.PEAK_LOAD])
    motion[f, at.PEAK_TAXEL_LOAD] = max(
        motion[f, at.TAXEL_LOAD], keep * motion[f, at.PEAK_TAXEL_LOAD]
    )


@inlined
def _update_contact_load(layout: Layout, memory: Memory, f: int, now: int, step: float) -> None:
    """Update the force without contact, and the load beyond it, by which contact is decided.

    A shear draws the normal force of a magnetic skin below that of the tare, while it is held. So
    only a release counts: of a tare under load, all taxels fall.
    """
    track, motion = memory.track, memory.motion
    nx, ny, nz = layout.normals[f, 0], layout.normals[f, 1], layout.normals[f, 2]
    x, y, z = track[f, 0, now], track[f, 1, now], track[f, 2, now]
    normal = x * nx + y * ny + z * nz
    # zero: F at the least F . n so far of a release.
    least = (
        motion[f, at.CONTACT_ZERO] * nx
        + motion[f, at.CONTACT_ZERO + 1] * ny
        + motion[f, at.CONTACT_ZERO + 2] * nz
    )
    if normal < least and _is_release(layout, memory, f, now, normal, x * x + y * y + z * z):
        motion[f, at.CONTACT_ZERO] = x
        motion[f, at.CONTACT_ZERO + 1] = y
        motion[f, at.CONTACT_ZERO + 2] = z
    x, y, z = (
        x - motion[f, at.CONTACT_ZERO],
        y - motion[f, at.CONTACT_ZERO + 1],
        z - motion[f, at.CONTACT_ZERO + 2],
    )
    # load = |F - zero|, peak as above.
    load = math.sqrt(x * x + y * y + z * z)
    motion[f, at.CONTACT_LOAD] = load
    keep = math.exp(-step / LOAD_DECAY_SECONDS)
    motion[f, at.PEAK_CONTACT_LOAD] = max(load, keep * motion[f, at.PEAK_CONTACT_LOAD])


@inlined
def _is_release(
    layout: Layout, memory: Memory, f: int, now: int, normal: float, square: float
) -> bool:
    """Return whether a force below the tare is that of a skin which was let go.

    Args:
        layout: of the stream.
        memory: of the stream.
        f: the finger.
        now: place of the newest sample.
        normal: normal force beyond the tare, below 0.
        square: |F|^2 beyond the tare.
    """
    # Friction held what fell: -F . n >= 1/4 |F|. And what rises is at most an echo:
    # sum max(g_i . n, 0) <= 0.08 sum max(-g_i . n, 0).
    if normal * normal < LEAST_FALL * LEAST_FALL * square:
        return False
    nx, ny, nz = layout.normals[f, 0], layout.normals[f, 1], layout.normals[f, 2]
    risen = 0.0
    for i in range(np.uint64(layout.offsets[f]), np.uint64(layout.offsets[f + 1])):
        forces = memory.taxel_forces
        pressed = forces[now, i, 0] * nx + forces[now, i, 1] * ny + forces[now, i, 2] * nz
        risen += 0.5 * (pressed + abs(pressed))  # max(p, 0), without a branch
    return risen <= RELEASED_SHARE * (risen - normal)


@inlined
def _update_ratio(layout: Layout, memory: Memory, f: int, now: int) -> None:
    """Update the tangent, and the ratio of tangential to normal force."""
    track, motion = memory.track, memory.motion
    nx, ny, nz = layout.normals[f, 0], layout.normals[f, 1], layout.normals[f, 2]
    x = track[f, 0, now] - motion[f, at.REFERENCE]
    y = track[f, 1, now] - motion[f, at.REFERENCE + 1]
    z = track[f, 2, now] - motion[f, at.REFERENCE + 2]
    # With F beyond the reference: F_t = F - (F . n) n, N = |F . n| + 10 noise, r = |F_t| / N,
    # t = F_t / |F_t|.
    normal = x * nx + y * ny + z * nz
    x, y, z = x - normal * nx, y - normal * ny, z - normal * nz
    size = math.sqrt(x * x + y * y + z * z)
    motion[f, at.NORMAL_FLOOR] = abs(normal) + NORMAL_NOISE_WEIGHT * motion[f, at.NOISE_NOW]
    track[f, at.TRACK_RATIO, now] = size / motion[f, at.NORMAL_FLOOR]
    share = 1.0 / max(size, 1e-300)
    motion[f, at.TANGENT] = share * x
    motion[f, at.TANGENT + 1] = share * y
    motion[f, at.TANGENT + 2] = share * z


@inlined
def _update_movement(layout: Layout, memory: Memory, f: int, now: int, time: float) -> None:
    """Note how far the force moved, and when: by much more than its noise, and than an echo."""
    track, motion, length = memory.track, memory.motion, memory.track.shape[2]
    # moved = |F(k) - F(k - MOVE_SECONDS / T)| > max(5 noise, 0.08 peak): the force moves.
    n_before = min(memory.counts[f, at.N_MOTION], length) - 1
    back = min(round(MOVE_SECONDS / layout.period), n_before)
    if back > 0:
        times = track[f, at.TRACK_TIME]
        back = _samples_back(times, now, n_before, time - MOVE_SECONDS, back)
    then = _place(now, back, length)
    x = track[f, 0, now] - track[f, 0, then]
    y = track[f, 1, now] - track[f, 1, then]
    z = track[f, 2, now] - track[f, 2, then]
    least = max(MOVED_TO_NOISE * motion[f, at.NOISE_NOW], RELEASED_SHARE * motion[f, at.PEAK_LOAD])
    motion[f, at.MOVED_BY] = math.sqrt(x * x + y * y + z * z)
    if motion[f, at.MOVED_BY] > least:
        motion[f, at.MOVED_AT] = time


@inlined
def _update_noise(layout: Layout, motion: Array, counts: Integers, f: int, time: float) -> None:
    """Update the noise: the least mean square step over blocks, halved, and its root."""
    if math.isnan(motion[f, at.BLOCK_START]):
        motion[f, at.BLOCK_START] = time
    # Three components, each with at least the noise of rounding.
    floor = math.sqrt(3.0) * layout.constants[f, at.MIN_NOISE]
    steps = motion[f, at.BLOCK_STEPS]
    if steps == 0.0:
        if math.isinf(motion[f, at.LEAST_NOISE]):
            motion[f, at.NOISE_NOW] = motion[f, at.TAXEL_NOISE_NOW] = floor
        return
    # noise = sqrt(sum |F(k) - F(k-1)|^2 / (2 n)) over a block of n steps; the same for taxels.
    force = max(math.sqrt(motion[f, at.BLOCK_SQUARES] / (2.0 * steps)), floor)
    taxels = max(math.sqrt(motion[f, at.BLOCK_TAXEL_SQUARES] / (2.0 * steps)), floor)
    if time - motion[f, at.BLOCK_START] >= NOISE_BLOCK_SECONDS and steps >= MIN_BLOCK_STEPS:
        # The least over the blocks that are complete.
        motion[f, at.LEAST_NOISE] = min(motion[f, at.LEAST_NOISE], force)
        motion[f, at.LEAST_TAXEL_NOISE] = min(motion[f, at.LEAST_TAXEL_NOISE], taxels)
        motion[f, at.BLOCK_SQUARES] = motion[f, at.BLOCK_TAXEL_SQUARES] = motion[
            f, at.BLOCK_STEPS
        ] = 0.0
        motion[f, at.BLOCK_START] = time
    known = not math.isinf(motion[f, at.LEAST_NOISE])
    motion[f, at.NOISE_NOW] = motion[f, at.LEAST_NOISE] if known else force
    motion[f, at.TAXEL_NOISE_NOW] = motion[f, at.LEAST_TAXEL_NOISE] if known else taxels


@inlined
def _fill_lag(layout: Layout, memory: Memory, f: int, now: int, then: int, lag: int) -> None:
    """Fill the relative features over one lag."""
    track, motion, out = memory.track, memory.motion, memory.relative
    nx, ny, nz = layout.normals[f, 0], layout.normals[f, 1], layout.normals[f, 2]
    noise, taxel_noise = motion[f, at.NOISE_NOW], motion[f, at.TAXEL_NOISE_NOW]
    load = _load_floor(motion, f)
    taxel_load = motion[f, at.PEAK_TAXEL_LOAD] + NOISE_WEIGHT * taxel_noise
    # v = |dF| and |dF - (dF . n) n|, over L.
    x = track[f, 0, now] - track[f, 0, then]
    y = track[f, 1, now] - track[f, 1, then]
    z = track[f, 2, now] - track[f, 2, then]
    across = x * nx + y * ny + z * nz
    square = x * x + y * y + z * z
    out[f, FORCE_CHANGE, lag] = _relative(square, noise * noise, load)
    shear = square - across * across
    out[f, SHEAR_CHANGE, lag] = _relative(shear, TWO_AXES * noise * noise, load)
    # v = sqrt(sum |dg_i - mean dg|^2), whole and across the normal, over the taxels' L.
    n_used = layout.constants[f, at.N_USED]
    moved, pressed = residual(layout, memory, f, now, then, x / n_used, y / n_used, z / n_used)
    echo = taxel_noise * taxel_noise
    out[f, RESIDUAL, lag] = _relative(moved, echo, taxel_load)
    out[f, SHEAR_RESIDUAL, lag] = _relative(moved - pressed, TWO_AXES * echo, taxel_load)
    # log(|dc| + PRESSURE_FLOOR).
    shift = 0.0
    for axis in range(3):
        delta = track[f, at.TRACK_PRESSURE + axis, now] - track[f, at.TRACK_PRESSURE + axis, then]
        shift += delta * delta
    out[f, PRESSURE_SHIFT, lag] = math.log(math.sqrt(shift) + PRESSURE_FLOOR)
    # v = |d moment|, over L.
    turned = track[f, at.TRACK_MOMENT, now] - track[f, at.TRACK_MOMENT, then]
    out[f, MOMENT_CHANGE, lag] = _relative(turned * turned, ONE_AXIS * echo, load)


@compiled_step
def _load_floor(motion: Array, f: int) -> float:
    """Return what changes of the force of a finger are divided by."""
    # L = peak + 100 noise.
    return float(motion[f, at.PEAK_LOAD] + NOISE_WEIGHT * motion[f, at.NOISE_NOW])


@compiled_step
def _relative(square: float, noise_square: float, load: float) -> float:
    """Return log(v / load) of a change v, given v^2 with noise; at least log(LEAST_CHANGE)."""
    # log sqrt(max(v^2 - 4 noise^2, 0) / L^2 + LEAST_CHANGE^2).
    square = max(square - NOISE_SQUARES * noise_square, 0.0)
    return 0.5 * math.log(square / (load * load) + LEAST_CHANGE * LEAST_CHANGE)


@inlined
def _fill_seconds(
    layout: Layout,
    memory: Memory,
    f: int,
    now: int,
    back: int,
    n_before: int,
    lag: int,
    gain: float,
) -> None:
    """Fill the second differences of the taxels at one spacing, and their averages."""
    track, motion, out, averages = memory.track, memory.motion, memory.relative, memory.averages
    before, first, newest, oldest = _three_places(
        memory.track[f, at.TRACK_TIME], now, back, n_before
    )
    total, n_used = motion[f, at.PRESSURE], layout.constants[f, at.N_USED]
    squares, shared, along, px, py, pz, top = second_differences(
        layout, memory, f, now, before, first, newest, oldest
    )
    share = 1.0 / total
    # With w_i = p_i / sum p and D = sum d_i:
    # sum |d_i - w_i D|^2 = sum |d_i|^2 - 2 D . sum w_i d_i + |D|^2 sum w_i^2.
    x = newest * track[f, 0, now] - 2.0 * track[f, 0, before] + oldest * track[f, 0, first]
    y = newest * track[f, 1, now] - 2.0 * track[f, 1, before] + oldest * track[f, 1, first]
    z = newest * track[f, 2, now] - 2.0 * track[f, 2, before] + oldest * track[f, 2, first]
    common = (x * x + y * y + z * z) * (motion[f, at.PRESSURE_SQUARES] * share) * share
    own = squares - 2.0 * (x * px + y * py + z * pz) * share + common
    noise = motion[f, at.TAXEL_NOISE_NOW]
    noise_share = 1.0 / (noise * noise)
    shear = max(n_used * (shared - along) * share, 0.0)
    sums = (squares, n_used * shared * share, shear, max(own, 0.0), n_used * top)
    for place in range(at.N_SECONDS):
        out[f, SECOND + place, lag] = _beyond_noise(sums[place] * noise_share)
    if layout.families[lag, at.MEAN_SECONDS]:
        for place in range(at.N_SECONDS):
            # a(k) = a(k-1) + gain (v(k)^2 - a(k-1)).
            average = averages[f, place, lag]
            if math.isnan(average):
                average = sums[place]
            average += gain * (sums[place] - average)
            averages[f, place, lag] = average
            out[f, MEAN_SECOND + place, lag] = _beyond_noise(average * noise_share)


@joined_step
def _three_places(
    times: Array, now: int, back: int, n_before: int
) -> tuple[int, int, float, float]:
    """Return the places of the second and third sample of a second difference, and two weights.

    The third lies as long before the second as the second before the newest. A gap, or uneven
    times, move it; the weights then let an even motion cancel, as it does at even times.

    Args:
        times: of the samples, a ring [s].
        now: place of the newest sample.
        back: number of samples from the second to the newest.
        n_before: number of samples before the newest.

    Returns:
        Place of the second and of the third, and weights of the newest and of the third.
    """
    length = len(times)
    if n_before < 2:
        return now, now, 1.0, 1.0  # no difference yet
    before = _place(now, back, length)
    mirrored = 2.0 * times[before] - times[now]
    oldest = times[_place(now, n_before, length)]
    if mirrored < oldest - 0.5 * (times[now] - times[before]) / back:
        back = max(1, min(back, n_before // 2))  # the windows are filled in part
        before = _place(now, back, length)
        mirrored = 2.0 * times[before] - times[now]
    further = _samples_back(times, now, n_before, mirrored, 2 * back)
    first = _place(now, max(further, back + 1), length)
    # h = t(k) - t(k-s), h' = t(k-s) - t(k-2s): a = 2 h' / (h + h'), c = 2 h / (h + h').
    later, earlier = times[now] - times[before], times[before] - times[first]
    whole = later + earlier
    if abs(later - earlier) <= EVEN_STEPS * whole:
        return before, first, 1.0, 1.0
    return before, first, 2.0 * earlier / whole, 2.0 * later / whole


@compiled_step
def _beyond_noise(square: float) -> float:
    """Return log v of a second difference, given v^2 in squared noise, beyond that of noise."""
    # log sqrt(max(v^2 - 6, 0) + 6 / 16).
    return 0.5 * math.log(max(square - SECOND_NOISE, 0.0) + SECOND_FLOOR)


@inlined
def _fill_ratios(layout: Layout, memory: Memory, f: int, now: int, then: int, lag: int) -> None:
    """Fill the changes of tangential and normal force, and of their ratio, over one lag."""
    track, motion, out = memory.track, memory.motion, memory.relative
    x = track[f, 0, now] - track[f, 0, then]
    y = track[f, 1, now] - track[f, 1, then]
    z = track[f, 2, now] - track[f, 2, then]
    # dF . t / N, dF . n / N and r(k) - r(k-l).
    scale = 1.0 / motion[f, at.NORMAL_FLOOR]
    tx, ty, tz = motion[f, at.TANGENT], motion[f, at.TANGENT + 1], motion[f, at.TANGENT + 2]
    nx, ny, nz = layout.normals[f, 0], layout.normals[f, 1], layout.normals[f, 2]
    out[f, SHEAR_GAIN, lag] = scale * (x * tx + y * ty + z * tz)
    out[f, NORMAL_GAIN, lag] = scale * (x * nx + y * ny + z * nz)
    out[f, RATIO_GAIN, lag] = track[f, at.TRACK_RATIO, now] - track[f, at.TRACK_RATIO, then]
