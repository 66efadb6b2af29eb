"""What fingers and operator do, sample by sample: close until locked, hold, disturb, release.

A state machine without physics: it sees the load of every fingertip and where the object is,
and says where the fingers shall go and what the operator does.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from holdfast.contact import Phase
from holdfast.sensors.types import Array
from holdfast.twin.operator import Push
from holdfast.twin.profile import Profile

OPEN, CLOSED = 0.035, -0.025
"""Ends of the closing path: gap between a pad and the object as planned [m]."""
THUMB_SHARE = 0.6
"""The thumb stops at this share of what the three fingers press together: the rest comes when
they do."""
SETTLE = 0.3
"""So long all fingers have stopped before the object counts as locked [s]."""
PERSISTENCE = 0.05
"""So long a finger's load is over its grip before it has stopped: one spike is no grip [s]."""
PATIENCE = 8.0
"""A grasp that is not locked after so long of closing has failed [s]."""
HAND_OVER = 0.25
"""In which the operator lets go, or takes the object again [s]."""
OPENING_SPEED = 0.05
"""Of the fingertips when they release [m/s]."""
LOST_DISTANCE = 0.04
"""The object is lost when it has moved so far since it was locked [m]."""
LOST_SECONDS = 0.1
"""... or when fewer than two fingertips have touched it for so long [s]."""
TOUCH = 0.05
"""Load from which on a fingertip touches [N]."""
SLIDING = 0.001
"""Slip speed of a fingertip from which on the object slips in a disturbance [m/s]."""


class Plan(NamedTuple):
    """What was drawn for a grasp before it began.

    Attributes:
        profile: that it was drawn from.
        grips: (4,) load at which each finger stops: thumb, index, middle, ring [N].
        speed: of closing [m/s].
        before: how long the hand is open before [s].
        after: how long it is watched after the release [s].
        pushes: disturbances, in order of time since the lock.
    """

    profile: Profile
    grips: Array
    speed: float
    before: float
    after: float
    pushes: Sequence[Push]


class Command(NamedTuple):
    """What fingers and operator do until the next sample.

    Attributes:
        depths: (4,) where each fingertip shall be on its closing path [m].
        hold: from 0 (the operator has let go) to 1.
        push: place of the disturbance under way in the plan; -1 for none.
        elapsed: since it began [s].
        phase: what the experiment is doing; a push counts from its planned start to its end.
    """

    depths: Array
    hold: float
    push: int
    elapsed: float
    phase: Phase


class Protocol:
    """The state machine of one grasp.

    Args:
        plan: of the grasp.
        period: of its steps [s].

    Attributes:
        locked_at: when the object was locked [s]; None while it is not.
        lost_at: when it was lost [s]; None while it is not.
        anchor: (12,) position and rotation where the operator wants the object.
    """

    def __init__(self, plan: Plan, period: float) -> None:
        self.plan = plan
        self.locked_at: float | None = None
        self.lost_at: float | None = None
        self.anchor = np.zeros(12)
        self._period = period
        self._depths = np.full(4, OPEN)
        self._over = np.zeros(4)
        self._stopped = np.zeros(4, dtype=np.bool_)
        self._all_stopped_at = np.inf
        self._released_at = np.inf
        self._alone = 0.0
        self._locked_place = np.zeros(3)

    @property
    def failed(self) -> bool:
        """Whether the object was never locked, or lost."""
        return self.locked_at is None or self.lost_at is not None

    def over(self, time: float) -> bool:
        """Whether everything has been done."""
        return time > self._released_at + self.plan.after

    def command(self, time: float, loads: Array, slip: float, thing: Array) -> Command:
        """What to do next.

        Args:
            time: of this sample [s].
            loads: (4,) of the fingertips [N].
            slip: largest slip speed of a fingertip that touches [m/s].
            thing: (18,) the object's position, rotation, velocity and spin.
        """
        if time == 0.0:
            self.anchor[:] = thing[:12]
        if time >= self._released_at:
            return self._release(time, loads)
        if self.locked_at is not None:
            return self._hold(time, loads, slip, thing)
        if time < self.plan.before:
            return self._say(1.0, Phase.FREE)
        return self._close(time, loads, thing)

    def _close(self, time: float, loads: Array, thing: Array) -> Command:
        gripping = loads >= self.plan.grips  # such a finger waits, and goes on if that was a spike
        self._over = np.where(gripping, self._over + self._period, 0.0)
        self._stopped |= (self._over > PERSISTENCE) | (self._depths <= CLOSED)
        self._depths[~self._stopped & ~gripping] -= self.plan.speed * self._period
        if self._stopped.all() and time < self._all_stopped_at:
            self._all_stopped_at = min(self._all_stopped_at, time)
        if self._released_at < np.inf:  # given up
            return self._say(1.0, Phase.CLOSING)
        gripped = (loads > TOUCH).all()
        if gripped and time - self._all_stopped_at >= SETTLE:
            self.locked_at = time
            self._locked_place = thing[:3].copy()
        elif time - self.plan.before > PATIENCE:
            self._released_at = time + HAND_OVER
        return self._say(1.0, Phase.CLOSING)

    def _hold(self, time: float, loads: Array, slip: float, thing: Array) -> Command:
        held_for = time - float(self.locked_at or 0.0)
        if self.lost_at is None and self._is_lost(loads, thing):
            self.lost_at = time
        if held_for >= self.plan.profile.hold and self._released_at == np.inf:
            self._released_at = time + HAND_OVER
            self.anchor[:] = thing[:12]
        if self.lost_at is not None:
            return self._say(0.0, Phase.FREE)
        push, elapsed = self._pushing(held_for)
        phase = Phase.LOCKED
        if push >= 0:
            phase = Phase.SLIPPING if slip > SLIDING else Phase.DISTURBED
        letting_go = 1.0 - held_for / HAND_OVER
        taking = 1.0 - (self._released_at - time) / HAND_OVER
        return self._say(max(0.0, letting_go, taking), phase, push, elapsed)

    def _release(self, time: float, loads: Array) -> Command:
        self._depths = np.minimum(self._depths + OPENING_SPEED * self._period, OPEN)
        phase = Phase.RELEASED if (loads > TOUCH).any() else Phase.FREE
        return self._say(1.0 if self.lost_at is None else 0.0, phase)

    def _is_lost(self, loads: Array, thing: Array) -> bool:
        self._alone = self._alone + self._period if (loads > TOUCH).sum() < 2 else 0.0
        moved = float(np.linalg.norm(thing[:3] - self._locked_place))
        return moved > LOST_DISTANCE or self._alone >= LOST_SECONDS

    def _pushing(self, held_for: float) -> tuple[int, float]:
        for place, push in enumerate(self.plan.pushes):
            if push.start <= held_for < push.start + push.duration:
                return place, held_for - push.start
        return -1, 0.0

    def _say(self, hold: float, phase: Phase, push: int = -1, elapsed: float = 0.0) -> Command:
        return Command(self._depths, hold, push, elapsed, phase)
