"""Rises of force before the load comes: false ones in quiet time, and those after impacts."""

import math
from collections.abc import Sequence

from holdfast.contact import SLIP_SPEED
from holdfast.twin.hand import RATE
from holdfast.twin.impacts import Impact
from holdfast_grip.command import GripCommand, LoopState

START_TIME = 1.5
"""Time after the loop began in which a rise of force is the law's start, and no reaction [s]: a
person lets go of the object, and the law measures the response of the hand."""
SLIP_MEMORY = 0.3
"""A reaction within this time after a fingertip slid is not false [s]: glitches of the hand's
controller make fingertips slide before the load comes."""
IMPACT_MEMORY = 0.5
"""A rise within this time after an impact began is a reaction to it [s]."""


class SeenImpact:
    """An impact that the loop saw.

    Attributes:
        distance: how far a fingertip slid within `IMPACT_MEMORY` [m].
        is_answered: whether the force rose in that time.
    """

    __slots__ = ("distance", "is_answered")

    def __init__(self) -> None:
        self.distance, self.is_answered = 0.0, False


class QuietHold:
    """The hold of a loop that has begun, sample by sample, until the load comes.

    Args:
        impacts: impacts on the object, in the order of their times.

    Attributes:
        began_at: time after the lock of the first sample [s]; NaN before it.
        quiet_time: time in which a rise would be false [s].
        n_false: number of rises of force in this time.
        impacts: the impacts so far.
    """

    def __init__(self, impacts: Sequence[Impact]) -> None:
        self.began_at = math.nan
        self.quiet_time, self.n_false = 0.0, 0
        self.impacts: list[SeenImpact] = []
        self._coming = [impact.start for impact in impacts]
        self._slid_at = self._struck_at = -math.inf
        self._was_rising = False

    def add(self, held_for: float, slip_speed: float, command: GripCommand) -> None:
        """Add a sample.

        Args:
            held_for: time after the lock [s].
            slip_speed: largest slip speed of a fingertip in contact [m/s].
            command: command of the loop, which is not IDLE.
        """
        if math.isnan(self.began_at):
            self.began_at = held_for
        if slip_speed > SLIP_SPEED:
            self._slid_at = held_for
        if self._coming and held_for >= self._coming[0]:
            self._struck_at = self._coming.pop(0)
            self.impacts.append(SeenImpact())
        is_struck = held_for - self._struck_at <= IMPACT_MEMORY
        is_quiet = (
            held_for - self._slid_at > SLIP_MEMORY
            and held_for - self.began_at > START_TIME
            and not is_struck
        )
        rises = command.state is LoopState.REACT and not self._was_rising
        self._was_rising = command.state is LoopState.REACT
        self.quiet_time += is_quiet / RATE
        self.n_false += is_quiet and rises
        if is_struck:
            impact = self.impacts[-1]
            impact.is_answered |= rises
            impact.distance += slip_speed / RATE if slip_speed > SLIP_SPEED else 0.0
