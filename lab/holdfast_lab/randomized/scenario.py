"""What happens while an object is held: the arm moves, a person disturbs, something slips.

Every event is a value that was drawn beforehand. Some only move the arm or change the grip
slowly: nothing slides, and the contact is stable. Others provoke a slip, and end once the object
has slid far enough.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from holdfast.sensors.types import Array
from holdfast.twin.operator import Disturbance
from holdfast.twin.profile import Span
from holdfast.twin.steps import HOLD_STIFFNESS, MOVE, disturb_wrench, hold_wrench
from holdfast_lab.randomized.gripper import OperatorForce
from holdfast_lab.randomized.palm import PALM_KINDS, Segment, draw_segment, log_uniform, uniform

OPERATOR_KINDS = ("move", "push", "pull", "twist", "drag", "spin", "weight")
"""A person acts on the object: moves it to and fro, pushes it with a finger, pulls or twists it
with a growing force or torque, drags or spins it through the fingers at a steady speed, or puts
something into it."""
GRIP_KINDS = ("regrip", "loosen", "slippery")
"""The grip changes slowly, or falls until the object slides; or friction falls."""
EVENT_KINDS = (*PALM_KINDS, *PALM_KINDS, *OPERATOR_KINDS, *GRIP_KINDS, "drag", "spin", "loosen")
"""Events, as often as they are drawn."""
LONGEST_EVENT = 3.0
"""An event that does not end by itself ends after this [s]."""
RELEASE_TIME = 0.06
"""A force or torque that has made the object slide goes away in this time [s]."""
RECOVERY_TIME = 0.08
"""A grip that was loosened, or a friction that fell, comes back in this time [s]."""
WEIGHT_SETTLE_TIME = 0.5
"""Time after a weight was added in which the operator still counts as acting [s]."""
HAND_TIME = 0.15
"""Time in which a hand that drags or spins the object closes on it, and opens again [s]."""
MAX_PULL, MAX_TWIST = 15.0, 0.4
"""Largest force [N] and torque [N m] of a person."""


class Event(NamedTuple):
    """One event of a hold.

    Attributes:
        kind: one of `EVENT_KINDS`.
        start: since the lock [s].
        duration: after which it is over [s]; a provoked slip may end it before.
        size: of the change: share of the grip, factor of friction, share of weight.
        rate: at which a force [N/s], a torque [N m/s] or the share of a grip [1/s] changes; or
            the time of the change [s].
        until: distance [m] or angle [rad] by which the object slides before the event ends.
        direction: (3,) unit vector of a force, or axis of a torque, in the palm frame.
        arm: (3,) where a force acts, relative to the centre of mass [m].
        push: of the operator, for `move` and `push`.
        segment: of the arm.
    """

    kind: str
    start: float
    duration: float
    size: float = 0.0
    rate: float = 0.0
    until: float = math.inf
    direction: Array = np.zeros(3)
    arm: Array = np.zeros(3)
    push: Disturbance | None = None
    segment: Segment | None = None


def draw_events(
    generator: np.random.Generator, ranges: dict[str, Span], arm: dict[str, Span], hold: float
) -> list[Event]:
    """Draw events that fill a hold, with rests between them.

    Args:
        generator: of all that is drawn.
        ranges: of events.
        arm: ranges of the arm's motions.
        hold: duration [s].
    """
    events: list[Event] = []
    start = float(generator.uniform(0.6, 1.5))
    while True:
        event = _draw_event(generator, ranges, arm, start)
        if event.start + event.duration + 0.6 > hold:
            return events
        events.append(event)
        start = event.start + event.duration + float(generator.uniform(*ranges["rest"]))


def _draw_event(
    generator: np.random.Generator, ranges: dict[str, Span], arm: dict[str, Span], start: float
) -> Event:
    kind = str(generator.choice(EVENT_KINDS))
    if kind in PALM_KINDS:
        segment = draw_segment(generator, arm, kind, start)
        return Event(kind, start, segment.duration, segment=segment)
    direction = generator.standard_normal(3)
    direction[0] *= 0.5  # mostly across the closing line
    direction /= np.linalg.norm(direction)
    if kind in GRIP_KINDS:
        return _draw_grip_change(generator, ranges, kind, start)
    if kind in ("move", "push"):
        push = _draw_push(generator, kind, start, direction)
        return Event(kind, start, push.duration, push=push, direction=direction)
    if kind in ("drag", "spin"):
        return _draw_drag(generator, ranges, kind, start, direction)
    if kind == "weight":
        duration = uniform(generator, ranges["weight_time"]) + WEIGHT_SETTLE_TIME
        return Event(kind, start, duration, uniform(generator, ranges["weight_share"]))
    return _draw_pull(generator, ranges, kind, start, direction)


def _draw_grip_change(
    generator: np.random.Generator, ranges: dict[str, Span], kind: str, start: float
) -> Event:
    distance = uniform(generator, ranges["slip_distance"])
    if kind == "regrip":
        duration = uniform(generator, ranges["regrip_time"])
        return Event(kind, start, duration, uniform(generator, ranges["regrip_share"]))
    if kind == "loosen":
        rate = log_uniform(generator, ranges["loosen_rate"])
        return Event(kind, start, LONGEST_EVENT, rate=rate, until=distance)
    factor, fall = (
        uniform(generator, ranges["slippery"]),
        uniform(generator, ranges["slippery_time"]),
    )
    return Event(kind, start, LONGEST_EVENT / 2, factor, fall, distance)


def _draw_drag(
    generator: np.random.Generator,
    ranges: dict[str, Span],
    kind: str,
    start: float,
    direction: Array,
) -> Event:
    """Draw a hand that drags the object across the pads, or spins it about their line."""
    speed = log_uniform(generator, ranges[f"{kind}_speed"])
    way = uniform(generator, ranges[f"{kind}_way"])
    direction[0] *= 0.3 if kind == "drag" else 4.0
    direction /= np.linalg.norm(direction)
    duration = min(way / speed, LONGEST_EVENT) + 2 * HAND_TIME
    stiffness = uniform(generator, ranges["hand_stiffness"])
    return Event(kind, start, duration, stiffness, speed, direction=direction)


def _draw_pull(
    generator: np.random.Generator,
    ranges: dict[str, Span],
    kind: str,
    start: float,
    direction: Array,
) -> Event:
    """Draw a force, or a torque about the line of the pads, that grows until the object slides."""
    if kind == "twist":
        rate = log_uniform(generator, ranges["twist_rate"])
        axis = np.array([1.0, 0.0, 0.0]) + 0.15 * generator.standard_normal(3)
        axis *= generator.choice([-1.0, 1.0]) / np.linalg.norm(axis)
        angle = uniform(generator, ranges["slip_angle"])
        return Event(kind, start, min(MAX_TWIST / rate, LONGEST_EVENT), 0.0, rate, angle, axis)
    rate = log_uniform(generator, ranges["pull_rate"])
    arm = generator.standard_normal(3)
    arm *= uniform(generator, ranges["pull_arm"]) / np.linalg.norm(arm)
    distance = uniform(generator, ranges["slip_distance"])
    longest = min(MAX_PULL / rate, LONGEST_EVENT)
    return Event(kind, start, longest, 0.0, rate, distance, direction, arm)


def _draw_push(
    generator: np.random.Generator, kind: str, start: float, direction: Array
) -> Disturbance:
    """Draw a disturbance as of the profile `reference`, half of them smaller or larger."""
    scale = float(math.exp(0.4 * generator.standard_normal()))
    arm = generator.normal(0.0, 0.006, size=3)
    arm -= direction * (arm @ direction)
    style = MOVE if kind == "move" else int(generator.integers(3))
    if style == MOVE:
        depth, stiffness = generator.uniform(0.004, 0.012), generator.uniform(250.0, 600.0)
        rate, duration = generator.uniform(0.5, 2.0), float(generator.uniform(1.0, 2.4))
    else:
        depth, stiffness = generator.uniform(0.003, 0.010), generator.uniform(400.0, 1000.0)
        rate, duration = generator.uniform(3.0, 6.0), float(generator.uniform(0.4, 1.2))
    numbers = np.array([*direction, *arm, scale * depth, stiffness, rate])
    return Disturbance(start, duration, "random", style, numbers)


class Scenario(OperatorForce):
    """Runs the events of a hold: travels of the pads, friction, and the operator's force.

    Args:
        events: in order of time.
        tremors: (2, 3, n, 3) of the operator's hands.
        tremor: rms of the tremor [m].
        spare: force that friction can still hold at the lock [N], for added weight.

    Attributes:
        grip_scale: by which the grip's travel beyond touch is scaled.
        friction_scale: factor on the friction.
        acting: whether the operator acts on the object by other than a constant weight.
    """

    def __init__(self, events: list[Event], tremors: Array, tremor: float) -> None:
        self._events = events
        self._tremors, self._tremor = tremors, tremor
        self._index = -1  # index of the present event, or of the one that is awaited
        # Of the present event: how far the object slid [m] and turned [rad] while it slid, when it
        # ended [s] (its effects go away after that), and the object when it began.
        self._slid = self._turned = 0.0
        self._ended_at = math.inf
        self._origin = np.zeros(12)
        # Added weight [N] and a changed grip stay until the end of the hold.
        self._weight = np.zeros(3)
        self._base_grip = 1.0
        self._now = 0.0  # of the last `step`, since the lock [s]
        self.spare = 0.0
        self.grip_scale = self.friction_scale = 1.0
        self.acting = False

    def step(self, since: float, slip: float, spin: Array, body: Array, period: float) -> None:
        """Take the state of a sample, and decide what happens until the next.

        Args:
            since: time since the lock [s].
            slip: largest slip speed [m/s].
            spin: (3,) angular velocity of the object [rad/s].
            body: (18,) the object.
            period: of the samples [s].
        """
        self._now = since
        event = self.event
        if event is None or since >= event.start + event.duration + RECOVERY_TIME:
            # Begin the next event, if it is time; added weight and a changed grip stay.
            coming = self._events[self._index + 1 : self._index + 2]
            if not coming or coming[0].start <= since:
                self.friction_scale = 1.0
            if coming and coming[0].start <= since:
                self._index += 1
                self._slid = self._turned = 0.0
                self._ended_at = math.inf
                self._origin[:] = body[:12]
            event = self.event
        if event is None or since < event.start:
            self.acting = False
            return
        self._slid += slip * period if slip > 0.001 else 0.0
        self._turned += abs(float(spin @ event.direction)) * period if slip > 0.001 else 0.0
        slid = self._turned if event.kind == "twist" else self._slid
        # A provoked slip ends the event at the distance that was drawn, else its time does.
        over = slid >= event.until or since >= event.start + event.duration
        if over and self._ended_at == math.inf:
            self._ended_at = since
        elapsed = since - event.start
        if event.kind == "regrip":
            share = min(elapsed / event.duration, 1.0)
            self.grip_scale = self._base_grip * (1 + event.size * share)
            if share == 1.0:
                self._base_grip = self.grip_scale
        elif event.kind == "loosen":
            end = min(since, self._ended_at) - event.start
            # Down to a little less than touch, so that the object slides in the end; then back, to
            # a tenth more than before.
            low = max(1.0 - event.rate * end, -0.1)
            back = min(max(since - self._ended_at, 0.0) / RECOVERY_TIME, 1.0)
            self.grip_scale = self._base_grip * (low + (1.1 - low) * back)
            if back == 1.0:
                self._base_grip = self.grip_scale
        elif event.kind == "slippery":
            fallen = min(elapsed / event.rate, 1.0)
            back = min(max(since - self._ended_at, 0.0) / RECOVERY_TIME, 1.0)
            self.friction_scale = 1.0 - (1.0 - event.size) * fallen * (1.0 - back)
        # A weight that was put in is load, not a disturbance, once it has settled.
        self.acting = event.kind in OPERATOR_KINDS and (
            event.kind != "weight" or since < event.start + event.duration
        )

    @property
    def event(self) -> Event | None:
        """The present or the next event."""
        return self._events[self._index] if 0 <= self._index < len(self._events) else None

    def fill(self, body: Array, out: Array, ahead: float) -> None:
        """Fill the operator's force and torque: see `OperatorForce`."""
        out[:] = 0.0
        out[:3] += self._weight
        event = self.event
        if event is None or not self.acting:
            return
        elapsed = self._now + ahead - event.start
        if event.push is not None:
            if elapsed < event.push.duration:
                out += disturb_wrench(
                    body, self._origin, event.push.parameters, event.push.style,
                    event.push.duration, self._tremors[1], self._tremor, elapsed,
                )  # fmt: skip
        elif event.kind in ("drag", "spin"):
            # Force of a hand that grips the object and takes it along at a steady speed.
            closed = min(elapsed, event.duration - elapsed) / HAND_TIME
            gain = min(max(closed, 0.0), 1.0) * event.size / HOLD_STIFFNESS
            way = event.rate * min(max(elapsed - HAND_TIME, 0.0), event.duration - 2 * HAND_TIME)
            anchor = self._origin.copy()
            if event.kind == "drag":
                anchor[:3] += way * event.direction
            else:
                turn = Rotation.from_rotvec(way * event.direction).as_matrix()
                anchor[3:12] = (turn @ anchor[3:12].reshape(3, 3)).ravel()
            held = hold_wrench(body, anchor, gain, 0.0, self._tremors[1], self._tremor, elapsed)
            out += np.array(held)
        elif event.kind == "weight":
            share = min(elapsed / (event.duration - WEIGHT_SETTLE_TIME), 1.0)
            self._weight = event.size * self.spare * share * self._down
        else:
            force = event.rate * (min(self._now + ahead, self._ended_at) - event.start)
            force *= max(1.0 - max(self._now + ahead - self._ended_at, 0.0) / RELEASE_TIME, 0.0)
            if event.kind == "twist":
                out[3:] += force * event.direction
            else:
                out[:3] += force * event.direction
                out[3:] += force * np.cross(event.arm, event.direction)

    _down = np.array([0.0, 0.0, -1.0])

    def set_down(self, gravity: Array) -> None:
        """Take the direction of gravity in the palm frame, for added weight."""
        self._down = gravity / max(float(np.linalg.norm(gravity)), 1e-9)
        self._weight = float(np.linalg.norm(self._weight)) * self._down
