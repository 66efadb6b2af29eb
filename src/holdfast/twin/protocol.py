"""Course of a grasp, sample by sample: close until locked, hold, disturb, release.

This is a state machine without physics. Its inputs are the loads of the fingertips and the pose
of the object. Its outputs are set-points of the fingers and actions of the operator.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from holdfast.contact import Phase
from holdfast.sensors.types import Array, Flags
from holdfast.twin.impacts import Impact
from holdfast.twin.loads import Load
from holdfast.twin.operator import Disturbance
from holdfast.twin.profile import Profile
from holdfast.twin.slip_events import SlipEvent

OPEN_GAP, CLOSED_GAP = 0.035, -0.025
"""Planned gap between a pad and the object at both ends of the closing path [m]."""
THUMB_SHARE = 0.6
"""Load at which the thumb stops, as a share of the load of all three fingers. The rest comes when
the fingers press."""
SETTLE_TIME = 0.3
"""Time for which all fingers have stopped before the object counts as locked [s]."""
GRIP_CONFIRM_TIME = 0.05
"""Time that a finger's load exceeds its grip before it stops; shorter spikes are ignored [s]."""
CLOSING_TIMEOUT = 8.0
"""Time of closing after which a grasp that is not locked has failed [s]."""
HAND_OVER_TIME = 0.25
"""Time in which the operator releases the object, or takes it again [s]."""
OPENING_SPEED = 0.05
"""Speed of the fingertips when they release [m/s]."""
LOST_DISTANCE = 0.04
"""Distance from its position at the lock beyond which the object is lost [m]."""
LOST_CONTACT_TIME = 0.1
"""Time of contact with fewer than two fingertips after which the object is lost [s]."""
MIN_TOUCH_LOAD = 0.05
"""Minimum load of a fingertip in contact [N]."""
EASED, FIRMER = 0.6, 1.15
"""Factors of the size of what made a finger slide, and of a grip in which one slides by itself,
when the grasp is made again."""
EASED_TIME = 0.35
"""Time after an action in which a slip still counts as made by it [s]: so long do labels close
pauses."""
SLIPPING_SPEED = 0.001
"""Minimum slip speed of a fingertip at which the object slips in a disturbance [m/s]."""


class Plan(NamedTuple):
    """Random numbers of a grasp, drawn before it begins.

    Attributes:
        profile: profile from which they were drawn.
        grips: (4,) load at which each finger stops: thumb, index, middle, ring [N]; 0 for a
            finger that stays open.
        speed: speed of closing [m/s].
        before: time with an open hand before the grasp [s].
        after: time after the release until the end [s].
        disturbances: disturbances in order of time.
        slip_events: events that let the object slide, in order of time.
        impacts: impacts in order of time.
        loads: loads on the object, such as motions of the arm.
        glitch_size: factor of the errors of set-points in glitches of the controller.
    """

    profile: Profile
    grips: Array
    speed: float
    before: float
    after: float
    disturbances: Sequence[Disturbance]
    slip_events: Sequence[SlipEvent] = ()
    impacts: Sequence[Impact] = ()
    loads: Sequence[Load] = ()
    glitch_size: float = 1.0

    def eased(self, onsets: Array, glitched: Flags, *, firmer: bool = False) -> "Plan":
        """Return the plan of the same grasp after some slips, made more gently.

        What acted at the onset of a slip, or within `EASED_TIME` before, has `EASED` of its size,
        and so have all glitches after one of them. The grip is firmer by `FIRMER` where nothing
        acted, and on demand.

        Args:
            onsets: (n,) of the slips, after the lock [s].
            glitched: (n,) whether a glitch of the controller acted then.
            firmer: whether the grip is firmer in any case.
        """
        actions: list[Disturbance | Impact | Load]
        actions = [*self.disturbances, *self.impacts, *self.loads]
        spans = [(action.start, action.end) for action in actions]
        starts, ends = np.array(spans).reshape(-1, 2).T[:, :, None]
        acted = (starts <= onsets) & (onsets <= ends + EASED_TIME)
        factors = iter(np.where(acted.any(axis=1), EASED, 1.0).tolist())
        return self._replace(
            disturbances=[push.scaled(next(factors)) for push in self.disturbances],
            impacts=[impact._replace(size=impact.size * next(factors)) for impact in self.impacts],
            loads=[load._replace(size=load.size * next(factors)) for load in self.loads],
            glitch_size=self.glitch_size * (EASED if glitched.any() else 1.0),
            grips=self.grips * (FIRMER if firmer or (~acted.any(axis=0) & ~glitched).any() else 1),
        )


class Command(NamedTuple):
    """Set-points of the fingers and action of the operator until the next sample.

    Attributes:
        depths: (4,) set-point of each fingertip on its closing path [m].
        hold: grip of the operator on the object, from 0 (released) to 1.
        disturbance: index of the current disturbance in the plan; -1 for none.
        elapsed: time since it began [s].
        phase: phase of the experiment; a disturbance lasts from its planned start to its end.
    """

    depths: Array
    hold: float
    disturbance: int
    elapsed: float
    phase: Phase


def touched_phase(slip: float) -> Phase:
    """Return the phase while an operator touches the object, by the slip speed [m/s]."""
    return Phase.SLIPPING if slip > SLIPPING_SPEED else Phase.DISTURBED


