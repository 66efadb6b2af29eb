"""Law on the relative change of the tangential force.

Wong and Zhu, Frontiers in Robotics and AI (2026), 10.3389/frobt.2026.1735467, detect slip where
|T_k - T_(k-1)| / max(T_(k-1), eps) exceeds a threshold, T being the tangential resultant of a
finger. Only the abstract was available: eps is an own choice; threshold and gain were tuned on
trials of another seed (docs/study/grip.md). The relaxation in calm and the choice whether all
fingers react together, as in a gripper of one motor, are additions, tuned as those of the other
laws.
"""

from collections.abc import Sequence

from holdfast_grip.command import GripReason
from holdfast_grip.laws.base import ForceTarget, Law, Touch
from holdfast_grip.laws.relaxation import Relaxation

SLIP_CHANGE = 0.05
"""Relative change of the tangential force in one sample that counts as a slip."""
FLOOR = 0.1
"""eps, as a share of the normal force of the start."""
GAIN = 1.3
"""Factor of the force of a finger that slips."""


class WongZhu(Law):
    """Law that raises the force of a finger whose tangential force jumps.

    Args:
        threshold: relative change in one sample that counts as a slip.
        gain: factor of the force of a finger that slips.
        fall: relative speed with which the force falls in calm [1/s]; 0 for none.
        together: whether all fingers react where one slips.
    """

    def __init__(
        self,
        threshold: float = SLIP_CHANGE,
        gain: float = GAIN,
        fall: float = 0.0,
        *,
        together: bool = False,
    ) -> None:
        self.threshold, self.gain, self.fall, self.together = threshold, gain, fall, together

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Remember the tangential forces."""
        self._last = [touch.tangential for touch in touches]
        self._relaxations = [Relaxation(self.fall) for _ in touches]

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Raise each finger that slips, or all; relax the others."""
        slips = []
        for k, touch in enumerate(touches):
            least = self.threshold * max(self._last[k], FLOOR * touch.start_normal)
            slips.append(touch.known and abs(touch.tangential - self._last[k]) > least)
            if touch.known:
                self._last[k] = touch.tangential
        if self.together and any(slips):
            slips = [True] * len(slips)
        targets: list[ForceTarget] = []
        for touch, relaxation, slipping in zip(touches, self._relaxations, slips, strict=True):
            if slipping:
                relaxation.slipped(touch.scale, time)
                targets.append((touch.scale * self.gain, GripReason.SLIP))
            else:
                targets.append(relaxation.target(touch.scale, time, dt))
        return targets
