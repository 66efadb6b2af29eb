"""A small world for tests of the contact: two or three rigid fingertips hold one free object."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from holdfast.sensors.types import Array
from holdfast.twin.contact import Constants, Contact, constants_of, new_contact
from holdfast.twin.objects import GraspObject, object_named, solid
from holdfast.twin.skin import COUPLED
from holdfast.twin.steps import probe, touch
from holdfast.twin.surface import Surface, curved_fingertip
from holdfast.twin.world import fingertip_of

GRAVITY = 9.81
SURFACE = fingertip_of(coupled=True)
"""The skin whose nodes are coupled."""
MIDDLE = 0.012  # distal coordinate of the pad's middle [m]


class Grip:
    """Fingertips in the plane z = height, each pressed into the object by a depth [m]."""

    def __init__(
        self,
        item: GraspObject,
        depth: float = 1.5e-3,
        dt: float = 1 / 1050,
        angles: tuple[float, ...] = (0.0, np.pi),
        surface: Surface | None = None,
    ) -> None:
        surface = surface or curved_fingertip()
        self.item, self.dt, self.time = item, dt, 0.0
        self.constants: Constants = constants_of(surface, item)
        self.state: Contact = new_contact(surface, len(angles))
        self.bodies: Array = np.zeros((len(angles) + 1, 18))
        self.bodies[-1, 3:12] = np.eye(3).ravel()
        for body, angle in zip(self.bodies, angles, strict=False):
            set_pose(body, surface, solid(replace(item, texture_amplitude=0.0)), angle, depth)

    @property
    def mass(self) -> float:
        return self.item.mass

    @property
    def object_body(self) -> Array:
        """Position, rotation, velocity and spin of the object, in place."""
        return self.bodies[-1]

    def step(self, force: npt.ArrayLike = (0.0, 0.0, 0.0), spin: bool = True) -> None:
        """One step with gravity and an outside force through the centre of mass [N]."""
        touch(self.state, self.constants, self.bodies, self.dt)
        push = self.state.wrench[:3] + np.asarray(force) - [0, 0, GRAVITY * self.mass]
        body = self.object_body
        body[12:15] += push / self.mass * self.dt
        if spin:
            body[15:18] += self._turning() * self.dt
        self._move()

    def _turning(self) -> Array:
        rotation = self.object_body[3:12].reshape(3, 3)
        inertia = rotation @ np.diag(self.item.inertia) @ rotation.T
        spin = self.object_body[15:18]
        return np.linalg.solve(inertia, self.state.wrench[3:] - np.cross(spin, inertia @ spin))

    def _move(self) -> None:
        for body in self.bodies:
            body[:3] += body[12:15] * self.dt
            if body[15:18].any():
                turn = Rotation.from_rotvec(body[15:18] * self.dt).as_matrix()
                body[3:12] = (turn @ body[3:12].reshape(3, 3)).ravel()
        self.time += self.dt

    def settle(self, seconds: float) -> None:
        for _ in range(round(seconds / self.dt)):
            self.step()


def set_pose(body: Array, surface: Surface, shape: Array, angle: float, depth: float) -> None:
    """Put a fingertip at an angle about the object's axis, its deepest node `depth` inside."""
    out = np.array([np.cos(angle), np.sin(angle), 0.0])
    rotation = np.stack([-out, np.cross([0.0, 0.0, 1.0], -out), [0.0, 0.0, 1.0]], axis=1)
    near, far = 0.0, 0.2
    for _ in range(60):
        middle = (near + far) / 2
        origin = out * middle - [0.0, 0.0, MIDDLE]
        points = surface.nodes @ rotation.T + origin
        deepest = min(probe(shape, *point)[0] for point in points)
        near, far = (middle, far) if deepest < -depth else (near, middle)
    body[:3], body[3:12] = origin, rotation.ravel()


def coupled_grip(name: str, depth: float = 2e-3, dt: float = 1 / 1050) -> Grip:
    item = object_named(name)
    grip = Grip(item, depth, dt, surface=SURFACE)
    grip.constants = constants_of(SURFACE, item, COUPLED)
    return grip
