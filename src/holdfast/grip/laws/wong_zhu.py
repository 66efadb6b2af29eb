"""Law on the relative change of the tangential force.

Wong and Zhu, Frontiers in Robotics and AI (2026), 10.3389/frobt.2026.1735467, detect slip where
|T_k - T_(k-1)| / max(T_(k-1), eps) exceeds a threshold, T being the tangential resultant of a
finger. Only the abstract was available: eps is an own choice; threshold and gain were tuned on
trials of another seed (docs/study/grip.md).
"""

from collections.abc import Sequence

from holdfast.grip.command import GripReason
from holdfast.grip.laws.base import Law, Touch, Wish

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
    """

    def __init__(self, threshold: float = SLIP_CHANGE, gain: float = GAIN) -> None:
        self.threshold, self.gain = threshold, gain

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Remember the tangential forces."""
        self._last = [touch.tangential for touch in touches]

    def wishes(self, touches: Sequence[Touch], time: float, dt: float) -> list[Wish]:
        """Raise each finger that slips."""
        out = []
        for k, touch in enumerate(touches):
            if touch.known and self._slips(touch, self._last[k]):
                out.append((touch.scale * self.gain, GripReason.SLIP))
            else:
                out.append((touch.scale, GripReason.NONE))
            if touch.known:
                self._last[k] = touch.tangential
        return out

    def _slips(self, touch: Touch, last: float) -> bool:
        return abs(touch.tangential - last) > self.threshold * max(last, FLOOR * touch.start_normal)
