"""Signed distance of a point from an object, and its gradient, compiled.

An object is an array of numbers. Its shape is a core that is extended on all sides by a rounding,
so that distances and their gradients near the surface are exact and smooth.
"""

import math

import numpy as np

from holdfast.compiled import compiled, compiled_inside
from holdfast.sensors.types import Array

REVOLVED, BOX, HEXAGON, CAPSULE = range(4)
"""Cores: a frustum (or cylinder), a box, a hexagonal prism, a line (or point)."""

# Columns of a packed object. Columns 1 to 3 are the sizes of the core [m]. For a frustum these are
# the radii and the half height, followed by normal (outward, upward) and length [m] of its side.
CODE = 0
SIDE_OUT, SIDE_UP, SIDE_LENGTH = 4, 5, 6
EXTENSION = 7  # extension of the core on all sides [m]
CENTRE = 8  # height of the centre of mass above the middle [m]
N_CORE = 9
TEXTURE_AMPLITUDE, WAVE, WAVE_2, AROUND, AROUND_2 = range(9, 14)  # [m], [rad/m], [rad/m], [1], [1]
MU_STATIC, MU_KINETIC = 14, 15
N_OBJECT_NUMBERS = 16
MAX_RELIEF = 2.5
"""Maximum height of a texture's three waves together, in amplitudes."""

Numbers = Array | tuple[float, ...]
"""An object or a skin, packed. A loop takes tuples: arrays are counted at every call, and read
again after every number that is written."""


@compiled
def unpacked(a: Array) -> tuple[float, ...]:
    """Return a packed object as a tuple."""
    return (
        a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], a[12], a[13],
        a[14], a[15],
    )  # fmt: skip


@compiled
def distances(solid: Array, points: Array) -> Array:
    """Compute signed distances (n,) of points (n, 3) in the object's frame [m]."""
    signed = np.empty(len(points))
    for i in range(len(points)):
        signed[i] = signed_distance(solid, points[i, 0], points[i, 1], points[i, 2])
    return signed


@compiled
def signed_distance(solid: Numbers, x: float, y: float, z: float) -> float:
    """Compute the distance of a point in the object's frame from its textured surface [m]."""
    return probe(solid, x, y, z)[0] + relief(solid, x, y, z)


@compiled_inside
def relief(solid: Numbers, x: float, y: float, z: float) -> float:
    """Compute the depth of the texture at a point in the object's frame [m].

    The sum of three waves: A (sin a z + 0.7 sin(0.6 b z + b s + 1) + 0.8 sin(a s + 0.3)), where s
    is the arc about the axis, a = 2 pi / L and b = a / 0.37 (own choice).
    """
    if solid[TEXTURE_AMPLITUDE] == 0.0:
        return 0.0
    angle = math.atan2(y, x)
    waves = math.sin(solid[WAVE] * z)
    waves += 0.7 * math.sin(solid[WAVE_2] * z + solid[AROUND_2] * angle + 1.0)
    waves += 0.8 * math.sin(solid[AROUND] * angle + 0.3)
    depth: float = solid[TEXTURE_AMPLITUDE] * waves
    return depth


@compiled_inside
def probe(solid: Numbers, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Compute the distance of a point from the smooth object, and its gradient.

    Returns:
        The distance [m], negative inside, and its gradient, an outward unit vector.
    """
    z += solid[CENTRE]
    code = int(solid[CODE])
    if code == BOX:
        d, gx, gy, gz = _box(solid[1], solid[2], solid[3], x, y, z)
    elif code == HEXAGON:
        d, gx, gy, gz = _hexagon(solid[1], solid[2], x, y, z)
    elif code == CAPSULE:
        along = z - min(max(z, -solid[1]), solid[1])
        d = math.sqrt(x * x + y * y + along * along)
        share = 1.0 / max(d, 1e-12)
        gx, gy, gz = x * share, y * share, along * share
    else:
        q = math.sqrt(x * x + y * y)
        d, gq, gz = _meridian(solid, q, z)
        share = gq / max(q, 1e-12)
        gx, gy = x * share, y * share
    return d - solid[EXTENSION], gx, gy, gz


@compiled_inside
def _box(
    a: float, b: float, c: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    ex, ey, ez = abs(x) - a, abs(y) - b, abs(z) - c
    ox, oy, oz = max(ex, 0.0), max(ey, 0.0), max(ez, 0.0)
    d = math.sqrt(ox * ox + oy * oy + oz * oz)
    if d > 0.0:
        share = 1.0 / d
        return (
            d,
            math.copysign(ox * share, x),
            math.copysign(oy * share, y),
            math.copysign(oz * share, z),
        )
    if ex >= ey and ex >= ez:
        return ex, math.copysign(1.0, x), 0.0, 0.0
    if ey >= ez:
        return ey, 0.0, math.copysign(1.0, y), 0.0
    return ez, 0.0, 0.0, math.copysign(1.0, z)


@compiled_inside
def _hexagon(
    inner: float, height: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Return distance and gradient for six faces; the normal of the first is x."""
    nx, ny = 1.0, 0.0
    if abs(y) * math.sqrt(3.0) > abs(x):
        nx, ny = 0.5, math.sqrt(0.75)
    nx, ny = math.copysign(nx, x), math.copysign(ny, y)
    face = nx * x + ny * y - inner
    side = nx * y - ny * x
    half = inner / math.sqrt(3.0)
    over = side - min(max(side, -half), half)
    tall = abs(z) - height
    if face <= 0.0 and tall <= 0.0:
        if face >= tall:
            return face, nx, ny, 0.0
        return tall, 0.0, 0.0, math.copysign(1.0, z)
    face, tall = max(face, 0.0), math.copysign(max(tall, 0.0), z)
    d = math.sqrt(face * face + over * over + tall * tall)
    share = 1.0 / d
    return (
        d,
        (face * nx - over * ny) * share,
        (face * ny + over * nx) * share,
        tall * share,
    )


@compiled_inside
def _meridian(solid: Numbers, q: float, z: float) -> tuple[float, float, float]:
    """Return distance and gradient of (radius, height) from a trapezium about the axis."""
    foot, top, height = solid[1], solid[2], solid[3]
    nq, nz, length = solid[SIDE_OUT], solid[SIDE_UP], solid[SIDE_LENGTH]
    side = (q - foot) * nq + (z + height) * nz
    tall = abs(z) - height
    if side <= 0.0 and tall <= 0.0:
        if side >= tall:
            return side, nq, nz
        return tall, 0.0, math.copysign(1.0, z)
    along = min(max((z + height) * nq - (q - foot) * nz, 0.0), length)
    dq, dz = q - foot + along * nz, z + height - along * nq
    square = dq * dq + dz * dz
    if tall > 0.0:
        cap = max(q - (top if z > 0.0 else foot), 0.0)
        if cap * cap + tall * tall < square:
            dq, dz = cap, math.copysign(tall, z)
            square = dq * dq + dz * dz
    d = math.sqrt(square)
    share = 1.0 / max(d, 1e-12)
    return d, dq * share, dz * share
