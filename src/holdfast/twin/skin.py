"""Contact law of one node of a soft skin: normal force, and friction by a bristle.

The skin is a Winkler foundation: every node is a separate spring on the fingertip. Along the
surface each node has a bristle, which stretches up to Coulomb's limit and then slides. At rest a
bristle is a spring, so nothing creeps, and the slip speed of each node is known.
"""

import math
from typing import NamedTuple

from holdfast.compiled import compiled, compiled_inside
from holdfast.twin.shapes import MU_KINETIC, MU_STATIC, Numbers

Three = tuple[float, float, float]
Nine = tuple[Three, Three, Three]


@compiled
def add(a: Three, b: Three) -> Three:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def subtract(a: Three, b: Three) -> Three:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def cross(a: Three, b: Three) -> Three:
    """Return the cross product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def dot(a: Three, b: Three) -> float:
    """Return the dot product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def apply(m: Nine, v: Three) -> Three:
    """Return M v, with M given by rows."""
    return dot(m[0], v), dot(m[1], v), dot(m[2], v)


@compiled
def apply_transposed(m: Nine, v: Three) -> Three:
    """Return the transpose of M times v."""
    return (
        m[0][0] * v[0] + m[1][0] * v[1] + m[2][0] * v[2],
        m[0][1] * v[0] + m[1][1] * v[1] + m[2][1] * v[2],
        m[0][2] * v[0] + m[1][2] * v[1] + m[2][2] * v[2],
    )


@compiled
def scaled(v: Three, by: float) -> Three:
    """Return a vector times a number."""
    return v[0] * by, v[1] * by, v[2] * by


# Columns of bristles.
BX, BY, BZ = 0, 1, 2  # stretch of the node along the surface, fingertip frame [m]
PLASTIC_SPEED = 3  # its plastic slip speed, low-pass filtered [m/s]
N_BRISTLE = 4
Bristle = tuple[float, float, float, float]

# Columns of a packed skin: the fields of Skin in their order, and the ball around all nodes.
STIFFNESS, HARDENING, VISCOUS, SHEAR, ENGAGEMENT, SHEAR_TIME, STRIBECK, MEMORY, SLIPPING = range(9)
BALL = 9

_MIN_SLIP_SPEED = 1e-12  # slower slip [m/s] is set to zero, to avoid denormal numbers


class Skin(NamedTuple):
    """Material of the skin.

    Attributes:
        stiffness: stiffness of the foundation at small depths [N/m^3]. Silicone of 50 kPa (like
            Ecoflex 00-30), 5 mm thick: a fingertip is indented by 0.9 mm at 1 N, 1.8 mm at 4 N.
        hardening: relative growth of the stiffness with depth [1/m]. It doubles at 2.5 mm, half
            of the silicone's thickness.
        damping: relative growth of the pressure with the speed of approach [s/m]
            (Hunt and Crossley). Own choice: 1 % at 10 mm/s.
        shear: ratio of the stiffness along the surface to that across it. 0.7, as for bodies
            with a Poisson's ratio near 0.5 (Mindlin: 2 (1 - nu) / (2 - nu) = 0.67).
        engagement: depth at which half of the shear stiffness acts [m], because asperities come
            into contact one after the other. Own choice.
        shear_time: viscous part of the shear stiffness [s]. Own choice: it damps the oscillation
            of a bristle with a finger.
        stribeck: slip speed at which friction falls from static to kinetic [m/s]. Own choice,
            of the order measured on rubber (1 to 10 mm/s).
        memory: time constant that smooths a node's slip speed [s]. Own choice, below a sample.
        slipping: slip speed above which a node counts as slipping [m/s]. Own choice.
    """

    stiffness: float = 1e7
    hardening: float = 1 / 2.5e-3
    damping: float = 1.2
    shear: float = 0.7
    engagement: float = 0.3e-3
    shear_time: float = 1.2e-3
    stribeck: float = 4e-3
    memory: float = 4e-3
    slipping: float = 1e-4


