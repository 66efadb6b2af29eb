"""Impacts: a tool knocks on the held object, a person taps it, something bumps into the arm.

They are short, and mostly move nothing: causes of disturbance that look like slips. Each is drawn
beforehand, in a rest between two disturbances. An impact is shorter than a few samples, so the
mean of its force over each sample acts: the momentum is exact.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.operator import ARM_SPREAD
from holdfast.twin.profile import ImpactRanges, log_uniform

REST_MARGIN = 0.3
"""Time between an impact and the disturbances before and after it [s]."""
RINGING_TIMES = 3.0
"""Time constants after which the arm no longer rings."""


class ImpactKind(StrEnum):
    """Kind of an impact, which says what its size means.

    KNOCK, TAP: a tool or a finger hits the object; momentum [N s]. BUMP: the arm is hit; the
    speed that the hand gets [m/s], after which it rings.
    """

    KNOCK = "knock"
    TAP = "tap"
    BUMP = "bump"


class Impact(NamedTuple):
    """One impact.

    Attributes:
        kind: kind of the impact.
        start: time after the lock [s].
        end: time after the lock from which nothing acts [s].
        rise: duration of the blow [s].
        size: size, see `ImpactKind`.
        direction: (3,) unit vector in the world.
        arm: (3,) point that is hit relative to the centre of mass [m].
        rate: rate at which the arm rings [Hz].
        decay: time constant with which it stops [s].
    """

    kind: ImpactKind
    start: float
    end: float
    rise: float
    size: float
    direction: Array
    arm: Array
    rate: float
    decay: float

    def momentum(self, elapsed: float) -> float:
        """Return the momentum that the object got until a time after the start [N s].

        Of a bump, the speed of the hand [m/s].
        """
        elapsed = max(elapsed, 0.0)
        got = self.size * (0.5 - 0.5 * math.cos(math.pi * min(elapsed / self.rise, 1.0)))
        if self.kind is not ImpactKind.BUMP:
            return got
        return got * math.exp(-elapsed / self.decay) * math.cos(2 * math.pi * self.rate * elapsed)


class ImpactState(NamedTuple):
    """Force, torque and acceleration until the next sample.

    Attributes:
        force: (3,) on the object in the world [N].
        torque: (3,) on it about its centre of mass [N m].
        acceleration: (3,) of the hand [m/s^2].
        kind: kind of the impact; "" for none.
    """

    force: Array
    torque: Array
    acceleration: Array
    kind: str = ""


NO_IMPACT = ImpactState(np.zeros(3), np.zeros(3), np.zeros(3))
"""State between impacts."""


def draw_impacts(
    generator: np.random.Generator, ranges: ImpactRanges, rests: Sequence[tuple[float, float]]
) -> list[Impact]:
    """Draw impacts: in each rest at most one.

    Args:
        generator: random number generator.
        ranges: ranges of all numbers.
        rests: begin and end of the rests, after the lock [s].
    """
    impacts = []
    for begin, end in rests:
        # The order of the draws is part of the seed: every kind draws all numbers, used or not.
        is_drawn = generator.random() < ranges.share
        kind = list(ImpactKind)[generator.integers(len(ImpactKind))]
        direction, arm = generator.normal(size=(2, 3))
        direction /= np.linalg.norm(direction)
        room = end - begin - 2 * REST_MARGIN
        start = begin + REST_MARGIN + room * float(generator.random())
        rises = {"knock": ranges.knock_time, "tap": ranges.tap_time, "bump": ranges.bump_time}
        sizes = {"knock": ranges.momentum, "tap": ranges.momentum, "bump": ranges.bump_speed}
        rise = log_uniform(generator, rises[kind])
        size = log_uniform(generator, sizes[kind])
        rate = float(generator.uniform(*ranges.ring_rate))
        decay = float(generator.uniform(*ranges.ring_decay))
        lasting = RINGING_TIMES * decay if kind is ImpactKind.BUMP else 0.0
        if is_drawn and room > 0:
            arm = ARM_SPREAD * (arm - direction * (arm @ direction))
            over = start + rise + lasting
            impacts.append(Impact(kind, start, over, rise, size, direction, arm, rate, decay))
    return impacts


def impact_state(impacts: Sequence[Impact], held_for: float, period: float) -> ImpactState:
    """Return what acts on average in the sample after a time since the lock [s].

    Example:
        >>> knock = Impact(ImpactKind.KNOCK, 1, 1.004, 0.004, 0.01, np.eye(3)[2], np.zeros(3), 0, 0)
        >>> float(impact_state([knock], 0.999, 0.005).force[2])  # 0.01 N s in 0.005 s
        2.0
    """
    for impact in impacts:
        if impact.start - period < held_for < impact.end:
            elapsed = held_for - impact.start
            got = impact.momentum(elapsed + period) - impact.momentum(elapsed)
            along = got / period * impact.direction
            if impact.kind is ImpactKind.BUMP:
                return NO_IMPACT._replace(acceleration=along, kind=str(impact.kind))
            return ImpactState(along, np.cross(impact.arm, along), np.zeros(3), str(impact.kind))
    return NO_IMPACT
