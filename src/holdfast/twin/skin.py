"""What one node of a soft skin does: it presses, and it holds on by a bristle until it slides.

The skin is a Winkler foundation: every node is a spring of its own that stands on the
fingertip. Along the surface it holds on by a bristle that stretches until Coulomb's limit and
then slides. At rest a bristle is a spring, so that nothing creeps, and how fast each node
slides is known.
"""

import math
from typing import NamedTuple

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.shapes import MU_KINETIC, MU_STATIC
from holdfast.twin.vectors import Nine, Three, add, apply, apply_transposed, dot, scaled

# Columns of bristles.
BX, BY, BZ = 0, 1, 2  # by which the node is stretched along the surface, fingertip frame [m]
SLIDING = 3  # its plastic slip speed, low-pass [m/s]
N_BRISTLE = 4

# Columns of a packed skin: the fields of Skin in their order, and the ball round all nodes.
STIFFNESS, HARDENING, DAMPING, SHEAR, ENGAGEMENT, SHEAR_TIME, STRIBECK, MEMORY, SLIPPING = range(9)
BALL = 9

_FORGOTTEN = 1e-12  # a slip speed [m/s] below which it is none: no denormal numbers


class Skin(NamedTuple):
    """What the skin is made of.

    Attributes:
        stiffness: of the foundation for small depths [N/m^3]. Silicone of 50 kPa (Ecoflex 00-30
            and its like), 5 mm thick: a fingertip yields 0.9 mm at 1 N, 1.8 mm at 4 N.
        hardening: relative growth of the stiffness with depth [1/m]: twice at 2.5 mm, half of
            the silicone's thickness.
        damping: relative growth of the pressure with the speed of approach [s/m]
            (Hunt and Crossley). Own choice: 1 % at 10 mm/s.
        shear: stiffness along the surface over that across it: 0.7, as for bodies of a
            Poisson's ratio near 0.5 (Mindlin: 2 (1 - nu) / (2 - nu) = 0.67).
        engagement: depth at which half of the shear stiffness acts [m]: asperities meet one
            after the other. Own choice.
        shear_time: viscous part of the shear stiffness [s]. Own choice: damps what a bristle
            and a finger make together.
        stribeck: slip speed over which friction falls from static to kinetic [m/s]. Own
            choice, of the order measured on rubber (1 to 10 mm/s).
        memory: time over which a node's slip speed is smoothed [s]. Own choice, under a sample.
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
def elastic(skin: Array, stiffness: float, depth: float) -> float:
    """The pressing force of a node at rest: N(d) = k d (1 + h d) [N]."""
    force: float = stiffness * depth * (1.0 + skin[HARDENING] * depth)
    return force


@compiled
def pressure(skin: Array, stiffness: float, depth: float, leaving: float) -> float:
    """The pressing force of a node that moves: N(d) (1 - c v_n), never less than 0 [N].

    Args:
        skin: packed.
        stiffness: of the node for small depths [N/m].
        depth: of the node under the surface, above 0 [m].
        leaving: speed along the outward normal [m/s].
    """
    force: float = elastic(skin, stiffness, depth) * max(1.0 - skin[DAMPING] * leaving, 0.0)
    return force


@compiled
def friction(
    solid: Array,
    skin: Array,
    bristles: Array,
    i: int,
    rotation: Nine,
    normal: Three,
    sliding: Three,
    node: Three,
    dt: float,
) -> Three:
    """Friction on a node; its bristle moves on.

    The bristle b follows the motion along the surface, T = -k_t (b + tau v_t) with
    k_t = shear N(d) / (d + d_0), and |T| is at most mu N. Beyond mu N / k_t the bristle is cut
    back to that (return mapping), and the node slides by what was cut. Friction falls with the
    slip speed: mu = mu_k + (mu_s - mu_k) exp(-v_f / v_s) (Stribeck).

    Args:
        solid: the object, packed.
        skin: packed.
        bristles: (n_nodes, 4) of the fingertip; row i is written.
        i: the node.
        rotation: from the fingertip frame to the object's.
        normal: of the object.
        sliding: velocity along the surface [m/s].
        node: its depth [m], stiffness for small depths [N/m] and pressing force [N].
        dt: since the last step [s].

    Returns:
        The force on the node [N]; this, normal and velocity in the object's frame.
    """
    depth, stiffness, pressed = node
    kt = skin[SHEAR] * elastic(skin, stiffness, depth) / (depth + skin[ENGAGEMENT])
    limit = pressed * _coefficient(solid, skin, bristles[i, SLIDING])
    b = apply(rotation, (bristles[i, BX], bristles[i, BY], bristles[i, BZ]))
    b = flat(add(b, scaled(sliding, dt)), normal)
    length = math.sqrt(dot(b, b))
    slip = 0.0
    if length * kt > limit:
        slip = (length - limit / kt) / dt
        b = scaled(b, limit / (kt * length))
    bristles[i, BX], bristles[i, BY], bristles[i, BZ] = apply_transposed(rotation, b)
    bristles[i, SLIDING] = _smoothed(skin, bristles[i, SLIDING], slip, dt)
    force = scaled(add(b, scaled(sliding, skin[SHEAR_TIME])), -kt)
    square = dot(force, force)
    if square > limit * limit:
        force = scaled(force, limit / math.sqrt(square))
    return force


@compiled
def _coefficient(solid: Array, skin: Array, slip: float) -> float:
    drop = math.exp(-slip / skin[STRIBECK]) if slip > 0.0 else 1.0
    mu: float = solid[MU_KINETIC] + (solid[MU_STATIC] - solid[MU_KINETIC]) * drop
    return mu


@compiled
def _smoothed(skin: Array, before: float, slip: float, dt: float) -> float:
    """The slip speed of a node after a low-pass of first order [m/s]."""
    if before == slip:
        return slip
    after = slip + (before - slip) * math.exp(-dt / skin[MEMORY])
    return after if after > _FORGOTTEN else 0.0


@compiled
def flat(v: Three, normal: Three) -> Three:
    """The part of a vector along the surface."""
    return add(v, scaled(normal, -dot(v, normal)))
