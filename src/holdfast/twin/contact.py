"""Contact of soft fingertips with an object: an elastic foundation with bristle friction.

Every node of the skin is a spring of its own that stands on the fingertip (a Winkler
foundation). Where it reaches into the object it presses along the normal of the object; along
the surface it holds on by a bristle that stretches until Coulomb's limit and then slides. At
rest a bristle is a spring, so that nothing creeps, and how fast each node slides is known.
"""

import math
from typing import NamedTuple

import numpy as np

from holdfast.compiled import compiled
from holdfast.sensors.values import Array
from holdfast.twin.objects import (
    AMPLITUDE,
    MOST_RELIEF,
    MU_KINETIC,
    MU_STATIC,
    Thing,
    probe,
    relief,
    solid,
)
from holdfast.twin.surface import Surface

N_BODY = 18
"""Numbers of a body, in the world frame: position [m], rotation (9, by rows), velocity [m/s]
of its origin and spin [rad/s]."""

# Columns of Contact.bristles.
BX, BY, BZ = 0, 1, 2  # by which the node is stretched along the surface, fingertip frame [m]
SLIDING = 3  # its plastic slip speed, low-pass [m/s]
N_BRISTLE = 4

# Columns of Contact.tips.
FX, FY, FZ, TX, TY, TZ = range(6)  # force [N] and torque [N m] on the fingertip, world frame
SLIP, SHARE, LOAD = 6, 7, 8  # slip speed [m/s], share of the load that slips, load [N]
N_TIP = 9

_FORGOTTEN = 1e-12  # a slip speed [m/s] below which it is none: no denormal numbers

Three = tuple[float, float, float]
Nine = tuple[Three, Three, Three]


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


class Constants(NamedTuple):
    """What touches what.

    Attributes:
        nodes: (n_nodes, 5) positions of the nodes in the fingertip frame [m], stiffness of
            each [N/m], and length of the way to it from the first through all between [m].
        solid: the object, as `objects.solid` packs it.
        skin: (13,) the numbers of `Skin`, and the sphere that holds the nodes: centre and
            radius [m].
    """

    nodes: Array
    solid: Array
    skin: Array


class Contact(NamedTuple):
    """State of the contact, and what came of the last `touch`. Written in place.

    Attributes:
        bristles: (n_tips, n_nodes, 4) stretch of every node in the fingertip frame [m] and its
            slip speed [m/s]: the whole state.
        node_forces: (n_tips, n_nodes, 3) on the nodes, in the fingertip frame [N].
        tips: (n_tips, 9) force [N] and torque about its origin [N m] on every fingertip, world
            frame; slip speed [m/s], share of the load that slips, load [N].
        wrench: (6,) force [N] and torque about the centre of mass [N m] on the object, world
            frame.
    """

    bristles: Array
    node_forces: Array
    tips: Array
    wrench: Array

    @property
    def tip_force(self) -> Array:
        """(n_tips, 3) on the fingertips, world frame [N]."""
        return self.tips[:, FX : FZ + 1]

    @property
    def tip_torque(self) -> Array:
        """(n_tips, 3) about the fingertip frames' origins, world frame [N m]."""
        return self.tips[:, TX : TZ + 1]

    @property
    def contact_force(self) -> Array:
        """(n_tips, 3) of each finger on the object, world frame [N]."""
        return -self.tip_force

    @property
    def object_force(self) -> Array:
        """(3,) of all fingers on the object, world frame [N]."""
        return self.wrench[:3]

    @property
    def object_torque(self) -> Array:
        """(3,) of all fingers on the object about its centre of mass, world frame [N m]."""
        return self.wrench[3:]

    @property
    def slip_speed(self) -> Array:
        """(n_tips,) of the nodes, weighted by their load [m/s]."""
        return self.tips[:, SLIP]

    @property
    def slipping_share(self) -> Array:
        """(n_tips,) share of the load that rests on slipping nodes."""
        return self.tips[:, SHARE]

    @property
    def load(self) -> Array:
        """(n_tips,) sum of the pressing forces of the nodes [N]."""
        return self.tips[:, LOAD]


