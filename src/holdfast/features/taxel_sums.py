"""Loops over the taxels of a finger that add up their forces and their motion. Compiled.

Everything here is marked `sums_in_any_order`: the C header computes several taxels at a time.
"""

import math

import numpy as np

from holdfast.compiled import compiled_step, inlined, sums_in_any_order
from holdfast.features import arrays as at
from holdfast.features.arrays import Layout, Memory
from holdfast.sensors.types import Array


@compiled_step
@sums_in_any_order
def _along(axis: int, x: float, y: float, z: float, nx: float, ny: float, nz: float) -> float:
    """Return the part of a vector along the normal, which is usually an axis."""
    if axis == 0:
        return x
    if axis == 2:
        return z
    return x * nx + y * ny + z * nz


@inlined
@sums_in_any_order
def turn_taxels(
    layout: Layout, memory: Memory, readings: Array, f: int, now: int, before: int
) -> tuple[float, float, float, float, float, float, float, float, float, float, float, float]:
    """Store the taxel forces of a sample, and return sums over the taxels.

    Args:
        layout: of the stream.
        memory: of the stream; is changed.
        readings: of all fingers.
        f: the finger.
        now: place of the sample.
        before: place of the sample before; any other place without one.

    Returns:
        F_tip, the sum of the normal readings, sum p_i, sum p_i^2, sum |h_i|^2, the sum of squared
        steps of the taxels, sum p_i r_i, and the moment about the normal.
    """
    forces, reference = memory.taxel_forces, memory.reference
    nx, ny, nz = layout.normals[f, 0], layout.normals[f, 1], layout.normals[f, 2]
    axis = layout.normal_axes[f]
    # g_i = R_i (f_i - b_i), F = sum g_i, h_i = g_i - g_i(reference), p_i = |h_i . n|:
    # centre c = sum p_i r_i / sum p_i, moment = n . sum r_i x g_i, taxel load = sqrt(sum |h_i|^2),
    # moved = sum |g_i(k) - g_i(k-1)|^2.
    fx, fy, fz, weight, squares, moved = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    pressure_squares, normal = 0.0, 0.0
    cx, cy, cz, moment = 0.0, 0.0, 0.0, 0.0
    start = np.uint64(layout.offsets[f])
    for j in range(np.uint64(layout.n_taxels[f])):
        i = start + j
        x = readings[i, 0] - memory.baseline[i, 0]
        y = readings[i, 1] - memory.baseline[i, 1]
        z = readings[i, 2] - memory.baseline[i, 2]
        normal += z
        turn = layout.rotations[i]
        gx = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z
        gy = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z
        gz = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
        sx, sy, sz = forces[before, i, 0], forces[before, i, 1], forces[before, i, 2]
        moved += (gx - sx) * (gx - sx) + (gy - sy) * (gy - sy) + (gz - sz) * (gz - sz)
        forces[now, i, 0], forces[now, i, 1], forces[now, i, 2] = gx, gy, gz
        fx, fy, fz = fx + gx, fy + gy, fz + gz
        hx, hy, hz = gx - reference[i, 0], gy - reference[i, 1], gz - reference[i, 2]
        pressed = abs(_along(axis, hx, hy, hz, nx, ny, nz))
        memory.pressed[i] = pressed
        weight += pressed
        pressure_squares += pressed * pressed
        squares += hx * hx + hy * hy + hz * hz
        if layout.has_centres:
            px, py, pz = layout.places[i, 0], layout.places[i, 1], layout.places[i, 2]
            cx, cy, cz = cx + pressed * px, cy + pressed * py, cz + pressed * pz
            tx, ty, tz = py * gz - pz * gy, pz * gx - px * gz, px * gy - py * gx
            moment += _along(axis, tx, ty, tz, nx, ny, nz)
    return fx, fy, fz, normal, weight, pressure_squares, squares, moved, cx, cy, cz, moment


@inlined
@sums_in_any_order
def residual(
    layout: Layout, memory: Memory, f: int, now: int, then: int, mx: float, my: float, mz: float
) -> tuple[float, float]:
    """Return the squared motion of the taxels against their mean, and its part along the normal."""
    forces = memory.taxel_forces
    nx, ny, nz = layout.normals[f, 0], layout.normals[f, 1], layout.normals[f, 2]
    # sum |u_i|^2 and sum (u_i . n)^2, with u_i = dg_i - mean dg.
    moved, pressed = 0.0, 0.0
    start = np.uint64(layout.offsets[f])
    for j in range(np.uint64(layout.n_taxels[f])):
        i = start + j
        if not layout.ignored[i]:
            x = forces[now, i, 0] - forces[then, i, 0] - mx
            y = forces[now, i, 1] - forces[then, i, 1] - my
            z = forces[now, i, 2] - forces[then, i, 2] - mz
            along = _along(layout.normal_axes[f], x, y, z, nx, ny, nz)
            moved += x * x + y * y + z * z
            pressed += along * along
    return moved, pressed


@inlined
@sums_in_any_order
def second_differences(
    layout: Layout,
    memory: Memory,
    f: int,
    now: int,
    before: int,
    first: int,
    newest: float,
    oldest: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Return sums over the second differences of the taxels, and the largest square.

    Args:
        layout: of the stream.
        memory: of the stream.
        f: the finger.
        now: place of the newest sample.
        before: place of the second sample.
        first: place of the third.
        newest: weight of the newest.
        oldest: weight of the third.
    """
    forces = memory.taxel_forces
    nx, ny, nz = layout.normals[f, 0], layout.normals[f, 1], layout.normals[f, 2]
    # d_i = a g_i(k) - 2 g_i(k-s) + c g_i(k-2s), with a = c = 1 at even times:
    # sum |d_i|^2, sum p_i |d_i|^2, sum p_i (d_i . n)^2, sum p_i d_i, and the largest
    # |d_i|^2 of the taxels with p_i > sum p / n.
    squares, shared, along, top = 0.0, 0.0, 0.0, 0.0
    mean_pressure = memory.motion[f, at.PRESSURE] / layout.constants[f, at.N_USED]
    px, py, pz = 0.0, 0.0, 0.0
    start = np.uint64(layout.offsets[f])
    for j in range(np.uint64(layout.n_taxels[f])):
        i = start + j
        x = newest * forces[now, i, 0] - 2.0 * forces[before, i, 0] + oldest * forces[first, i, 0]
        y = newest * forces[now, i, 1] - 2.0 * forces[before, i, 1] + oldest * forces[first, i, 1]
        z = newest * forces[now, i, 2] - 2.0 * forces[before, i, 2] + oldest * forces[first, i, 2]
        square, pressed = x * x + y * y + z * z, memory.pressed[i]
        pushed = _along(layout.normal_axes[f], x, y, z, nx, ny, nz)
        squares += square
        shared += pressed * square
        along += pressed * (pushed * pushed)
        px, py, pz = px + pressed * x, py + pressed * y, pz + pressed * z
        # |d_i|^2 if p_i > sum p / n, else not above 0: without a branch, which half of the
        # taxels would mispredict.
        rival = -math.copysign(square, mean_pressure - pressed)
        top = rival if rival > top else top
    return squares, shared, along, px, py, pz, top
