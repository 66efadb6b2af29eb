"""Friction margin: a normal force that exceeds what friction needs by a margin.

The target is a margin times the tangential force over the friction coefficient; the force rises
at once and falls by 5 % a step. Margin 1.15: protocol of the PapillArray group (UCD), whose first
coefficient is 0.3; 0.5 was tuned on trials of another seed (docs/study/grip.md). Rise, fall and the
coefficient found online: G. Waltersson and Y. Karayiannidis,
arXiv 2410.19660, whose release has margins and a lowest force of its own. The rule by which the
coefficient is found is an own choice: the largest ratio of tangential to normal force that held.
"""

from collections.abc import Sequence

from holdfast.grip.command import GripReason
from holdfast.grip.laws.base import Law, Touch, Wish

FORCE_MARGIN = 1.15
"""Factor of the least normal force."""
FIRST_FRICTION = 0.5
"""Friction coefficient before anything is known."""
LOWEST_FORCE = 0.05
"""Least normal force of a finger [N]."""
FALL_SHARE = 0.95
"""Factor of the force in a step in which it falls."""
SLIP_SHARE = 0.9
"""Factor of the ratio at which a finger slipped, for the new friction coefficient."""
STABLE_PROBABILITY = 0.5
"""Probability of stability from which a ratio counts as held."""


class FrictionMargin(Law):
    """Law that keeps every finger inside its friction cone, by a margin.

    Args:
        margin: factor of the least normal force.
        first_friction: friction coefficient before anything is known.
    """

    needs_newtons = True

    def __init__(
        self, margin: float = FORCE_MARGIN, first_friction: float = FIRST_FRICTION
    ) -> None:
        self.margin, self.first_friction = margin, first_friction

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Start with the friction that the first grip proves."""
        self._friction = [self.first_friction] * len(touches)

    def wishes(self, touches: Sequence[Touch], time: float, dt: float) -> list[Wish]:
        """Return the scale that the tangential force of each finger needs."""
        return [self._wish(k, touch) for k, touch in enumerate(touches)]

    def _wish(self, k: int, touch: Touch) -> Wish:
        if not (touch.known and touch.normal > LOWEST_FORCE and touch.start_normal > 0):
            return (touch.scale, GripReason.NONE)
        ratio = touch.tangential / touch.normal
        if touch.probability >= STABLE_PROBABILITY:
            self._friction[k] = max(self._friction[k], ratio)
        elif ratio < self._friction[k]:
            self._friction[k] = max(self.first_friction, SLIP_SHARE * ratio)
        target = max(self.margin * touch.tangential / self._friction[k], LOWEST_FORCE)
        scale = target / touch.start_normal
        if scale > touch.scale:
            return (scale, GripReason.MARGIN)
        return (max(scale, FALL_SHARE * touch.scale), GripReason.RELAX)