def new_contact(surface: Surface, n_tips: int) -> Contact:
    """The state of fingertips that touch nothing."""
    n_nodes = len(surface.nodes)
    return Contact(
        np.zeros((n_tips, n_nodes, N_BRISTLE)),
        np.zeros((n_tips, n_nodes, 3)),
        np.zeros((n_tips, N_TIP)),
        np.zeros(6),
    )


def constants_of(surface: Surface, thing: Thing, skin: Skin | None = None) -> Constants:
    """All that `touch` needs to know of a skin and of an object.

    Args:
        surface: of every fingertip.
        thing: the object.
        skin: what the skin is made of.
    """
    skin = skin or Skin()
    nodes = surface.nodes
    steps = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    centre = (nodes.min(axis=0) + nodes.max(axis=0)) / 2
    radius = np.linalg.norm(nodes - centre, axis=1).max()
    return Constants(
        np.column_stack([nodes, skin.stiffness * surface.areas, way]),
        solid(thing),
        np.array([*skin, *centre, radius]),
    )


@compiled
def touch(state: Contact, constants: Constants, bodies: Array, dt: float) -> None:
    """One step of the contact: forces for these poses and velocities, and new bristles.

    Forces on fingertips and object act at the same points in opposite directions, so that
    momentum and angular momentum are kept to rounding.

    Args:
        state: of the contact; it and the forces in it are written.
        constants: skin and object.
        bodies: (n_tips + 1, 18) the fingertip frames and last the object's, whose origin is its
            centre of mass: position [m], rotation by rows, velocity [m/s], spin [rad/s], all
            in the world frame.
        dt: since the last step [s].
    """
    n_tips = len(state.tips)
    force = (0.0, 0.0, 0.0)
    torque = (0.0, 0.0, 0.0)
    for tip in range(n_tips):
        rotation, offset = _pose(bodies, tip, n_tips)
        if _far(constants, rotation, offset):
            _let_go(state, tip)
            continue
        motion = _motion(bodies, tip, n_tips, offset)
        part, turn = _press(state, constants, tip, rotation, offset, motion, dt)
        force = _sum(force, part)
        torque = _sum(torque, turn)
        _tell(state, bodies, tip, part, _difference(turn, _cross(offset, part)))
    fx, fy, fz = _turned(bodies, n_tips, force)
    tx, ty, tz = _turned(bodies, n_tips, torque)
    state.wrench[0], state.wrench[1], state.wrench[2] = -fx, -fy, -fz
    state.wrench[3], state.wrench[4], state.wrench[5] = -tx, -ty, -tz


@compiled
def _sum(a: Three, b: Three) -> Three:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def _difference(a: Three, b: Three) -> Three:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def _cross(a: Three, b: Three) -> Three:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _dot(a: Three, b: Three) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _apply(m: Nine, v: Three) -> Three:
    return _dot(m[0], v), _dot(m[1], v), _dot(m[2], v)


@compiled
def _back(m: Nine, v: Three) -> Three:
    """By the transpose."""
    return (
        m[0][0] * v[0] + m[1][0] * v[1] + m[2][0] * v[2],
        m[0][1] * v[0] + m[1][1] * v[1] + m[2][1] * v[2],
        m[0][2] * v[0] + m[1][2] * v[1] + m[2][2] * v[2],
    )


@compiled
def _rotation(bodies: Array, i: int) -> Nine:
    return (
        (bodies[i, 3], bodies[i, 4], bodies[i, 5]),
        (bodies[i, 6], bodies[i, 7], bodies[i, 8]),
        (bodies[i, 9], bodies[i, 10], bodies[i, 11]),
    )


@compiled
def _turned(bodies: Array, i: int, v: Three) -> Three:
    """From the frame of a body to the world frame."""
    return _apply(_rotation(bodies, i), v)


