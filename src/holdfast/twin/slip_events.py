"""Events that let a held object slide, other than pushes and moves of an operator.

Weight is added slowly, the grip relaxes, or friction falls: nothing touches the object but the
hand. Or a steady hand draws it over the fingers, turns it in the grip, or rolls it between them.
Every event is drawn beforehand. It ends when the object has slid a drawn distance, or after its
longest time. Then everything recovers.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from holdfast.sensors.types import Array
from holdfast.twin.grasp import GRASP_DIRECTION
from holdfast.twin.loads import LoadState
from holdfast.twin.objects import GraspObject
from holdfast.twin.operator import (
    NO_GUIDE,
    PUSH_DIRECTIONS,
    Disturbance,
    draw_disturbance,
)
from holdfast.twin.profile import Profile, SlipRanges, log_uniform
from holdfast.twin.steps import GUIDE_STIFFNESS

GRASP_LINE = np.array([math.cos(GRASP_DIRECTION), -math.sin(GRASP_DIRECTION), 0.0])
"""Unit vector in the world from thumb to fingers of the right hand."""
UPRIGHT = np.array([0.0, 0.0, 1.0])
"""Axis of the object in the world."""
SIDEWAYS = np.cross(UPRIGHT, GRASP_LINE)
"""Unit vector in the world across the grasp line and the axis of the object."""
RECLOSING_TIME = 0.2
"""Time in which a hand that guides the object closes on it, and opens again [s]."""
GUIDE_LEVER = 0.03
"""Half of the width over which that hand grips the object: it gives stiffness in rotation [m]."""
GUIDE_DAMPING_RATIO = 0.5
"""Damping ratio of that hand with the object's mass and inertia."""
MIN_GRIP_SCALE = 0.05
"""Smallest scale to which a grip relaxes: the fingers stay in contact."""
PULL_TIME = 1.5
"""Time in which a hand that pulls ever harder makes the object slide, as a rule [s]."""
MIN_SLIDE = 2e-4
"""Sliding distance from which a hand that has pulled ever harder goes on steadily [m]."""
SLIPPERY_TIME = 1.0
"""Time for which friction stays low if nothing slides [s]."""
MAX_TWIST = 0.4
"""Torque at which a person stops to twist [N m]."""
DISPLACED, TURNED = 0.002, 0.03
"""Distance [m] and angle [rad] from the pose at the lock beyond which a hand goes back to it."""


class SlipKind(StrEnum):
    """Kind of an event, which says what its rate and size mean.

    WEIGHT: mass is added at the rate [kg/s]. GRIP: the grip force falls at the rate, in shares of
    that at the lock [1/s]. FRICTION: friction falls at the rate [1/s] to the factor size. CREEP: a
    hand draws the object at the rate [m/s]; size is the direction [rad], 0 upwards. Kinetic
    friction is the static one then, because at such speeds the friction of rubber rises with
    speed. TWIST: a torque about the grasp line grows at the rate [N m/s]. TURN: a hand turns the
    object about the grasp line at the rate [rad/s]. ROLL: a hand turns it about its upright axis
    at the rate [rad/s] by the angle size [rad] and back, so that the fingertips roll on it.
    """

    WEIGHT = "weight"
    GRIP = "grip"
    FRICTION = "friction"
    CREEP = "creep"
    TWIST = "twist"
    TURN = "turn"
    ROLL = "roll"


N_KINDS = len(SlipKind)
"""Number of kinds."""
RATE_FIELDS = {
    SlipKind.WEIGHT: "weight_rate",
    SlipKind.GRIP: "grip_rate",
    SlipKind.FRICTION: "friction_rate",
    SlipKind.CREEP: "creep_speed",
    SlipKind.TWIST: "twist_rate",
    SlipKind.TURN: "turn_speed",
    SlipKind.ROLL: "roll_speed",
}
"""Field of `SlipRanges` from which the rate of each kind is drawn."""


class SlipEvent(NamedTuple):
    """One event.

    Attributes:
        kind: kind of the event.
        start: time after the lock [s].
        duration: longest time until everything recovers [s].
        distance: sliding distance after which everything recovers [m].
        rate: rate of the change, see `SlipKind`.
        size: size of the change, see `SlipKind`.
        sign: 1 or -1, sense of a torque or turn.
        recovery: time in which everything recovers [s].
        stiffness: stiffness of a hand that guides the object [N/m].
        pull_rate: rate at which its force rises until the object slides [N/s].
        tremor: rms of its tremor [m].
    """

    kind: SlipKind
    start: float
    duration: float
    distance: float
    rate: float
    size: float
    sign: float
    recovery: float
    stiffness: float
    pull_rate: float
    tremor: float

    @property
    def end(self) -> float:
        """Latest time after the lock at which everything has recovered [s]."""
        return self.start + self.duration + self.recovery


