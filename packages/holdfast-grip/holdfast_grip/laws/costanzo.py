"""A law of Costanzo's kind: a static force by friction, and a dynamic one by the slip.

M. Costanzo, G. De Maria, C. Natale (University of Campania): slipping avoidance by limit surface
and slip velocity. Written from the description and the constants of the published controller; no
code of it is used.

As in the source: the force is the sum of a static and a dynamic part. The static one is 1.1 times
the least normal force by the limit surface, 1 N at least. The dynamic one is the output of a PI
controller on the slip, with a ratio of integral to proportional gain of 50 to 13, between 0 and
10 N; the integral stops at these ends (anti-windup). All fingers share one force.

Different:

- The readings have no moment about the normal. The limit surface without a moment is Coulomb
  friction: the least normal force is T / mu.
- The source knows the friction from an exploration before the grasp. Here it begins with a setting
  and is lowered to T / N of the fingers that slide.
- The source estimates the slip velocity by an observer at 500 Hz or more, from friction with a
  state. The models that ship have no slip speed. In its place is the probability of the slip of
  each finger, as far as it is above a level, weighted by the share of the normal force: a number
  from 0 to 1, so the gain of the PI controller and the level had to be tuned (docs/study/grip.md).
- The integral is not emptied: the force falls slowly in calm, by the rule that the other laws have
  (`holdfast_grip.laws.relaxation`), and the integral with it. A rise of the static part by less
  than 5 % is ignored, and the tangential force is smoothed.
- A gripper has one motor. Here the scale of all fingers is the same: the force of the hand over
  that with which the grip began.
"""

from collections.abc import Sequence

from holdfast_grip.command import GripReason
from holdfast_grip.laws.base import ForceTarget, Law, Touch, stay
from holdfast_grip.laws.relaxation import Relaxation

STATIC_MARGIN = 1.1
"""Factor of the least normal force."""
LEAST_STATIC_FORCE = 1.0
"""Least static force of the hand [N]."""
PROPORTIONAL_GAIN, INTEGRAL_GAIN = 13.0, 50.0
"""Gains of the source; here per probability of a slip [N] and [N/s], times a factor."""
LARGEST_DYNAMIC_FORCE = 10.0
"""Largest dynamic force of the hand [N]."""
LOAD_SMOOTHING = 0.02
"""Time constant of the tangential force [s]."""
STATIC_RISE = 1.05
"""Ratio of the needed scale to the present one from which the force rises without a slip."""


class Costanzo(Law):
    """Law of a static force by friction and a dynamic force by the slip, one for all fingers.

    Args:
        first_friction: friction coefficient before a slip has shown one.
        least_friction: least coefficient that a slip can show.
        gain: factor of both gains of the source.
        slip_level: probability of a slip from which a finger slides.
        fall: relative speed with which the force falls in calm [1/s]; 0 for none.
    """

    needs_newtons = True

    def __init__(
        self,
        first_friction: float = 0.4,
        least_friction: float = 0.25,
        gain: float = 0.3,
        slip_level: float = 0.1,
        fall: float = 0.2,
    ) -> None:
        self.first_friction, self.least_friction = first_friction, least_friction
        self.gain, self.slip_level = gain, slip_level
        self.relaxation = Relaxation(fall)

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Start with the first friction and without a dynamic force."""
        self._start_force = sum(touch.start_normal for touch in touches)
        self._load = sum(touch.tangential for touch in touches)
        self._friction, self._integral = self.first_friction, 0.0
        self.relaxation.start()

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Return the scale of the static and the dynamic force, the same for all fingers."""
        if not (self._start_force > 0 and all(touch.known for touch in touches)):
            return stay(touches)
        load = sum(touch.tangential for touch in touches)
        # At most the whole step: after a pause the filter would overshoot.
        self._load += min(dt / LOAD_SMOOTHING, 1.0) * (load - self._load)
        # The friction of the fingers that slide; their slip, 0 to 1, by their share of the force.
        sliding = [touch for touch in touches if touch.slip_probability > self.slip_level]
        press, slip = sum(touch.normal for touch in sliding), 0.0
        if press > 0:
            ratio = sum(touch.tangential for touch in sliding) / press
            self._friction = min(self._friction, max(ratio, self.least_friction))
            total = sum(touch.normal for touch in touches)
            above = sum(one.normal * (one.slip_probability - self.slip_level) for one in sliding)
            slip = above / (total * (1.0 - self.slip_level))
        static = max(STATIC_MARGIN * self._load / self._friction, LEAST_STATIC_FORCE)
        scale = max(touch.scale for touch in touches)
        if slip > 0:  # the PI controller, which only raises the force
            self.relaxation.slipped(scale, time)
            self._integral += self.gain * INTEGRAL_GAIN * slip * dt
            self._integral = min(self._integral, LARGEST_DYNAMIC_FORCE)
            proportional = self.gain * PROPORTIONAL_GAIN * slip
            dynamic = min(proportional + self._integral, LARGEST_DYNAMIC_FORCE)
            needed = (static + dynamic) / self._start_force
            reason = GripReason.SLIP if needed > scale else GripReason.NONE
            return [(max(needed, scale), reason)] * len(touches)
        least = static / self._start_force
        if least > STATIC_RISE * scale:
            return [(least, GripReason.MARGIN)] * len(touches)
        target = self.relaxation.target(scale, time, dt, least)
        # The integral falls with the force, or the next slip would begin with the old one.
        self._integral = min(self._integral, max(target[0] - least, 0.0) * self._start_force)
        return [target] * len(touches)