class Protocol:
    """State machine of one grasp.

    Args:
        plan: plan of the grasp.
        period: period of its steps [s].

    Attributes:
        locked_at: time at which the object was locked [s]; None before.
        lost_at: time at which the object was lost [s]; None if it was not.
        anchor: (12,) position and rotation at which the operator holds the object.
    """

    def __init__(self, plan: Plan, period: float) -> None:
        self.plan = plan
        self.locked_at: float | None = None
        self.lost_at: float | None = None
        self.anchor = np.zeros(12)
        self._period = period
        n_fingers = len(plan.grips)
        # Of each finger: its set-point, which closing and release move; how long its load has been
        # over its grip; and whether it has stopped for good. `_close` changes the last two.
        self._depths = np.full(n_fingers, OPEN_GAP)
        self._over_grip_for = np.zeros(n_fingers)
        self._stopped = np.zeros(n_fingers, dtype=np.bool_)
        self._all_stopped_at = np.inf
        self._released_at = np.inf  # from the end of the hold, a time-out, or `release`
        self._untouched_for = 0.0  # with fewer than two fingertips, while it is held
        self._locked_position = np.zeros(3)

    @property
    def failed(self) -> bool:
        """Whether the object was never locked, or lost."""
        return self.locked_at is None or self.lost_at is not None

    def is_released(self, time: float) -> bool:
        """Return whether the hand has begun to release the object."""
        return time >= self._released_at

    def release(self, time: float) -> None:
        """Release the object from this time on [s], if it is not released before."""
        self._released_at = min(self._released_at, time)

    def is_over(self, time: float) -> bool:
        """Return whether the grasp is complete."""
        return time > self._released_at + self.plan.after

    def command(self, time: float, loads: Array, slip: float, body: Array) -> Command:
        """Return the command until the next sample.

        Args:
            time: time of this sample [s].
            loads: (4,) loads of the fingertips [N].
            slip: largest slip speed of a fingertip in contact [m/s].
            body: (18,) position, rotation, velocity and spin of the object.
        """
        if time == 0.0:
            self.anchor[:] = body[:12]
        # Release first: it also ends a closing that timed out, and a hold that lost the object.
        if time >= self._released_at:
            self._depths = np.minimum(self._depths + OPENING_SPEED * self._period, OPEN_GAP)
            phase = Phase.RELEASED if (loads > MIN_TOUCH_LOAD).any() else Phase.FREE
            return self._new_command(1.0 if self.lost_at is None else 0.0, phase)
        if self.locked_at is not None:
            return self._hold(time, loads, slip, body)
        if time < self.plan.before:
            return self._new_command(1.0, Phase.FREE)
        return self._close(time, loads, body)

    def _close(self, time: float, loads: Array, body: Array) -> Command:
        gripping = loads >= self.plan.grips  # such a finger waits, and continues after a spike
        self._over_grip_for = np.where(gripping, self._over_grip_for + self._period, 0.0)
        self._stopped |= (self._over_grip_for > GRIP_CONFIRM_TIME) | (self._depths <= CLOSED_GAP)
        self._depths[~self._stopped & ~gripping] -= self.plan.speed * self._period
        if self._stopped.all() and time < self._all_stopped_at:
            self._all_stopped_at = min(self._all_stopped_at, time)
        if self._released_at < np.inf:  # closing has timed out
            return self._new_command(1.0, Phase.CLOSING)
        gripped = ((loads > MIN_TOUCH_LOAD) | (self.plan.grips <= 0)).all()
        if gripped and time - self._all_stopped_at >= SETTLE_TIME:
            self.locked_at = time
            self._locked_position = body[:3].copy()
        elif time - self.plan.before > CLOSING_TIMEOUT:
            self._released_at = time + HAND_OVER_TIME
        return self._new_command(1.0, Phase.CLOSING)

    def _hold(self, time: float, loads: Array, slip: float, body: Array) -> Command:
        held_for = time - float(self.locked_at or 0.0)
        # The object is lost if it is far from its position, or if it was touched too little for a
        # while: with one finger it would fall.
        n_touching = sum(load > MIN_TOUCH_LOAD for load in loads.tolist())
        self._untouched_for = self._untouched_for + self._period if n_touching < 2 else 0.0
        away = body[:3] - self._locked_position
        is_far = math.sqrt(away.dot(away)) > LOST_DISTANCE
        if self.lost_at is None and (is_far or self._untouched_for >= LOST_CONTACT_TIME):
            self.lost_at = time
        if held_for >= self.plan.profile.hold and self._released_at == np.inf:
            # The operator first takes the object where it is now.
            self._released_at = time + HAND_OVER_TIME
            self.anchor[:] = body[:12]
        if self.lost_at is not None:
            return self._new_command(0.0, Phase.FREE)
        phase, disturbance, elapsed = Phase.LOCKED, -1, 0.0
        for index, planned in enumerate(self.plan.disturbances):
            if planned.start <= held_for < planned.start + planned.duration:
                phase, disturbance = touched_phase(slip), index
                elapsed = held_for - planned.start
                break
        # The operator lets go after the lock, and takes the object again before the release.
        releasing = 1.0 - held_for / HAND_OVER_TIME
        taking = 1.0 - (self._released_at - time) / HAND_OVER_TIME
        return self._new_command(max(0.0, releasing, taking), phase, disturbance, elapsed)

    def _new_command(
        self, hold: float, phase: Phase, disturbance: int = -1, elapsed: float = 0.0
    ) -> Command:
        return Command(self._depths, hold, disturbance, elapsed, phase)
