"""Contact of soft fingertips with an object: forces and slip.

Every node of a fingertip's skin inside the object presses and sticks on its own
(`holdfast.twin.skin`). The computation is in the frame of the object, where its shape is known.
"""

from typing import NamedTuple

import numpy as np

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.objects import GraspObject, solid
from holdfast.twin.shapes import MAX_RELIEF, TEXTURE_AMPLITUDE, probe, relief, unpacked
from holdfast.twin.skin import (
    BALL,
    BX,
    BY,
    BZ,
    N_BRISTLE,
    PLASTIC_SPEED,
    SLIPPING,
    Nine,
    Skin,
    Three,
    add,
    apply,
    apply_transposed,
    cross,
    dot,
    friction,
    memory_after,
    pressure,
    scaled,
    subtract,
    tangential,
)
from holdfast.twin.surface import Surface

# Columns of Contact.tips.
FX, FY, FZ, TX, TY, TZ = range(6)  # force [N] and torque [N m] on the fingertip, world frame
TIP_SLIP, TIP_SLIPPING_SHARE, TIP_LOAD = (
    6,
    7,
    8,
)  # slip speed [m/s], slipping share of the load, load [N]
N_TIP = 9

NODE_STIFFNESS, PATH_LENGTH = 3, 4  # columns of Constants.nodes beside the position

Pose = tuple[Nine, Three]
Motion = tuple[Three, Three]


class Constants(NamedTuple):
    """Skin and object in a contact.

    Attributes:
        nodes: (n_nodes, 5) positions of the nodes in the fingertip frame [m], stiffness of
            each [N/m], and length of the path from the first node to it through all nodes
            between them [m].
        solid: the object, as `objects.solid` packs it.
        skin: (13,) the numbers of `Skin`, then centre and radius of a ball that contains all
            nodes [m].
    """

    nodes: Array
    solid: Array
    skin: Array


class Contact(NamedTuple):
    """State of the contact and results of the last `touch`, which writes them in place.

    Attributes:
        bristles: (n_tips, n_nodes, 4) stretch of every node in the fingertip frame [m] and its
            slip speed [m/s]. This is the whole state.
        node_forces: (n_tips, n_nodes, 3) forces on the nodes in the fingertip frame [N].
        tips: (n_tips, 9) force [N] and torque about the frame's origin [N m] on every fingertip
            in the world frame; slip speed [m/s], slipping share of the load, load [N].
        wrench: (6,) force [N] and torque about the centre of mass [N m] on the object in the
            world frame.
    """

    bristles: Array
    node_forces: Array
    tips: Array
    wrench: Array

    @property
    def tip_force(self) -> Array:
        """Forces on the fingertips in the world frame, (n_tips, 3) [N]."""
        return self.tips[:, FX : FZ + 1]

    @property
    def contact_force(self) -> Array:
        """Force of each finger on the object in the world frame, (n_tips, 3) [N]."""
        return -self.tip_force

    @property
    def slip_speed(self) -> Array:
        """Mean slip speed of the nodes, weighted by their load, (n_tips,) [m/s]."""
        return self.tips[:, TIP_SLIP]

    @property
    def slipping_share(self) -> Array:
        """Share of the load that rests on slipping nodes, (n_tips,)."""
        return self.tips[:, TIP_SLIPPING_SHARE]

    @property
    def load(self) -> Array:
        """Sum of the normal forces of the nodes, (n_tips,) [N]."""
        return self.tips[:, TIP_LOAD]


def new_contact(surface: Surface, n_tips: int) -> Contact:
    """Return the state of fingertips that touch nothing."""
    n_nodes = len(surface.nodes)
    return Contact(
        np.zeros((n_tips, n_nodes, N_BRISTLE)),
        np.zeros((n_tips, n_nodes, 3)),
        np.zeros((n_tips, N_TIP)),
        np.zeros(6),
    )


