"""Contact of soft fingertips with an object: forces, momentum, and which part of it slides.

Every node of a fingertip's skin that reaches into the object presses and holds on by itself
(`holdfast.twin.skin`). All is computed in the frame of the object, where its shape is known.
"""

from typing import NamedTuple

import numpy as np

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.objects import Thing, solid
from holdfast.twin.shapes import AMPLITUDE, MOST_RELIEF, probe, relief
from holdfast.twin.skin import (
    BALL,
    BX,
    BY,
    BZ,
    N_BRISTLE,
    SLIDING,
    SLIPPING,
    Skin,
    flat,
    friction,
    pressure,
)
from holdfast.twin.surface import Surface
from holdfast.twin.vectors import (
    Nine,
    Three,
    add,
    apply,
    apply_transposed,
    cross,
    dot,
    scaled,
    subtract,
)

N_BODY = 18
"""Numbers of a body, in the world frame: position [m], rotation (9, by rows), velocity [m/s]
of its origin and spin [rad/s]."""

# Columns of Contact.tips.
FX, FY, FZ, TX, TY, TZ = range(6)  # force [N] and torque [N m] on the fingertip, world frame
SLIP, SHARE, LOAD = 6, 7, 8  # slip speed [m/s], share of the load that slips, load [N]
N_TIP = 9

STIFF, WAY = 3, 4  # columns of Constants.nodes beside the position

Pose = tuple[Nine, Three]
Motion = tuple[Three, Three]


class Constants(NamedTuple):
    """What touches what.

    Attributes:
        nodes: (n_nodes, 5) positions of the nodes in the fingertip frame [m], stiffness of
            each [N/m], and length of the way to it from the first through all between [m].
        solid: the object, as `objects.solid` packs it.
        skin: (13,) the numbers of `Skin`, and the ball that holds the nodes: centre and
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
        pose = _pose(bodies, tip, n_tips)
        if _far(constants, pose):
            _let_go(state, tip)
            continue
        motion = _motion(bodies, tip, n_tips, pose[1])
        part, turn = _press(state, constants, tip, pose, motion, dt)
        force = add(force, part)
        torque = add(torque, turn)
        _tell(state, bodies, tip, part, subtract(turn, cross(pose[1], part)))
    fx, fy, fz = _turned(bodies, n_tips, force)
    tx, ty, tz = _turned(bodies, n_tips, torque)
    state.wrench[0], state.wrench[1], state.wrench[2] = -fx, -fy, -fz
    state.wrench[3], state.wrench[4], state.wrench[5] = -tx, -ty, -tz


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
    return apply(_rotation(bodies, i), v)


@compiled
def _apart(bodies: Array, tip: int, thing: int, at: int) -> Three:
    """The difference of two bodies' vectors, in the frame of the second."""
    delta = (
        bodies[tip, at] - bodies[thing, at],
        bodies[tip, at + 1] - bodies[thing, at + 1],
        bodies[tip, at + 2] - bodies[thing, at + 2],
    )
    return apply_transposed(_rotation(bodies, thing), delta)


@compiled
def _pose(bodies: Array, tip: int, thing: int) -> Pose:
    """The fingertip frame in the object's: rotation, offset [m]."""
    finger, back = _rotation(bodies, tip), _rotation(bodies, thing)
    x = apply_transposed(back, (finger[0][0], finger[1][0], finger[2][0]))
    y = apply_transposed(back, (finger[0][1], finger[1][1], finger[2][1]))
    z = apply_transposed(back, (finger[0][2], finger[1][2], finger[2][2]))
    rotation = ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))
    return rotation, _apart(bodies, tip, thing, 0)


@compiled
def _motion(bodies: Array, tip: int, thing: int, offset: Three) -> Motion:
    """Of the fingertip against the object, in its frame: of the origin [m/s], spin [rad/s]."""
    spin = (bodies[thing, 15], bodies[thing, 16], bodies[thing, 17])
    carried = cross(apply_transposed(_rotation(bodies, thing), spin), offset)
    velocity = subtract(_apart(bodies, tip, thing, 12), carried)
    return velocity, _apart(bodies, tip, thing, 15)


@compiled
def _far(constants: Constants, pose: Pose) -> bool:
    """Whether the ball that holds all nodes is clear of the object."""
    skin, solid = constants.skin, constants.solid
    x, y, z = add(apply(pose[0], (skin[BALL], skin[BALL + 1], skin[BALL + 2])), pose[1])
    return bool(probe(solid, x, y, z)[0] > skin[BALL + 3] + MOST_RELIEF * solid[AMPLITUDE])


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
    state: Contact, constants: Constants, tip: int, pose: Pose, motion: Motion, dt: float
) -> tuple[Three, Three]:
    """All nodes of a fingertip: force, and torque about the object, in the object's frame.

    A node at distance d says of every node that is less than d of way behind it that it does
    not touch either: most are never looked at.
    """
    nodes, solid, skin = constants
    bristles, forces = state.bristles[tip], state.node_forces[tip]
    reach = MOST_RELIEF * solid[AMPLITUDE]
    load, slip, slipping = 0.0, 0.0, 0.0
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    clear = -1.0
    for i in range(len(nodes)):
        if nodes[i, WAY] < clear:
            _rest(bristles, forces, i)
            continue
        arm = apply(pose[0], (nodes[i, 0], nodes[i, 1], nodes[i, 2]))
        point = add(arm, pose[1])
        d, gx, gy, gz = probe(solid, point[0], point[1], point[2])
        normal = (gx, gy, gz)
        if d >= reach:
            _rest(bristles, forces, i)
            clear = nodes[i, WAY] + d - reach
            continue
        depth = -d - relief(solid, point[0], point[1], point[2])
        if depth <= 0.0:
            _rest(bristles, forces, i)
            continue
        velocity = add(motion[0], cross(motion[1], arm))
        pressed = pressure(skin, nodes[i, STIFF], depth, dot(velocity, normal))
        if pressed <= 0.0:
            _rest(bristles, forces, i)
            continue
        node = (depth, nodes[i, STIFF], pressed)
        held = friction(solid, skin, bristles, i, pose[0], normal, flat(velocity, normal), node, dt)
        total = add(scaled(normal, pressed), held)
        forces[i, 0], forces[i, 1], forces[i, 2] = apply_transposed(pose[0], total)
        force, torque = add(force, total), add(torque, cross(point, total))
        load += pressed
        slip += pressed * bristles[i, SLIDING]
        slipping += pressed * (bristles[i, SLIDING] > skin[SLIPPING])
    weight = max(load, 1e-300)
    state.tips[tip, SLIP], state.tips[tip, SHARE] = slip / weight, slipping / weight
    state.tips[tip, LOAD] = load
    return force, torque


@compiled
def _rest(bristles: Array, forces: Array, i: int) -> None:
    """A node that touches nothing forgets."""
    bristles[i, BX] = bristles[i, BY] = bristles[i, BZ] = bristles[i, SLIDING] = 0.0
    forces[i, 0] = forces[i, 1] = forces[i, 2] = 0.0
