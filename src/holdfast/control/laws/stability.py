"""The law of holdfast: grip force from load, probability of stability and instability.

Three rules, each without units, so that they carry over between counts and newtons:

1. Load. A grip that was stable at a ratio of tangential to normal force T/N is kept at that ratio:
   a finger whose tangential force grows presses more, before anything slips. The ratio is the
   largest stable one of the first second, in which a person or a table may still carry the
   object; until then this rule does not act. People do the same
   (R. S. Johansson and G. Westling, Exp. Brain Res. 56 (1984) 550-564: grip and load force rise
   in parallel).
2. Instability. If the detector's probability of stability falls below its threshold, the force
   rises by a step that grows with the lack of probability and with sigma over the normal force,
   and again after the dead time, until the contact is stable.
3. Memory. A finger that became unstable at a smaller ratio T/N than its limit gets a new limit,
   which is forgotten slowly; so friction that drops is learned from the first slip.

Where nothing of this asks for force, it falls slowly to what the load needs. The forces of all
fingers stay balanced (`holdfast.control.balance`).
"""

import math
from collections.abc import Sequence

from holdfast.control.balance import balanced
from holdfast.control.command import GripReason
from holdfast.control.laws.base import Law, Touch, Wish

_NONE, _RELAX = GripReason.NONE, GripReason.RELAX

SLIP_SHARE = 0.9
"""Factor of the ratio at which a finger became unstable, for its new limit."""


class Stability(Law):
    """Law that reacts to the probability of stability, and follows the load.

    Args:
        threshold: probability below which a contact is unstable.
        gain: relative rise of force at a probability of 0.
        vibration_gain: relative rise of force for a sigma as large as the normal force.
        dead_time: time between two reactions of a finger [s]. The default is the window of 14
            samples at 150 Hz, in which a rise of force itself makes sigma large.
        memory: time constant with which a limit of the ratio T/N is forgotten [s].
        lowest_limit: lowest limit of the ratio T/N, as a share of the first.
        smoothing: time constant of the tangential force [s].
        settling: time from the start of the grip in which its ratio T/N is measured [s].
    """

    def __init__(
        self,
        threshold: float = 0.5,
        gain: float = 0.35,
        vibration_gain: float = 2.0,
        dead_time: float = 14 / 150,
        memory: float = 4.0,
        lowest_limit: float = 0.5,
        smoothing: float = 0.02,
        settling: float = 1.0,
    ) -> None:
        self.threshold, self.gain, self.vibration_gain = threshold, gain, vibration_gain
        self.dead_time, self.memory = dead_time, memory
        self.lowest_limit, self.smoothing, self.settling = lowest_limit, smoothing, settling

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Begin to measure the ratios T/N of the first grip."""
        self._thumb = thumb
        self._age = 0.0
        self._ratios = [_ratio(touch) for touch in touches]
        self._forces = [touch.start_normal for touch in touches]
        self._load = [touch.tangential for touch in touches]
        self._shares = [1.0] * len(touches)
        self._ready_at = [-math.inf] * len(touches)
        self._target = [1.0] * len(touches)

    def wishes(self, touches: Sequence[Touch], time: float, dt: float) -> list[Wish]:
        """Return what load and stability need, balanced over the fingers."""
        self._age += dt
        follow, forget = min(dt / self.smoothing, 1.0), min(dt / self.memory, 1.0)
        load, shares = self._load, self._shares
        wishes = []
        for k, touch in enumerate(touches):
            if touch.known:
                load[k] += follow * (touch.tangential - load[k])
                shares[k] += forget * (1.0 - shares[k])
                wishes.append(self._wish(k, touch, time))
            else:
                wishes.append((touch.scale, _NONE))
        return wishes if self._thumb < 0 else self._balance(touches, wishes)

    def _wish(self, k: int, touch: Touch, time: float) -> Wish:
        needed = 1.0
        if self._age < self.settling:
            self._settle(k, touch)
        elif self._ratios[k] > 0:
            needed = self._load[k] / (self._ratios[k] * self._shares[k] * touch.start_normal)
        scale = touch.scale
        unstable = touch.probability < self.threshold or not touch.touching
        if unstable and time >= self._ready_at[k]:
            self._ready_at[k] = time + self.dead_time
            self._learn(k, touch)
            self._target[k] = max(scale * (1.0 + self._step(touch)), needed)
            return self._target[k], GripReason.UNSTABLE
        if scale < self._target[k] and time < self._ready_at[k]:
            return self._target[k], GripReason.UNSTABLE
        if needed > scale:
            return needed, GripReason.LOAD
        return (scale if unstable else needed), _RELAX

    def _step(self, touch: Touch) -> float:
        lack = 1.0 - touch.probability / self.threshold if touch.touching else 1.0
        shaking = touch.instability / touch.normal if touch.normal > 0 else 0.0
        step = self.gain * max(lack, 0.0)
        return step + self.vibration_gain * min(shaking, 0.25) if shaking > 0 else step

    def _settle(self, k: int, touch: Touch) -> None:
        if touch.probability >= self.threshold:
            self._ratios[k] = max(self._ratios[k], _ratio(touch))

    def _learn(self, k: int, touch: Touch) -> None:
        if self._age >= self.settling and self._ratios[k] > 0:
            share = SLIP_SHARE * _ratio(touch) / self._ratios[k]
            self._shares[k] = max(self.lowest_limit, min(self._shares[k], share))

    def _balance(self, touches: Sequence[Touch], wishes: list[Wish]) -> list[Wish]:
        own = [scale for scale, _ in wishes]
        scales = balanced(own, self._forces, self._thumb)
        for k, scale in enumerate(scales):
            if scale > own[k]:
                raised = scale > touches[k].scale
                wishes[k] = scale, GripReason.BALANCE if raised else wishes[k][1]
        return wishes


def _ratio(touch: Touch) -> float:
    """Return T/N; 0 without a normal force."""
    return touch.tangential / touch.normal if touch.normal > 0 and touch.start_normal > 0 else 0.0