def constants_of(surface: Surface, item: GraspObject, skin: Skin | None = None) -> Constants:
    """Pack a skin and an object for `touch`.

    Args:
        surface: surface of every fingertip.
        item: the object.
        skin: material of the skin; by default `Skin()`.
    """
    skin = skin or Skin()
    nodes = surface.nodes
    steps = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    path_lengths = np.concatenate([[0.0], np.cumsum(steps)])
    centre = (nodes.min(axis=0) + nodes.max(axis=0)) / 2
    radius = np.linalg.norm(nodes - centre, axis=1).max()
    return Constants(
        np.column_stack([nodes, skin.stiffness * surface.areas, path_lengths]),
        solid(item),
        np.array([*skin, *centre, radius]),
    )


@compiled
def touch(state: Contact, constants: Constants, bodies: Array, dt: float) -> None:
    """Compute one step of the contact: forces at these poses and velocities, new bristles.

    Forces on fingertips and object act at the same points in opposite directions, so momentum
    and angular momentum are conserved up to rounding.

    Args:
        state: state of the contact; it and the forces in it are written.
        constants: skin and object.
        bodies: (n_tips + 1, 18) the fingertip frames, then the object's, whose origin is its
            centre of mass: position [m], rotation by rows, velocity [m/s], angular velocity
            [rad/s], all in the world frame.
        dt: time since the last step [s].
    """
    n_tips = len(state.tips)
    force = (0.0, 0.0, 0.0)
    torque = (0.0, 0.0, 0.0)
    for tip in range(n_tips):
        pose = _pose(bodies, tip, n_tips)
        if _is_far(constants, pose):
            _clear_tip(state, tip)
            continue
        motion = _motion(bodies, tip, n_tips, pose[1])
        tip_force, tip_torque = _sum_nodes(state, constants, tip, pose, motion, dt)
        force = add(force, tip_force)
        torque = add(torque, tip_torque)
        about_tip = subtract(tip_torque, cross(pose[1], tip_force))
        _store_tip(state, bodies, tip, tip_force, about_tip)
    fx, fy, fz = _to_world(bodies, n_tips, force)
    tx, ty, tz = _to_world(bodies, n_tips, torque)
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
def _to_world(bodies: Array, i: int, v: Three) -> Three:
    """Rotate a vector from the frame of a body to the world frame."""
    return apply(_rotation(bodies, i), v)


@compiled
def _relative_vector(bodies: Array, tip: int, item: int, at: int) -> Three:
    """Return the difference of two bodies' vectors in the frame of the second."""
    delta = (
        bodies[tip, at] - bodies[item, at],
        bodies[tip, at + 1] - bodies[item, at + 1],
        bodies[tip, at + 2] - bodies[item, at + 2],
    )
    return apply_transposed(_rotation(bodies, item), delta)


@compiled
def _pose(bodies: Array, tip: int, item: int) -> Pose:
    """Return rotation and offset [m] of the fingertip frame in the object's frame."""
    finger, back = _rotation(bodies, tip), _rotation(bodies, item)
    x = apply_transposed(back, (finger[0][0], finger[1][0], finger[2][0]))
    y = apply_transposed(back, (finger[0][1], finger[1][1], finger[2][1]))
    z = apply_transposed(back, (finger[0][2], finger[1][2], finger[2][2]))
    rotation = ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))
    return rotation, _relative_vector(bodies, tip, item, 0)


@compiled
def _motion(bodies: Array, tip: int, item: int, offset: Three) -> Motion:
    """Return velocity [m/s] and spin [rad/s] of a fingertip relative to the object."""
    spin = (bodies[item, 15], bodies[item, 16], bodies[item, 17])
    carried = cross(apply_transposed(_rotation(bodies, item), spin), offset)
    velocity = subtract(_relative_vector(bodies, tip, item, 12), carried)
    return velocity, _relative_vector(bodies, tip, item, 15)


@compiled
def _is_far(constants: Constants, pose: Pose) -> bool:
    """Return whether the ball that contains all nodes is clear of the object."""
    skin, solid = constants.skin, constants.solid
    x, y, z = add(apply(pose[0], (skin[BALL], skin[BALL + 1], skin[BALL + 2])), pose[1])
    return bool(probe(solid, x, y, z)[0] > skin[BALL + 3] + MAX_RELIEF * solid[TEXTURE_AMPLITUDE])