@compiled
def _apart(bodies: Array, tip: int, thing: int, at: int) -> Three:
    """The difference of two bodies' vectors, in the frame of the second."""
    delta = (
        bodies[tip, at] - bodies[thing, at],
        bodies[tip, at + 1] - bodies[thing, at + 1],
        bodies[tip, at + 2] - bodies[thing, at + 2],
    )
    return _back(_rotation(bodies, thing), delta)


@compiled
def _pose(bodies: Array, tip: int, thing: int) -> tuple[Nine, Three]:
    """The fingertip frame in the object's: rotation, offset [m]."""
    finger, back = _rotation(bodies, tip), _rotation(bodies, thing)
    x = _back(back, (finger[0][0], finger[1][0], finger[2][0]))
    y = _back(back, (finger[0][1], finger[1][1], finger[2][1]))
    z = _back(back, (finger[0][2], finger[1][2], finger[2][2]))
    rotation = ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))
    return rotation, _apart(bodies, tip, thing, 0)


@compiled
def _motion(bodies: Array, tip: int, thing: int, offset: Three) -> tuple[Three, Three]:
    """Of the fingertip against the object, in its frame: of the origin [m/s], spin [rad/s]."""
    spin = (bodies[thing, 15], bodies[thing, 16], bodies[thing, 17])
    carried = _cross(_back(_rotation(bodies, thing), spin), offset)
    velocity = _difference(_apart(bodies, tip, thing, 12), carried)
    return velocity, _apart(bodies, tip, thing, 15)


@compiled
def _far(constants: Constants, rotation: Nine, offset: Three) -> bool:
    """Whether the sphere that holds all nodes is clear of the object."""
    skin, solid = constants.skin, constants.solid
    x, y, z = _sum(_apply(rotation, (skin[9], skin[10], skin[11])), offset)
    return bool(probe(solid, x, y, z)[0] > skin[12] + MOST_RELIEF * solid[AMPLITUDE])


@compiled
def _let_go(state: Contact, tip: int) -> None:
    if state.tips[tip, LOAD] != 0.0:
        state.bristles[tip] = 0.0
        state.node_forces[tip] = 0.0
        state.tips[tip] = 0.0


@compiled
def _tell(state: Contact, bodies: Array, tip: int, force: Three, torque: Three) -> None:
    """Force and torque on a fingertip, from the object's frame to the world's."""
    row, thing = state.tips[tip], len(bodies) - 1
    row[FX], row[FY], row[FZ] = _turned(bodies, thing, force)
    row[TX], row[TY], row[TZ] = _turned(bodies, thing, torque)


@compiled
def _press(
    state: Contact,
    constants: Constants,
    tip: int,
    rotation: Nine,
    offset: Three,
    motion: tuple[Three, Three],
    dt: float,
) -> tuple[Three, Three]:
    """All nodes of a fingertip: force, and torque about the object, in the object's frame.

    A node at distance d says of every node that is less than d of way behind it that it does
    not touch either: most are never looked at.
    """
    nodes, solid, skin = constants
    bristles, forces, row = state.bristles[tip], state.node_forces[tip], state.tips[tip]
    reach = MOST_RELIEF * solid[AMPLITUDE]
    fade = 1.0 - math.exp(-dt / skin[7])
    load, slip, slipping = 0.0, 0.0, 0.0
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    clear = -1.0
    for i in range(len(nodes)):
        if nodes[i, 4] < clear:
            _rest(bristles, forces, i)
            continue
        arm = _apply(rotation, (nodes[i, 0], nodes[i, 1], nodes[i, 2]))
        point = _sum(arm, offset)
        d, gx, gy, gz = probe(solid, point[0], point[1], point[2])
        if d < reach:
            d += relief(solid, point[0], point[1], point[2])
        else:
            clear = nodes[i, 4] + d - reach
        velocity = _sum(motion[0], _cross(motion[1], arm))
        normal = (gx, gy, gz)
        approach = _dot(velocity, normal)
        pressed = _pressure(skin, nodes[i, 3], -d, approach)
        if pressed <= 0.0:
            _rest(bristles, forces, i)
            continue
        sliding = (
            velocity[0] - approach * gx,
            velocity[1] - approach * gy,
            velocity[2] - approach * gz,
        )
        tangential = _stretch(
            bristles, i, solid, skin, rotation, normal, sliding, -d, nodes[i, 3], pressed, fade, dt
        )
        f = (
            pressed * gx + tangential[0],
            pressed * gy + tangential[1],
            pressed * gz + tangential[2],
        )
        forces[i, 0], forces[i, 1], forces[i, 2] = _back(rotation, f)
        force = _sum(force, f)
        torque = _sum(torque, _cross(point, f))
        load += pressed
        slip += pressed * bristles[i, SLIDING]
        if bristles[i, SLIDING] > skin[8]:
            slipping += pressed
    weight = max(load, 1e-300)
    row[SLIP], row[SHARE], row[LOAD] = slip / weight, slipping / weight, load
    return force, torque


