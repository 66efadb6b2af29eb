"""Slip servo of the PR2 gripper.

J. M. Romano, K. Hsiao, G. Niemeyer, S. Chitta, K. J. Kuchenbecker: Human-inspired robotic grasp
control with tactile sensing. IEEE Transactions on Robotics 27 (2011) 1067-1079. Filters and
thresholds are those of the released code. The gain of a reaction was tuned on trials of another
seed (docs/study/grip.md): the paper's, 1.08 as we remember it, drops more. The original has one
force for both fingertips; here every finger reacts with the others. The factor of the thresholds
and the relaxation in calm are additions, tuned as those of the other laws.
"""

import math
from collections.abc import Sequence

from holdfast_grip.command import GripReason
from holdfast_grip.laws.base import ForceTarget, Law, Touch
from holdfast_grip.laws.relaxation import Relaxation

HIGH_PASS = 5.0
"""Corner of the high-pass filter of F_hp [Hz]."""
BAND = (0.8, 5.0)
"""Corners of the band-pass filter of F_bp [Hz]."""
SHARE, LOWEST, HIGHEST = 0.007, 0.048, 0.2
"""Threshold of |F_hp| as a share of the force, and its ends [N]."""
SLOW_LIMIT = 0.18
"""|F_bp| above which a change of force is not a slip [N]."""
GAIN = 1.3
"""Factor of the force at each sample that slips."""


class Pr2(Law):
    """Law that raises the force by 30 % at every sample in which the fingertip force vibrates.

    Args:
        gain: factor of the force at each sample that slips.
        threshold_factor: factor of the threshold of |F_hp|; 1 is that of the source.
        fall: relative speed with which the force falls in calm [1/s]; 0 is that of the source.
    """

    needs_newtons = True

    def __init__(
        self, gain: float = GAIN, threshold_factor: float = 1.0, fall: float = 0.0
    ) -> None:
        self.gain, self.threshold_factor = gain, threshold_factor
        self.relaxation = Relaxation(fall)

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Start the filters at rest."""
        self._filters = [_Filters(touch) for touch in touches]
        self.relaxation.start()

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Raise all fingers if one slips; else relax them."""
        pairs = zip(self._filters, touches, strict=True)
        factor = self.threshold_factor
        slips = [touch.known and filters.slips(touch, dt, factor) for filters, touch in pairs]
        if not any(slips):
            return [self.relaxation.target(touch.scale, time, dt) for touch in touches]
        self.relaxation.slipped(max(touch.scale for touch in touches), time)
        return [(touch.scale * self.gain, GripReason.SLIP) for touch in touches]


class _Filters:
    """Filters of one finger, first order each."""

    def __init__(self, touch: Touch) -> None:
        self._last = touch.force
        self._high = (0.0, 0.0, 0.0)
        self._fast = self._slow = touch.normal

    def slips(self, touch: Touch, dt: float, factor: float) -> bool:
        keep = 1.0 / (1.0 + dt * 2 * math.pi * HIGH_PASS)
        x, y, z = touch.force
        u, v, w = self._last
        a, b, c = self._high
        self._high = keep * (a + x - u), keep * (b + y - v), keep * (c + z - w)
        self._last = touch.force
        # A low-pass filter of first order follows this share of a step.
        slow, fast = (dt * 2 * math.pi * corner for corner in BAND)
        self._slow += (touch.normal - self._slow) * (slow / (1.0 + slow))
        self._fast += (touch.normal - self._fast) * (fast / (1.0 + fast))
        threshold = factor * min(max(SHARE * math.hypot(x, y, z), LOWEST), HIGHEST)
        band_pass = abs(self._fast - self._slow)
        return math.hypot(*self._high) > threshold and band_pass < SLOW_LIMIT