@compiled
def elastic(skin: Numbers, stiffness: float, depth: float) -> float:
    """Compute the normal force of a node at rest, N(d) = k d (1 + h d) [N]."""
    force: float = stiffness * depth * (1.0 + skin[HARDENING] * depth)
    return force


@compiled_inside
def pressure(skin: Numbers, stiffness: float, depth: float, leaving: float) -> float:
    """Compute the normal force of a moving node, N(d) (1 - c v_n), at least 0 [N].

    Args:
        skin: the packed skin.
        stiffness: stiffness of the node at small depths [N/m].
        depth: depth of the node below the surface, above 0 [m].
        leaving: speed along the outward normal [m/s].
    """
    force: float = elastic(skin, stiffness, depth) * max(1.0 - skin[VISCOUS] * leaving, 0.0)
    return force


@compiled_inside
def friction(
    solid: Numbers,
    skin: Numbers,
    bristle: Bristle,
    rotation: Nine,
    normal: Three,
    sliding: Three,
    node: Three,
    dt: float,
    keep: float,
) -> tuple[Three, Bristle]:
    """Compute friction on a node and advance its bristle.

    The bristle b follows the motion along the surface. The friction is T = -k_t (b + tau v_t)
    with k_t = shear N(d) / (d + d_0), and |T| is at most mu N. A bristle longer than mu N / k_t
    is shortened to that length (return mapping), and the node slides by the difference. Friction
    falls with the slip speed: mu = mu_k + (mu_s - mu_k) exp(-v_f / v_s) (Stribeck).

    Args:
        solid: the packed object.
        skin: the packed skin.
        bristle: the bristle.
        rotation: rotation from the fingertip frame to the object's.
        normal: normal of the object, in its frame.
        sliding: velocity along the surface in the object's frame [m/s].
        node: its depth [m], stiffness at small depths [N/m] and normal force [N].
        dt: time since the last step [s].
        keep: `memory_after` this time.

    Returns:
        The force on the node in the object's frame [N], and the bristle.
    """
    depth, stiffness, pressed = node
    kt = skin[SHEAR] * elastic(skin, stiffness, depth) / (depth + skin[ENGAGEMENT])
    limit = pressed * _coefficient(solid, skin, bristle[PLASTIC_SPEED])
    b = apply(rotation, (bristle[BX], bristle[BY], bristle[BZ]))
    b = tangential(add(b, scaled(sliding, dt)), normal)
    length = math.sqrt(dot(b, b))
    slip = 0.0
    if length * kt > limit:
        slip = (length - limit / kt) / dt
        b = scaled(b, limit / (kt * length))
    x, y, z = apply_transposed(rotation, b)
    after = x, y, z, _smoothed(bristle[PLASTIC_SPEED], slip, keep)
    force = scaled(add(b, scaled(sliding, skin[SHEAR_TIME])), -kt)
    square = dot(force, force)
    if square > limit * limit:
        force = scaled(force, limit / math.sqrt(square))
    return force, after


@compiled
def memory_after(skin: Numbers, dt: float) -> float:
    """Return the share of a slip speed that is left after a time [s] in its low-pass filter."""
    return math.exp(-dt / skin[MEMORY])


@compiled_inside
def _coefficient(solid: Numbers, skin: Numbers, slip: float) -> float:
    drop = math.exp(-slip / skin[STRIBECK]) if slip > 0.0 else 1.0
    mu: float = solid[MU_KINETIC] + (solid[MU_STATIC] - solid[MU_KINETIC]) * drop
    return mu


@compiled_inside
def _smoothed(before: float, slip: float, keep: float) -> float:
    """Return the slip speed of a node after a first-order low-pass filter [m/s]."""
    if before == slip:
        return slip
    after = slip + (before - slip) * keep
    return after if after > _MIN_SLIP_SPEED else 0.0


@compiled
def tangential(v: Three, normal: Three) -> Three:
    """Return the part of a vector along the surface."""
    return add(v, scaled(normal, -dot(v, normal)))
