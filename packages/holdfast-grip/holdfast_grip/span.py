"""Begin of a grip, and its end when the hand lets go. No clock."""

import math
from collections.abc import Callable

from holdfast.contact import TIME_TOLERANCE, ContactState, HandEstimate
from holdfast.sensors.types import Array
from holdfast_grip.laws import Touch

STILL_TIME = 0.4
"""Time for which the hand has been still when the grip begins [s]. With 0.2 it began while a person
still held the object, and pressed 6 % more for it; with 1 more objects fell before."""
STEADY_BAND = 0.15
"""Share by which the sums of the normal and the tangential forces may change in a steady grip."""
CALM_SHARE = 0.7
"""Share of the normal force on STABLE fingers from which a hand is calm."""
MIN_FINGERS = 2
"""Number of fingers in contact from which there is a grip; one, for a hand of one finger."""

MIN_OPENING = 0.1
"""Share of the way that the joints closed, by which they went back when the object is let go."""
MIN_CLOSING = 0.05
"""Length of that way from which its direction is known [rad]."""

_STABLE, _UNSTABLE, _UNKNOWN = ContactState.STABLE, ContactState.UNSTABLE, ContactState.UNKNOWN
_HOLDING = (_STABLE, _UNSTABLE)


class GripStart:
    """Decide when a grip begins: when the hand has been still for `STILL_TIME`.

    It is still while it is STABLE, while the fingers that are STABLE, two at least, carry 70 % of
    the normal force, and, with a slip rule, while nothing slides and the forces stay the same: so a
    grip that is lighter than those the model was trained on begins too. UNKNOWN blocks it.

    Args:
        new_touch: function that makes the touch of a finger.
    """

    def __init__(self, new_touch: Callable[[str], Touch]) -> None:
        self._new_touch = new_touch
        self.reset()

    def reset(self) -> None:
        """Forget how long the hand has been still."""
        # NaN is in no order with a time, so what has not begun never lasts long enough.
        self._still_since = math.nan
        # Sums of normal and tangential forces at the begin of a steady grip.
        self._steady_forces = math.nan, math.nan

    def update(self, estimate: HandEstimate, time: float) -> list[Touch]:
        """Process an estimate; return the fingers in contact if the grip begins, else none."""
        if not (math.isfinite(time) and self._is_still(estimate)):
            self._still_since = math.nan
        # Before the first still sample, and after a clock that went back, count from here.
        elif not self._still_since <= time:
            self._still_since = time
        if not time - self._still_since >= STILL_TIME - TIME_TOLERANCE:
            return []
        held = [finger for finger in estimate.fingers.items() if finger[1].state in _HOLDING]
        touches = [self._new_touch(name) for name, _ in held]
        is_finite = all(
            touch.read(finger) for touch, (_, finger) in zip(touches, held, strict=True)
        )
        # A hand with a single sensor begins with one finger.
        is_enough = len(touches) >= min(MIN_FINGERS, len(estimate.fingers))
        return touches if is_finite and is_enough else []

    def _is_still(self, estimate: HandEstimate) -> bool:
        if estimate.state is not _UNSTABLE:
            return estimate.state is _STABLE
        touches = []
        total = across = stable = 0.0
        n_stable = 0
        for name, finger in estimate.fingers.items():
            touch = self._new_touch(name)
            # Without the force of one finger, the share of the others is not known.
            if finger.state is _UNKNOWN or not touch.read(finger):
                return False
            touches.append(touch)
            total, across = total + touch.normal, across + touch.tangential
            if finger.state is _STABLE:
                stable, n_stable = stable + touch.normal, n_stable + 1
        if n_stable >= MIN_FINGERS and stable >= CALM_SHARE * total:
            return True
        # Without a slip rule, a steady slide would look like a steady grip.
        if not all(touch.knows_slips and not touch.slides for touch in touches):
            return False
        before, across_before = self._steady_forces
        band = STEADY_BAND * total
        if abs(total - before) <= band and abs(across - across_before) <= band:
            return sum(touch.touching for touch in touches) >= MIN_FINGERS
        # A larger change begins another grip, whose forces are compared then.
        self._steady_forces = total, across
        return False


class JointWay:
    """Way of the joints since the first report: how far they closed, and whether they went back."""

    def __init__(self) -> None:
        # The first angles, those when the grip began, and the newest; None without.
        self._open: Array | None = None
        self._closed: Array | None = None
        self._newest: Array | None = None

    def add(self, angles: Array) -> None:
        """Add the newest angles [rad]."""
        self._newest = angles
        if self._open is None:
            self._open = angles

    def grip(self) -> None:
        """Take the newest angles as those with which the grip began."""
        self._closed = self._newest

    @property
    def have_opened(self) -> bool:
        """Whether the joints went back since the grip began, as those of a hand that lets go.

        The fingers of a hand that lost its object close further.
        """
        before, grip, now = self._open, self._closed, self._newest
        if before is None or grip is None or now is None:
            return False
        if not before.shape == grip.shape == now.shape:
            return False
        closing, moved = grip - before, now - grip
        way = float(closing @ closing)
        return way >= MIN_CLOSING**2 and float(moved @ closing) <= -MIN_OPENING * way
