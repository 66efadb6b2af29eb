"""Relaxation: the force of a law that only reacts falls slowly while nothing slips."""

from holdfast_grip.command import GripReason
from holdfast_grip.laws.base import ForceTarget

RELAXATION_SETTLE_TIME = 0.5
"""Time without a slip before the force falls [s]."""
RELAXATION_MARGIN = 1.25
"""Least force of the fall, as a multiple of the force at which the last slip began."""


class Relaxation:
    """Slow fall of a force scale to a margin above the force of the last slip, 1 at least.

    The published laws end a grip with the highest force that a slip required. This rule is an
    addition, the same for each law that has it. A slip within the settle time after another one
    belongs to that one. A false slip at a lower force lowers the floor again.

    Args:
        fall: relative speed of the fall [1/s]; 0 for no fall.
    """

    def __init__(self, fall: float) -> None:
        self.fall = fall
        self.start()

    def start(self) -> None:
        """Begin a grip."""
        self._slipped_at = float("-inf")
        self._floor = 1.0

    def slipped(self, scale: float, time: float) -> None:
        """Take a slip at a scale."""
        # A slip lasts for many samples; only its first one has the force that was too low.
        if time - self._slipped_at > RELAXATION_SETTLE_TIME:
            self._floor = max(1.0, RELAXATION_MARGIN * scale)
        self._slipped_at = time

    def target(self, scale: float, time: float, dt: float, least: float = 0.0) -> ForceTarget:
        """Return the scale that follows in calm, at least a scale that the law needs anyway."""
        lowest = max(self._floor, least)
        settled = time - self._slipped_at > RELAXATION_SETTLE_TIME
        if not (self.fall > 0 and settled and scale > lowest):
            return (scale, GripReason.NONE)
        return (max(scale * (1.0 - self.fall * dt), lowest), GripReason.RELAX)
