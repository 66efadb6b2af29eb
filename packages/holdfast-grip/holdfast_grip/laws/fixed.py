"""The law of a hand without control: the force of the start, with which others are compared."""

from collections.abc import Sequence

from holdfast_grip.laws.base import ForceTarget, Law, Touch, stay


class Fixed(Law):
    """Law that keeps the force with which the grip began."""

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Do nothing."""

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Return the scales as they are."""
        return stay(touches)
