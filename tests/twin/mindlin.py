"""The contact of the twin against Hertz, Cattaneo and Mindlin.

A ball with the radius of a fingertip is pressed on a flat face and drawn along it, in slow steps,
first one way and then back. The nodes lie in a square lattice.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from holdfast.twin.contact import constants_of, new_contact
from holdfast.twin.objects import object_named
from holdfast.twin.steps import touch
from holdfast.twin.surface import Surface

RADIUS = 0.0135
"""Radius of the ball [m], as that of the fingertip."""
LOAD = 2.0
"""Normal load while the ball is drawn along [N]: the grip of `reference`."""
LOADS = (0.5, 1.0, 2.0, 4.0)
FRICTION = 0.6
SHARES = (0.25, 0.5, 0.75, 0.9)
"""Tangential force over friction times load, at which slips are compared."""
SHARES_BACK = (0.5, 0.0, -0.5, -0.8)
"""The same after it was turned back from the last of `SHARES`."""
POISSON = 0.5
STEP_TIME = 1.0
"""Time between two steps [s]: so long that neither damping nor falling friction acts."""
N_STEPS = 240
"""Steps from rest until all of the contact slides."""


def ball(pitch, placement):
    """Return the nodes of a ball about its pole x, on a lattice that is turned and shifted."""
    generator = np.random.default_rng(placement)
    turn, shift = generator.uniform(0, np.pi / 2), generator.uniform(-0.5, 0.5, 2)
    n = int(0.8 * RADIUS / pitch) + 1
    i, j = (part.ravel() for part in np.mgrid[-n : n + 1, -n : n + 1])
    u, v = pitch * (i + shift[0]), pitch * (j + shift[1])
    y, z = u * np.cos(turn) - v * np.sin(turn), u * np.sin(turn) + v * np.cos(turn)
    inside = np.hypot(y, z) < 0.8 * RADIUS
    y, z = y[inside], z[inside]
    x = np.sqrt(RADIUS**2 - y**2 - z**2)
    normals = np.stack([x, y, z], axis=1) / RADIUS
    return Surface(RADIUS * normals, normals, pitch**2 / normals[:, 0])


class Pressed:
    """A ball on a flat face, moved in slow steps.

    Attributes:
        depth: approach of ball and face [m].
        way: distance by which the ball was moved along the face [m].
    """

    def __init__(self, skin, pitch, placement):
        item = replace(
            object_named("box"), texture_amplitude=0.0, mu_static=FRICTION, mu_kinetic=FRICTION
        )
        self.surface = ball(pitch, placement)
        self.constants = constants_of(self.surface, item, skin)
        self.state = new_contact(self.surface, 1)
        self.bodies = np.zeros((2, 18))
        self.bodies[0, 3:12] = np.diag([-1.0, -1.0, 1.0]).ravel()
        self.bodies[1, 3:12] = np.eye(3).ravel()
        self.face = item.size[0]
        self.depth, self.way = 0.0, 0.0

    def move(self, depth, way, n_steps=1):
        """Go to a depth and a way in equal steps."""
        change = np.array([depth - self.depth, way - self.way]) / n_steps
        for _ in range(n_steps):
            self.depth, self.way = self.depth + change[0], self.way + change[1]
            self.bodies[0, :3] = self.face + RADIUS - self.depth, 0.0, self.way
            self.bodies[0, 12:15] = -change[0] / STEP_TIME, 0.0, change[1] / STEP_TIME
            touch(self.state, self.constants, self.bodies, STEP_TIME)

    def press(self, load):
        """Press until the load is reached, from below [N]."""
        low, high = self.depth, RADIUS / 2
        start = [part.copy() for part in self.state], self.depth
        for _ in range(24):
            for part, kept in zip(self.state, start[0], strict=True):
                part[:] = kept
            self.depth = start[1]
            middle = (low + high) / 2
            self.move(middle, self.way, 12)
            self.bodies[0, 12:15] = 0.0
            for _ in range(30):  # at rest
                touch(self.state, self.constants, self.bodies, STEP_TIME)
            low, high = (middle, high) if self.state.load[0] < load else (low, middle)
        return self.depth

    @property
    def normal(self):
        """Normal forces of the nodes [N]; x of the fingertip frame points into the face."""
        return -self.state.node_forces[0, :, 0]

    @property
    def drawn(self):
        """Tangential force over friction times load."""
        return -self.state.tip_force[0, 2] / (FRICTION * self.state.load[0])

    def radius(self, of):
        """Return the radius of a disk with the area of some nodes along the face [m]."""
        flat = self.surface.areas * self.surface.normals[:, 0]
        return np.sqrt(flat[of].sum() / np.pi)

    @property
    def sticking(self):
        """The nodes in contact whose friction is below the limit."""
        friction = np.linalg.norm(self.state.node_forces[0, :, 1:], axis=1)
        return (self.normal > 0) & (friction < 0.999 * FRICTION * self.normal)


class Result(NamedTuple):
    """Depths [m] at `LOADS`; at `LOAD` radius [m] and peak pressure [Pa]; slips.

    `slips` are (n, 3): tangential force over friction times load, stick radius [m], way [m].
    """

    depths: np.ndarray
    radius: float
    peak: float
    slips: np.ndarray
    back: np.ndarray


def measure(skin, pitch, placement):
    """Press, draw until `SHARES[-1]` of friction, draw back until the opposite."""
    pressed, depths = Pressed(skin, pitch, placement), []
    for load in LOADS:
        depths.append(pressed.press(load))
        if load == LOAD:
            radius = pressed.radius(pressed.normal > 0)
            peak = (pressed.normal / pressed.surface.areas).max()
            drawn = Pressed(skin, pitch, placement)
            drawn.press(load)
    step = 1.5 * FRICTION * depths[LOADS.index(LOAD)] / N_STEPS
    rows = {1: [], -1: []}
    for sign, enough in ((1, SHARES[-1]), (-1, SHARES[-1])):
        while sign * drawn.drawn < enough:
            drawn.move(drawn.depth, drawn.way + sign * step)
            rows[sign].append((drawn.drawn, drawn.radius(drawn.sticking), drawn.way))
    return Result(np.array(depths), radius, peak, np.array(rows[1]), np.array(rows[-1]))


class Theory(NamedTuple):
    """Hertz, Cattaneo and Mindlin for an elastic half-space with a modulus E / (1 - nu^2) [Pa]."""

    modulus: float

    def depth(self, load):
        return (9 * load**2 / (16 * RADIUS * self.modulus**2)) ** (1 / 3)

    @property
    def radius(self):
        return (3 * LOAD * RADIUS / (4 * self.modulus)) ** (1 / 3)

    @property
    def peak(self):
        return 1.5 * LOAD / (np.pi * self.radius**2)

    def way(self, share):
        """3 mu P (2 - nu) / (16 G a) (1 - (1 - Q / mu P)^(2/3)), with G = E* (1 - nu) / 2."""
        shear = self.modulus * (1 - POISSON) / 2
        unit = 3 * FRICTION * LOAD * (2 - POISSON) / (16 * shear * self.radius)
        return unit * (1 - (1 - share) ** (2 / 3))

    def back(self, share, turned):
        """Way after the force was turned (Mindlin and Deresiewicz)."""
        return self.way(turned) - 2 * self.way((turned - share) / 2)


def stuck(share):
    """Return the stick radius over the contact radius."""
    return (1 - share) ** (1 / 3)


def errors(result, theory):
    """Return errors by name, in percent of what theory says; of ways back, of the largest way.

    A stick radius is compared as its share of the contact radius, which has an error of its own.
    """
    found = {}
    for load, depth in zip(LOADS, result.depths, strict=True):
        found[f"indentation at {load:g} N"] = depth / theory.depth(load) - 1
    found["contact radius"] = result.radius / theory.radius - 1
    found["peak pressure"] = result.peak / theory.peak - 1
    drawn, stick, way = result.slips.T
    for share in SHARES:
        stick_share = np.interp(share, drawn, stick) / result.radius
        found[f"stick radius at {share:g}"] = stick_share / stuck(share) - 1
        found[f"displacement at {share:g}"] = np.interp(share, drawn, way) / theory.way(share) - 1
    turned = drawn[-1]
    drawn, stick, way = result.back[::-1].T
    for share in SHARES_BACK:
        stick_share = np.interp(share, drawn, stick) / result.radius
        found[f"back at {share:g}: stick radius"] = stick_share / stuck((turned - share) / 2) - 1
        difference = np.interp(share, drawn, way) - theory.back(share, turned)
        found[f"back at {share:g}: displacement"] = difference / theory.way(SHARES[-1])
    return {name: 100 * value for name, value in found.items()}
