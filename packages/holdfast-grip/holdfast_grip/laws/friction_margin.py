"""Friction margin: a normal force that exceeds what friction needs by a margin.

The target is a margin times the tangential force over the friction coefficient; the force rises
at once and falls slowly. A target and a lower margin at which the law acts: protocol of the
PapillArray group (UCD), with 1.15 and 1.1 and a first coefficient of 0.3. Rise, and the coefficient
found online: G. Waltersson and Y. Karayiannidis, arXiv 2410.19660, whose release has margins and a
lowest force of its own and falls by 5 % a step. The rule by which the coefficient is found is an
own choice: the largest ratio of tangential to normal force that held. First coefficient, margins
and fall were tuned by the rule for all rivals (docs/study/grip.md).
"""

from collections.abc import Sequence

from holdfast_grip.command import GripReason
from holdfast_grip.laws.base import ForceTarget, Law, Touch, stay

FORCE_MARGIN = 1.3
"""Factor of the least normal force."""
ACTING_MARGIN = 1.1
"""Factor of the least normal force below which the force rises."""
MARGIN_FALL = 0.2
"""Relative speed of the fall [1/s]."""
FIRST_FRICTION = 0.5
"""Friction coefficient before anything is known."""
LOWEST_FORCE = 0.05
"""Least normal force of a finger [N]."""
FALL_SHARE = 0.95
"""Least factor of the force in a step in which it falls."""
SLIP_SHARE = 0.9
"""Factor of the ratio at which a finger slipped, for the new friction coefficient."""
STABLE_PROBABILITY = 0.5
"""Probability of stability from which a ratio counts as held."""


class FrictionMargin(Law):
    """Law that keeps every finger inside its friction cone, by a margin.

    Args:
        margin: factor of the least normal force.
        first_friction: friction coefficient before anything is known.
        acts_at: margin below which the force rises to `margin`.
        fall: relative speed of the fall [1/s], 5 % a step at most.
    """

    needs_newtons = True

    def __init__(
        self,
        margin: float = FORCE_MARGIN,
        first_friction: float = FIRST_FRICTION,
        acts_at: float = ACTING_MARGIN,
        fall: float = MARGIN_FALL,
    ) -> None:
        self.margin, self.first_friction = margin, first_friction
        self.acts_at, self.fall = acts_at, fall

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Start with the friction that the first grip proves."""
        self._friction = [self.first_friction] * len(touches)

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Return the scale that the tangential force of each finger needs."""
        targets = stay(touches)
        for k, touch in enumerate(touches):
            # Without a force nothing is known of the friction: the scale stays.
            if not (touch.known and touch.normal > LOWEST_FORCE and touch.start_normal > 0):
                continue
            ratio = touch.tangential / touch.normal
            if touch.probability >= STABLE_PROBABILITY:
                self._friction[k] = max(self._friction[k], ratio)
            # A finger that slips below the known coefficient shows a lower one.
            elif ratio < self._friction[k]:
                self._friction[k] = max(self.first_friction, SLIP_SHARE * ratio)
            force = max(self.margin * touch.tangential / self._friction[k], LOWEST_FORCE)
            scale = force / touch.start_normal
            if scale <= touch.scale:
                share = max(1.0 - self.fall * dt, FALL_SHARE)
                targets[k] = (max(scale, share * touch.scale), GripReason.RELAX)
            # Two margins: a rise begins below the lower one, and ends at the upper one.
            elif self.acts_at * scale > self.margin * touch.scale:
                targets[k] = (scale, GripReason.MARGIN)
        return targets