class SlipState(NamedTuple):
    """Loads on the object until the next sample.

    Attributes:
        load: added mass, torque, friction and guiding hand.
        grip_scale: factor of the grip force.
        touching: whether an operator touches the object.
    """

    load: LoadState
    grip_scale: float = 1.0
    touching: bool = False


NO_SLIP = SlipState(LoadState(np.zeros(3), np.zeros(3), 1.0))
"""State between events."""


def draw_course(
    generator: np.random.Generator, profile: Profile, ranges: SlipRanges, scale: float = 1.0
) -> tuple[list[Disturbance], list[SlipEvent]]:
    """Draw disturbances and slip events that fill the hold, with rests between them.

    All kinds of slip events come in turn, in random order, and so do the directions of pushes.

    Args:
        generator: random number generator.
        profile: profile with the ranges of disturbances.
        ranges: ranges of slip events.
        scale: factor of the depths of disturbances and of the distances of slips.
    """
    disturbances: list[Disturbance] = []
    events: list[SlipEvent] = []
    kinds: list[SlipKind] = []
    start = float(generator.uniform(1.0, 1.5))
    while True:
        drawn: Disturbance | SlipEvent
        if generator.random() < ranges.share:
            kinds = kinds or [list(SlipKind)[index] for index in generator.permutation(N_KINDS)]
            drawn = draw_slip_event(generator, ranges, kinds.pop(), start, scale)
            end = drawn.end
        else:
            direction = PUSH_DIRECTIONS[len(disturbances) % len(PUSH_DIRECTIONS)]
            drawn = draw_disturbance(generator, profile, start, direction, scale)
            end = drawn.start + drawn.duration
        if end + 1.0 > profile.hold:
            return disturbances, events
        if isinstance(drawn, SlipEvent):
            events.append(drawn)
        else:
            disturbances.append(drawn)
        start = end + float(generator.uniform(*profile.rest))


def draw_slip_event(
    generator: np.random.Generator,
    ranges: SlipRanges,
    kind: SlipKind,
    start: float,
    scale: float = 1.0,
) -> SlipEvent:
    """Draw one event.

    Args:
        generator: random number generator.
        ranges: ranges of its numbers.
        kind: kind of the event.
        start: time after the lock [s].
        scale: factor of the sliding distance.
    """
    # The order of the draws is part of the seed: every kind draws all numbers, used or not.
    rate = log_uniform(generator, getattr(ranges, RATE_FIELDS[kind]))
    spans = {
        SlipKind.FRICTION: ranges.friction_factor,
        SlipKind.CREEP: (0.0, 2 * math.pi),
        SlipKind.ROLL: ranges.roll_angle,
    }
    size = float(generator.uniform(*spans.get(kind, (0.0, 0.0))))
    event = SlipEvent(
        kind,
        start,
        duration=0.0,
        distance=scale * log_uniform(generator, ranges.distance),
        rate=rate,
        size=size,
        sign=float(generator.choice([-1.0, 1.0])),
        recovery=float(generator.uniform(*ranges.recovery)),
        stiffness=log_uniform(generator, ranges.hand_stiffness),
        pull_rate=log_uniform(generator, ranges.pull_rate),
        tremor=ranges.hand_tremor,
    )
    # The time after which an event has no further effect [s].
    durations = {
        SlipKind.WEIGHT: math.inf,
        SlipKind.GRIP: (1.0 - MIN_GRIP_SCALE) / rate,
        SlipKind.FRICTION: (1.0 - size) / rate + SLIPPERY_TIME,
        SlipKind.CREEP: PULL_TIME + event.distance / rate,
        SlipKind.TWIST: MAX_TWIST / rate,
        SlipKind.TURN: PULL_TIME + event.distance / (rate * GUIDE_LEVER),
        SlipKind.ROLL: RECLOSING_TIME + 2 * size / rate,
    }
    return event._replace(duration=min(durations[kind], ranges.longest))