@compiled
def _rest(bristles: Array, forces: Array, i: int) -> None:
    """A node that touches nothing forgets."""
    bristles[i, BX] = bristles[i, BY] = bristles[i, BZ] = bristles[i, SLIDING] = 0.0
    forces[i, 0] = forces[i, 1] = forces[i, 2] = 0.0


@compiled
def _elastic(skin: Array, stiffness: float, depth: float) -> float:
    """The pressing force of a node at rest, k d (1 + h d) [N]."""
    force: float = stiffness * depth * (1.0 + skin[1] * depth)
    return force


@compiled
def _pressure(skin: Array, stiffness: float, depth: float, leaving: float) -> float:
    """Its pressing force while it leaves, N(d) (1 - c v_n), never less than 0 [N]."""
    if depth <= 0.0:
        return 0.0
    pressed: float = _elastic(skin, stiffness, depth) * max(1.0 - skin[2] * leaving, 0.0)
    return pressed


@compiled
def _stretch(
    bristles: Array,
    i: int,
    solid: Array,
    skin: Array,
    rotation: Nine,
    normal: Three,
    sliding: Three,
    depth: float,
    stiffness: float,
    pressed: float,
    fade: float,
    dt: float,
) -> Three:
    """Friction on a node in the object's frame [N]; its bristle moves on.

    The bristle b follows the motion along the surface; k_t = shear N(d) / (d + d_0). Beyond
    mu N / k_t it is cut back to that (return mapping) and the node slides by what was cut.
    mu = mu_k + (mu_s - mu_k) exp(-v_f / v_s), T = -k_t (b + tau v_t), at most mu N.
    """
    kt = skin[3] * _elastic(skin, stiffness, depth) / (depth + skin[4])
    drop = math.exp(-bristles[i, SLIDING] / skin[6])
    limit = pressed * (solid[MU_KINETIC] + (solid[MU_STATIC] - solid[MU_KINETIC]) * drop)
    b = _apply(rotation, (bristles[i, BX], bristles[i, BY], bristles[i, BZ]))
    b = _flat((b[0] + sliding[0] * dt, b[1] + sliding[1] * dt, b[2] + sliding[2] * dt), normal)
    length = math.sqrt(_dot(b, b))
    slip = 0.0
    if length * kt > limit:
        slip = (length - limit / kt) / dt
        b = _scaled(b, limit / (kt * length))
    bristles[i, BX], bristles[i, BY], bristles[i, BZ] = _back(rotation, b)
    smooth = bristles[i, SLIDING] + fade * (slip - bristles[i, SLIDING])
    bristles[i, SLIDING] = smooth if smooth > _FORGOTTEN else 0.0
    force = _scaled(_sum(b, _scaled(sliding, skin[5])), -kt)
    square = _dot(force, force)
    if square > limit * limit:
        force = _scaled(force, limit / math.sqrt(square))
    return force


@compiled
def _flat(v: Three, normal: Three) -> Three:
    """The part of a vector along the surface."""
    out = _dot(v, normal)
    return v[0] - out * normal[0], v[1] - out * normal[1], v[2] - out * normal[2]


@compiled
def _scaled(v: Three, by: float) -> Three:
    return v[0] * by, v[1] * by, v[2] * by
