"""Contact of soft fingertips with an object: its constants and its state.

`holdfast.twin.steps.touch` computes the forces, in c/contact.c.
"""

from typing import NamedTuple

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.objects import GraspObject, solid
from holdfast.twin.skin import Skin
from holdfast.twin.steps import N_BRISTLE, N_TIP, TIP_LOAD, TIP_SLIP, TIP_SLIPPING_SHARE
from holdfast.twin.surface import Surface


class Constants(NamedTuple):
    """Skin and object in a contact.

    Attributes:
        nodes: (n_nodes, 5) positions of the nodes in the fingertip frame [m], stiffness of
            each [N/m], and length of the path from the first node to it through all nodes
            between them [m].
        solid: the object, as `objects.solid` packs it.
        skin: (14,) the numbers of `Skin`, then centre and radius of a ball that contains all
            nodes [m].
        nearness: `nearness_of` the nodes if they are coupled, else (1, 1).
    """

    nodes: Array
    solid: Array
    skin: Array
    nearness: Array


class Contact(NamedTuple):
    """State of the contact and results of the last `touch`, which writes them in place.

    Attributes:
        bristles: (n_tips, n_nodes, 7) stretch of every node in the fingertip frame [m], its slip
            speed [m/s], and its force if it is coupled [N]. This is the whole state.
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
        return self.tips[:, :3]

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
        nearness_of(surface) if skin.shear_modulus else np.zeros((1, 1)),
    )


LATTICE_SELF = 3.9002649
"""Nearness of a node to itself, times the side of its element: with it, the sum of 1/r over all
points of a square lattice is the integral of 1/r, so that an even pressure gives exact depths."""


def nearness_of(surface: Surface) -> Array:
    """Return the inverse distances of all nodes from each other, (n_nodes, n_nodes) [1/m]."""
    apart = np.linalg.norm(surface.nodes[:, None] - surface.nodes, axis=2)
    np.fill_diagonal(apart, np.sqrt(surface.areas) / LATTICE_SELF)
    nearness: Array = 1 / apart
    return nearness