class SlipEvents:
    """Events of one grasp, sample by sample.

    Args:
        events: events in order of time.
        item: the held object.
        period: period of the samples [s].

    Attributes:
        records: kind, start and end of each event that began, in time after the lock [s], and
            the distance that a fingertip slid in it [m].
    """

    def __init__(self, events: Sequence[SlipEvent], item: GraspObject, period: float) -> None:
        self._coming = list(reversed(events))  # the next one is the last, which pop() takes
        self._item, self._period = item, period
        self._locked_pose: Array | None = None  # of the first step
        # The event that acts, since when it recovers (in its own time), how far a fingertip slid
        # in it, its direction or axis, and the hand that guides the object.
        self._event: SlipEvent | None = None
        self._slid, self._ended_at = 0.0, math.inf
        self._axis, self._guide = np.zeros(3), NO_GUIDE.copy()
        self.records: list[dict[str, Any]] = []

    def step(self, held_for: float, slip: float, body: Array) -> SlipState:
        """Return what acts on the object until the next sample.

        Args:
            held_for: time since the lock [s].
            slip: largest slip speed of a fingertip in contact [m/s].
            body: (18,) position, rotation, velocity and spin of the object.
        """
        if self._locked_pose is None:
            self._locked_pose = body[:12].copy()
        event = self._event
        if event is not None and held_for >= event.start + self._ended_at + event.recovery:
            self._event = event = None
        if self._coming and held_for >= self._coming[-1].start:
            self._event = event = self._coming.pop()
            self._slid, self._ended_at = 0.0, math.inf
            self._axis = _axis(event, body, self._locked_pose)
            self._guide[:12], self._guide[12:] = body[:12], 0.0  # it grips the object where it is
            self.records.append({"kind": str(event.kind), "start": event.start})
        if event is None:
            return NO_SLIP
        elapsed = held_for - event.start
        self._slid += slip * self._period
        over = self._slid >= event.distance or elapsed >= event.duration
        if over and self._ended_at == math.inf:
            self._ended_at = elapsed
        self.records[-1].update(end=held_for + self._period, slid=self._slid)
        return self._state(event, elapsed)

    def _state(self, event: SlipEvent, elapsed: float) -> SlipState:
        """Return what acts: a change that grows until the event ends, and then goes away."""
        gone = min(max(elapsed - self._ended_at, 0.0) / event.recovery, 1.0)
        left = 0.5 + 0.5 * math.cos(math.pi * gone)
        change = event.rate * min(elapsed, self._ended_at)
        rest = NO_SLIP.load
        match event.kind:
            case SlipKind.WEIGHT:
                return SlipState(rest._replace(added_mass=left * change))
            case SlipKind.GRIP:
                return SlipState(rest, 1.0 - left * min(change, 1.0 - MIN_GRIP_SCALE))
            case SlipKind.FRICTION:
                factor = 1.0 - left * min(change, 1.0 - event.size)
                return SlipState(rest._replace(friction=factor))
            case SlipKind.TWIST:
                torque = left * change * self._axis
                return SlipState(rest._replace(torque=torque), touching=True)
        # The other kinds are a hand that guides the object.
        closed = left * min(elapsed / RECLOSING_TIME, 1.0)
        steady = closed if event.kind is SlipKind.CREEP else 0.0
        guide = self._guided(event, elapsed, closed)
        return SlipState(rest._replace(guide=guide, steady=steady), touching=True)

    def _guided(self, event: SlipEvent, elapsed: float, closed: float) -> Array:
        """Return the hand that guides the object, moved on by one sample."""
        guide = self._guide
        guide[:3] += self._period * guide[12:15]
        turn = Rotation.from_rotvec(self._period * guide[15:18]).as_matrix()
        guide[3:12] = (turn @ guide[3:12].reshape(3, 3)).ravel()
        guide[12:18] = 0.0
        motion = slice(12, 15) if event.kind is SlipKind.CREEP else slice(15, 18)
        # Speed [m/s] or spin [rad/s]: it pulls until the object slides.
        since_closed = elapsed - RECLOSING_TIME
        speed = event.rate
        if since_closed < 0 or self._ended_at < math.inf:
            speed = 0.0
        elif event.kind is SlipKind.ROLL:
            speed = event.rate if since_closed < event.size / event.rate else -event.rate
        elif self._slid < MIN_SLIDE:
            # Before the object slides, the force rises by the stiffness of the hand times its way.
            lever = GUIDE_LEVER if event.kind is SlipKind.TURN else 1.0
            speed = max(event.rate, event.pull_rate / (event.stiffness * lever))
        guide[motion] = speed * self._axis
        # Stiffness and damping of the hand, and both in rotation, by the inertia that is least.
        turning = event.stiffness * GUIDE_LEVER**2
        moments = [event.stiffness * self._item.mass, turning * float(self._item.inertia.min())]
        damping = 2 * GUIDE_DAMPING_RATIO * np.sqrt(moments)
        guide[GUIDE_STIFFNESS:-1] = closed * np.array(
            [event.stiffness, damping[0], turning, damping[1]]
        )
        guide[-1] = event.tremor
        return guide


def _axis(event: SlipEvent, body: Array, locked_pose: Array) -> Array:
    """Return the direction or axis of an event, (3,): towards the pose at the lock, if far."""
    if event.kind is SlipKind.CREEP:
        axis = math.cos(event.size) * UPRIGHT + math.sin(event.size) * SIDEWAYS
        away, limit = body[:3] - locked_pose[:3], DISPLACED
    else:
        axis = event.sign * (UPRIGHT if event.kind is SlipKind.ROLL else GRASP_LINE)
        turn = body[3:12].reshape(3, 3) @ locked_pose[3:12].reshape(3, 3).T
        away, limit = Rotation.from_matrix(turn).as_rotvec(), TURNED
    along = float(axis @ away)
    return -axis if along > limit else axis