@compiled
def _clear_tip(state: Contact, tip: int) -> None:
    if state.tips[tip, TIP_LOAD] != 0.0:
        state.bristles[tip] = 0.0
        state.node_forces[tip] = 0.0
        state.tips[tip] = 0.0


@compiled
def _store_tip(state: Contact, bodies: Array, tip: int, force: Three, torque: Three) -> None:
    """Store force and torque on a fingertip, rotated from the object's frame to the world's."""
    row, item = state.tips[tip], len(bodies) - 1
    row[FX], row[FY], row[FZ] = _to_world(bodies, item, force)
    row[TX], row[TY], row[TZ] = _to_world(bodies, item, torque)


@compiled
def _sum_nodes(
    state: Contact, constants: Constants, tip: int, pose: Pose, motion: Motion, dt: float
) -> tuple[Three, Three]:
    """Return force and torque about the object of all nodes of a fingertip, object's frame.

    If a node is at distance d from the object, no later node whose path from it is shorter than
    d can touch either. So most nodes are skipped.
    """
    nodes, bristles, forces = constants.nodes, state.bristles[tip], state.node_forces[tip]
    solid, skin = unpacked(constants.solid), _unpacked_skin(constants.skin)
    keep = memory_after(skin, dt)
    reach = MAX_RELIEF * solid[TEXTURE_AMPLITUDE]
    load, slip, slipping = 0.0, 0.0, 0.0
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    clear = -1.0
    for i in range(len(nodes)):
        if nodes[i, PATH_LENGTH] < clear:
            _clear_node(bristles, forces, i)
            continue
        arm = apply(pose[0], (nodes[i, 0], nodes[i, 1], nodes[i, 2]))
        point = add(arm, pose[1])
        d, gx, gy, gz = probe(solid, point[0], point[1], point[2])
        normal = (gx, gy, gz)
        if d >= reach:
            _clear_node(bristles, forces, i)
            clear = nodes[i, PATH_LENGTH] + d - reach
            continue
        depth = -d - relief(solid, point[0], point[1], point[2])
        if depth <= 0.0:
            _clear_node(bristles, forces, i)
            continue
        velocity = add(motion[0], cross(motion[1], arm))
        pressed = pressure(skin, nodes[i, NODE_STIFFNESS], depth, dot(velocity, normal))
        if pressed <= 0.0:
            _clear_node(bristles, forces, i)
            continue
        node = (depth, nodes[i, NODE_STIFFNESS], pressed)
        bristle = (bristles[i, BX], bristles[i, BY], bristles[i, BZ], bristles[i, PLASTIC_SPEED])
        held, bristle = friction(
            solid, skin, bristle, pose[0], normal, tangential(velocity, normal), node, dt, keep
        )
        bristles[i, BX], bristles[i, BY], bristles[i, BZ], bristles[i, PLASTIC_SPEED] = bristle
        total = add(scaled(normal, pressed), held)
        forces[i, 0], forces[i, 1], forces[i, 2] = apply_transposed(pose[0], total)
        force, torque = add(force, total), add(torque, cross(point, total))
        load += pressed
        slip += pressed * bristle[PLASTIC_SPEED]
        slipping += pressed * (bristle[PLASTIC_SPEED] > skin[SLIPPING])
    weight = max(load, 1e-300)
    state.tips[tip, TIP_SLIP], state.tips[tip, TIP_SLIPPING_SHARE] = (
        slip / weight,
        slipping / weight,
    )
    state.tips[tip, TIP_LOAD] = load
    return force, torque


@compiled
def _unpacked_skin(a: Array) -> tuple[float, ...]:
    return a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8]


@compiled
def _clear_node(bristles: Array, forces: Array, i: int) -> None:
    """Clear the state of a node that touches nothing."""
    bristles[i, BX] = bristles[i, BY] = bristles[i, BZ] = bristles[i, PLASTIC_SPEED] = 0.0
    forces[i, 0] = forces[i, 1] = forces[i, 2] = 0.0
