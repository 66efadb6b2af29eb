"""The operator: holds the object until it is locked, disturbs it, and takes it back.

There are two kinds of disturbances. A hand grips the object and moves it to and fro without losing
contact, as in the paper. Or a finger approaches from outside, pushes and leaves. Hand and finger
have finite stiffness and tremor, because a pure force would make every object fall at once.
operator.c computes the forces; this module draws the disturbances at random.
"""

from typing import NamedTuple

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.profile import Profile
from holdfast.twin.steps import MOVE, N_GUIDE

ARM_SPREAD = 0.006
"""Standard deviation of the position where the finger pushes, about the centre of mass [m]."""
TREMOR_BAND = (6.0, 11.0)
"""Frequencies of physiological tremor [Hz]."""
N_TREMORS = 8
"""Number of sinusoids in the tremor."""

DEPTH = 6
"""Index of the depth in the parameters of a disturbance."""
NO_GUIDE = np.zeros(N_GUIDE)
"""A guiding hand that does not touch the object."""

DIRECTIONS = {
    "down": (0.0, 0.0, -1.0),
    "up": (0.0, 0.0, 1.0),
    "left": (0.0, -1.0, 0.0),
    "right": (0.0, 1.0, 0.0),
}
"""Directions with a name, in the world; the other disturbances have a random direction."""
PUSH_DIRECTIONS = (*DIRECTIONS, "random", "random")
"""Directions of the disturbances of a grasp, in turn."""


class Disturbance(NamedTuple):
    """One disturbance.

    Attributes:
        start: time after the object was locked [s].
        duration: duration [s].
        direction: "down", "up", "left", "right" or "random".
        style: PUSH, JERK, SHAKE or MOVE.
        parameters: (9,) unit vector of the direction, point of contact relative to the centre
            of mass [m], depth [m], stiffness [N/m], rate of shaking or moving [Hz].
    """

    start: float
    duration: float
    direction: str
    style: int
    parameters: Array

    @property
    def end(self) -> float:
        """Time after the lock at which it is over [s]."""
        return self.start + self.duration

    def scaled(self, factor: float) -> "Disturbance":
        """Return the same disturbance with another depth."""
        parameters = self.parameters.copy()
        parameters[DEPTH] *= factor
        return self._replace(parameters=parameters)


def draw_disturbances(
    generator: np.random.Generator, profile: Profile, scale: float = 1.0
) -> list[Disturbance]:
    """Draw disturbances that fill the hold: all named directions and two random ones, in turn.

    Args:
        generator: random number generator.
        profile: profile with the ranges of all values.
        scale: factor of the depths.
    """
    disturbances: list[Disturbance] = []
    start = float(generator.uniform(1.0, 1.5))
    while True:
        name = PUSH_DIRECTIONS[len(disturbances) % len(PUSH_DIRECTIONS)]
        push = draw_disturbance(generator, profile, start, name, scale)
        if push.start + push.duration + 1.0 > profile.hold:
            return disturbances
        disturbances.append(push)
        start = push.start + push.duration + float(generator.uniform(*profile.rest))


def draw_tremor(generator: np.random.Generator) -> Array:
    """Draw amplitudes, angular rates [rad/s] and phases of a tremor of rms 1, (3, N_TREMORS, 3)."""
    tremor = np.empty((3, N_TREMORS, 3))
    weights = generator.uniform(0.5, 1.0, size=(3, N_TREMORS))
    tremor[:, :, 0] = weights * np.sqrt(2.0 / (weights**2).sum(axis=1, keepdims=True))
    tremor[:, :, 1] = 2 * np.pi * generator.uniform(*TREMOR_BAND, size=(3, N_TREMORS))
    tremor[:, :, 2] = generator.uniform(0.0, 2 * np.pi, size=(3, N_TREMORS))
    return tremor


def draw_disturbance(
    generator: np.random.Generator, profile: Profile, start: float, name: str, scale: float
) -> Disturbance:
    """Draw one disturbance.

    Args:
        generator: random number generator.
        profile: profile with the ranges of all values.
        start: time after the lock [s].
        name: direction, see `Disturbance`.
        scale: factor of the depth.
    """
    drawn = generator.normal(size=3)
    direction = np.array(DIRECTIONS.get(name, tuple(drawn / np.linalg.norm(drawn))))
    arm = generator.normal(0.0, ARM_SPREAD, size=3)
    arm -= direction * (arm @ direction)
    depth = scale * generator.uniform(*profile.push_depth)
    stiffness = generator.uniform(*profile.push_stiffness)
    rate = generator.uniform(*profile.shake_rate)
    duration = float(generator.uniform(*profile.push_duration))
    style = int(generator.integers(3))
    if profile.move_share > 0 and generator.random() < profile.move_share:
        style = MOVE
        depth = scale * generator.uniform(*profile.move_depth)
        stiffness = generator.uniform(*profile.move_stiffness)
        rate = generator.uniform(*profile.move_rate)
        duration = float(generator.uniform(*profile.move_duration))
    parameters = np.array([*direction, *arm, depth, stiffness, rate])
    return Disturbance(start, duration, name, style, parameters)
