"""Loads on a held object: weight, pulls, dropping friction, shakes, ways and turns of the hand."""

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.hand import GRAVITY
from holdfast.twin.operator import NO_GUIDE
from holdfast.twin.profile import ArmRanges

NO_TORQUE = np.zeros(3)
"""Torque of loads that do not turn the object [N m]."""
RISE_TIME = 0.2
"""Time in which a weight is added, or friction falls [s]."""
TURN_SHARE = 1 / 3
"""Share of the motions of the arm that are turns; the others are lifts and ways."""


class LoadKind(StrEnum):
    """Kind of a load, which says what its size means.

    WEIGHT: added mass [kg]; it stays. PULL: largest force [N] of a pull that swells and fades.
    FRICTION: factor of the friction; it stays. SHAKE: amplitude of the hand's acceleration
    [m/s^2], at the rate. TRANSPORT: largest acceleration [m/s^2] of the hand, which moves once
    and stops. TURN: largest angle [rad] by which the hand turns gravity about the direction, and
    back.
    """

    WEIGHT = "weight"
    PULL = "pull"
    FRICTION = "friction"
    SHAKE = "shake"
    TRANSPORT = "transport"
    TURN = "turn"


class Load(NamedTuple):
    """One load.

    Attributes:
        kind: kind of the load.
        start: time after the lock [s].
        duration: duration [s]; weight and friction stay.
        size: size, see `LoadKind`.
        direction: unit vector in the world, of a pull, shake or transport, or axis of a turn.
        rate: rate of a shake [Hz].
    """

    kind: LoadKind
    start: float
    duration: float
    size: float
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    rate: float = 0.0

    @property
    def end(self) -> float:
        """Time after the lock at which it is over, unless it stays [s]."""
        return self.start + self.duration


class LoadState(NamedTuple):
    """Sum of all loads at one instant.

    Attributes:
        force: (3,) force on the object in the world [N].
        acceleration: (3,) acceleration of the hand [m/s^2].
        friction: factor of the friction.
        torque: (3,) torque on the object about its centre of mass, in the world [N m].
        guide: (N_GUIDE,) hand that guides the object, see `guide_wrench`.
        added_mass: mass that was added to the object, with its inertia [kg].
        steady: how far kinetic friction is raised to static friction, from 0 to 1: then the
            object creeps steadily, and does not stick and slip.
    """

    force: Array
    acceleration: Array
    friction: float
    torque: Array = NO_TORQUE
    guide: Array = NO_GUIDE
    added_mass: float = 0.0
    steady: float = 0.0


def load_state(loads: Sequence[Load], held_for: float) -> LoadState:
    """Return the sum of loads at a time after the lock [s].

    Example:
        >>> weight = Load(LoadKind.WEIGHT, start=1.0, duration=0.0, size=0.1)
        >>> load_state([weight], 2.0).force.tolist()
        [0.0, 0.0, -0.9810000000000001]
    """
    force, acceleration, friction = np.zeros(3), np.zeros(3), 1.0
    for load in loads:
        elapsed = held_for - load.start
        if elapsed < 0:
            continue
        along = np.array(load.direction)
        # How much of a load that stays acts: without the rise it would be a blow.
        risen = 0.5 - 0.5 * np.cos(np.pi * min(elapsed / RISE_TIME, 1.0))
        if load.kind is LoadKind.WEIGHT:
            force += [0.0, 0.0, -GRAVITY * load.size * float(risen)]
        elif load.kind is LoadKind.FRICTION:
            friction *= 1.0 - (1.0 - load.size) * float(risen)
        elif elapsed < load.duration and load.kind is LoadKind.PULL:
            force += load.size * np.sin(np.pi * elapsed / load.duration) ** 2 * along
        elif elapsed < load.duration and load.kind is LoadKind.SHAKE:
            # A shake swells over a quarter of its time, and fades over the last one.
            swell = min(1.0, 4 * min(elapsed, load.duration - elapsed) / load.duration)
            acceleration += load.size * swell * np.sin(2 * np.pi * load.rate * elapsed) * along
        elif elapsed < load.duration and load.kind is LoadKind.TURN:
            # The hand stays where it is: gravity -g z turns by -angle about the axis u (Rodrigues).
            angle = load.size * np.sin(np.pi * elapsed / load.duration) ** 2
            up = np.array([0.0, 0.0, 1.0])
            turned = np.cos(angle) * up - np.sin(angle) * np.cross(along, up)
            turned += (1 - np.cos(angle)) * (along @ up) * along
            acceleration += GRAVITY * (turned - up)
        elif elapsed < load.duration:  # transport: one period, so that the hand is at rest again
            acceleration += load.size * np.sin(2 * np.pi * elapsed / load.duration) * along
    return LoadState(force, acceleration, friction)


def draw_arm_motions(
    generator: np.random.Generator, ranges: ArmRanges, rests: Sequence[tuple[float, float]]
) -> list[Load]:
    """Draw motions of the arm: in each rest at most one lift, way or turn, in any direction.

    Args:
        generator: random number generator.
        ranges: ranges of all numbers.
        rests: begin and end of the rests, after the lock [s].
    """
    motions = []
    for begin, end in rests:
        is_drawn = generator.random() < ranges.share
        kind = LoadKind.TURN if generator.random() < TURN_SHARE else LoadKind.TRANSPORT
        direction = generator.normal(size=3)
        if kind is LoadKind.TURN:  # about a level axis: a turn about the upright changes nothing
            direction[2] = 0.0
        direction /= np.linalg.norm(direction)
        duration = min(float(generator.uniform(*ranges.duration)), end - begin)
        span = ranges.angle if kind is LoadKind.TURN else ranges.acceleration
        size = float(generator.uniform(*span))
        start = begin + (end - begin - duration) * float(generator.random())
        if is_drawn:
            motions.append(Load(kind, start, duration, size, tuple(direction.tolist())))
    return motions
