"""The law of holdfast: grip force from load, slips, probability of stability and sigma.

Five rules, each without units, so that they carry over between counts and newtons:

1. Load. While a contact is not calm, each finger keeps the ratio of tangential to normal force
   T/N that it had in the calm grip before: where T grows, the finger presses more, before
   anything slips. Only a growth of T counts: a fall of N that the law itself commands raises T/N
   too. People do the same (R. S. Johansson and G. Westling, Exp. Brain Res. 56 (1984) 550-564:
   grip and load force rise in parallel).
2. Reaction. If the slip rule of the model decides that a finger slides, or its probability of
   stability falls below the threshold, all forces rise in one step: at once if such fingers carry
   `load_share` of the normal force or another finger is not calm either, else after `alone_time`.
   The step of a finger grows with the probability of its slip, with its lack of stability and with
   sigma over its normal force; fingers that are stable take `support` of the largest step. A step
   shakes all contacts itself: after it comes a dead time that grows with the step, and then a time
   with a lower threshold. Steps in quick succession are one episode, which at most multiplies the
   force by `most`, unless the probability is close to 0.
3. Fall. Where friction falls, all contacts begin to slide smoothly, and no finger alone looks
   unstable. So there is a step as well when nearly all fingers are less than calm while the hand
   carries less than in the calm grip.
4. Memory. Where a finger slides, the ratio T/N shows its friction. From then on the force does not
   fall below what the load needs at this friction, and a margin; the friction is forgotten slowly.
   A reaction without such a slip leaves a floor: the force at which it began, and the margin.
5. Relaxation. In a contact that is stable again the force falls, the faster the more stable, to
   the floor.

The forces of all fingers stay balanced. In a quiet grasp the normal force of the thumb balances
those of the fingers opposite to it. If every force grows by the same amount, that balance is lost
as soon as the two sides have different numbers of fingers: three fingers that add 1 N each push a
thumb away that adds 1 N. So the forces change by balanced amounts. With one finger on one side
this has a closed form (`balanced`), and no optimiser is needed. Fingers that carry almost nothing
start no reaction.
"""

import math
from collections.abc import Sequence

from holdfast.contact import Cause
from holdfast.grip.command import GripReason
from holdfast.grip.laws.base import Law, Touch, Wish

_NONE, _RELAX = GripReason.NONE, GripReason.RELAX

LEAST_SHARE = 0.15
"""Normal force of a finger that counts, as a share of the mean of all fingers."""
SMOOTHING = 0.02
"""Time constant of the tangential and normal forces [s]."""
FOLLOW_TIME = 1.0
"""Time constant with which the forces of the calm grip are followed [s]."""
LEAST_TANGENTIAL = 0.1
"""Least tangential force that counts as that of the calm grip, as a share of the normal force of
the start."""
LEAST_FRICTION = 0.25
"""Least coefficient of friction that a slip can show."""
DEADBAND = 0.05
"""Least relative rise of force that the load asks for."""
LARGEST_SHAKING = 0.25
"""Largest sigma over normal force that enters the step."""
NEVER = -math.inf


class _Finger:
    """What the law remembers of a finger."""

    __slots__ = (
        *("calm_load", "calm_scale", "counts", "friction", "least", "load"),
        *("press", "probability", "ratio", "start", "target"),
    )

    def __init__(self, touch: Touch, counts: bool) -> None:
        self.counts = counts
        self.least = LEAST_TANGENTIAL * touch.start_normal
        self.start = touch.start_normal
        self.load = self.calm_load = touch.tangential
        self.press = touch.normal
        self.ratio = self.load / self.press if self.press > 0 else 0.0
        self.calm_scale = touch.scale
        self.probability = 1.0
        self.target = 0.0
        self.friction = math.inf

    def learn(self) -> None:
        """Take the ratio T/N at a slip as the friction, if it is lower than the known one."""
        if self.press > 0:
            self.friction = min(self.friction, max(self.load / self.press, LEAST_FRICTION))

    def needed(self) -> float:
        """Return the scale that the growth of T since the calm grip needs; 0 if not known."""
        calm_load = max(self.calm_load, self.least)
        if not (self.counts and self.ratio > 0 and calm_load > 0):
            return 0.0
        by_growth = self.calm_scale * self.load / calm_load
        return min(by_growth, self.load / (self.ratio * self.start))


class Stability(Law):
    """Law that reacts to the probability of stability, and follows the load.

    Args:
        threshold: probability below which a contact is unstable.
        threshold_again: the same, for `again_time` after the dead time.
        again_time: time in which `threshold_again` holds [s].
        certain: probability below which an episode has no largest force.
        gain: relative rise of force of a finger at a probability of 0.
        least_step: part of `gain` that every reaction has.
        shaking_gain: relative rise of force for a sigma as large as the normal force.
        alone_time: time for which a finger must be unstable before a reaction if all others are
            calm [s]: an object that moves is felt by more than one finger.
        support: part of the largest step for the fingers that are stable.
        dead_time: time without reaction after a step, and its growth per relative rise [s].
        episode_time: time without a step after which the next one begins a new episode [s].
        most: largest factor of the force in an episode, and of that which the load asks for.
        calm: probability of all fingers from which the grip is calm.
        settled: probability of all fingers from which the force may fall.
        settle_time: time for which they must be settled [s].
        fall: relative speed of the fall in a contact that is surely stable [1/s].
        margin: floor after a slip, as a multiple of the force at which it began.
        memory: time constant with which floor and friction are forgotten [s].
        load_share: share of the normal force on unstable fingers from which the reaction is
            immediate.
        joint_calm: probability of a finger below which it is less than calm.
        joint_share: share of the normal force on such fingers at which friction may have fallen.
        joint_fall: share of the tangential forces of the calm grip that is missing then.
    """

    def __init__(
        self,
        *,
        threshold: float = 0.3,
        threshold_again: float = 0.2,
        again_time: float = 0.1,
        certain: float = 0.05,
        gain: float = 0.9,
        least_step: float = 0.8,
        shaking_gain: float = 0.9,
        alone_time: float = 0.05,
        support: float = 0.9,
        dead_time: tuple[float, float] = (0.08, 0.12),
        episode_time: float = 0.6,
        most: float = 2.5,
        calm: float = 0.7,
        settled: float = 0.3,
        settle_time: float = 0.15,
        fall: float = 1.0,
        margin: float = 1.15,
        memory: float = 20.0,
        load_share: float = 0.3,
        joint_calm: float = 0.8,
        joint_share: float = 0.9,
        joint_fall: float = 0.05,
    ) -> None:
        self.load_share = load_share
        self.joint_calm, self.joint_share, self.joint_fall = joint_calm, joint_share, joint_fall
        self.threshold, self.again_time = threshold, again_time
        self.threshold_again = threshold_again
        self.certain, self.gain, self.least_step = certain, gain, least_step
        self.shaking_gain, self.alone_time, self.support = shaking_gain, alone_time, support
        self.first_dead_time, self.dead_time_growth = dead_time
        self.episode_time, self.most = episode_time, most
        self.calm, self.settled, self.settle_time = calm, settled, settle_time
        self.fall, self.margin, self.memory = fall, margin, memory

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Take the present grip as the calm one."""
        self._thumb = thumb
        self._forces = [touch.start_normal for touch in touches]
        least = LEAST_SHARE * sum(self._forces) / max(len(touches), 1)
        self._fingers = [_Finger(touch, touch.start_normal > least) for touch in touches]
        self._n_counting = sum(finger.counts for finger in self._fingers)
        self._stepped_at = self._unsettled_at = NEVER
        self._dead_time = self._floor = self._alone = 0.0
        self._is_falling = False
        self._base = 1.0

    def wishes(self, touches: Sequence[Touch], time: float, dt: float) -> list[Wish]:
        """Return what load and stability need, balanced over the fingers."""
        lowest, second = self._observe(touches, time, dt)
        if self._must_react(lowest, second, time, dt):
            self._react(touches, lowest, time)
        self._forget(dt / self.memory)
        pairs = zip(self._fingers, touches, strict=True)
        self._moves = second < self.calm
        self._needed = self._needed_by_friction()
        wishes = [self._wish(finger, touch, lowest, time, dt) for finger, touch in pairs]
        return wishes if self._thumb < 0 else self._balance(touches, wishes)

    def _must_react(self, lowest: float, second: float, time: float, dt: float) -> bool:
        """Return whether a step begins, by the two lowest probabilities or a load that falls."""
        threshold = self._threshold_at(time - self._stepped_at)
        if lowest < threshold:
            together = second < self.calm or self._share_below(threshold) >= self.load_share
            self._alone = 0.0 if together else self._alone + dt
            return self._alone < dt or self._alone > self.alone_time
        self._alone = 0.0
        was_falling, self._is_falling = self._is_falling, self._load_falls(time)
        return was_falling and self._is_falling

    def _needed_by_friction(self) -> float:
        """Return the scale that the load of the fingers needs at their friction; 0 if not known.

        It is one for all fingers: floors of their own would unbalance a hand that relaxes.
        """
        needed = start = 0.0
        for finger in self._fingers:
            if finger.friction < math.inf:
                needed += finger.load / finger.friction
                start += finger.start
        return self.margin * needed / start if start > 0 else 0.0

    def _forget(self, share: float) -> None:
        """Forget a share of the floor and of what slips have shown of the friction."""
        self._floor *= 1.0 - min(share, 1.0)
        for finger in self._fingers:
            finger.friction *= 1.0 + share

    def _observe(self, touches: Sequence[Touch], time: float, dt: float) -> tuple[float, float]:
        """Follow the forces; return the two lowest probabilities of the fingers that count."""
        lowest = second = 1.0
        share = min(dt / SMOOTHING, 1.0)
        for finger, touch in zip(self._fingers, touches, strict=True):
            if touch.known:
                finger.load += share * (touch.tangential - finger.load)
                finger.press += share * (touch.normal - finger.press)
                finger.probability = self._evidence(touch)
                if finger.counts and finger.probability < second:
                    second = max(lowest, finger.probability)
                    lowest = min(lowest, finger.probability)
        if lowest < self.settled:
            self._unsettled_at = time
        elif lowest >= self.calm and time - self._unsettled_at > self.settle_time:
            self._follow(touches, time, min(dt / FOLLOW_TIME, 1.0))
        return lowest, second if self._n_counting > 1 else lowest

    def _evidence(self, touch: Touch) -> float:
        """Return the probability of stability; less than the threshold where the finger slides."""
        if not touch.touching:
            return 0.0
        if not touch.slides:
            return touch.probability
        return min(touch.probability, self.threshold * (1.0 - touch.slip_probability))

    def _follow(self, touches: Sequence[Touch], time: float, share: float) -> None:
        """Follow the calm grip, and end the episode."""
        for finger, touch in zip(self._fingers, touches, strict=True):
            finger.calm_load += share * (finger.load - finger.calm_load)
            if finger.press > 0:
                finger.ratio += share * (finger.load / finger.press - finger.ratio)
            finger.calm_scale = touch.scale
        if time - self._stepped_at > self.episode_time:
            self._base = _highest(touches)

    def _load_falls(self, time: float) -> bool:
        """Return whether nearly all fingers are not calm, and carry less than before.

        So it is where friction falls: all contacts begin to slide, smoothly, and the object falls.
        """
        if time - self._stepped_at < self._dead_time + self.again_time:
            return False
        if self._share_below(self.joint_calm) < self.joint_share:
            return False
        load = sum(finger.load for finger in self._fingers)
        return load < (1.0 - self.joint_fall) * sum(finger.calm_load for finger in self._fingers)

    def _share_below(self, threshold: float) -> float:
        """Return the share of the normal force on fingers whose probability is below."""
        total = below = 0.0
        for finger in self._fingers:
            total += finger.press
            below += finger.press * (finger.probability < threshold)
        return below / total if total > 0 else 0.0

    def _threshold_at(self, since: float) -> float:
        """Return the threshold at a time after the last step."""
        if since < self._dead_time:
            return 0.0
        again = since < self._dead_time + self.again_time
        return self.threshold_again if again else self.threshold

    def _react(self, touches: Sequence[Touch], lowest: float, time: float) -> None:
        """Set the targets of a step of all fingers."""
        pairs = list(zip(self._fingers, touches, strict=True))
        for finger, touch in pairs:
            if touch.slides and finger.counts:
                finger.learn()
        if time - self._stepped_at > self.episode_time:
            self._begin_episode(touches)
        steps = [self._step(finger, touch) for finger, touch in pairs]
        supporting = self.support * max(steps) if any(steps) else self.gain * self.least_step
        highest = self.most * self._base if lowest >= self.certain else math.inf
        for (finger, touch), step in zip(pairs, steps, strict=True):
            wanted = touch.scale * (1.0 + max(step, supporting))
            finger.target = max(touch.scale, min(wanted, highest))
        self._stepped_at = time
        largest = max(*steps, supporting)
        self._dead_time = self.first_dead_time + self.dead_time_growth * largest

    def _begin_episode(self, touches: Sequence[Touch]) -> None:
        """Remember the force of the grip that failed, if something slips."""
        self._base = _highest(touches)
        unstable = [
            touch.cause
            for finger, touch in zip(self._fingers, touches, strict=True)
            if finger.counts and finger.probability < self.threshold
        ]
        if any(finger.friction < math.inf for finger in self._fingers):
            return  # the friction is known: the floor follows the load
        if Cause.SLIP in unstable or Cause.LOST in unstable or not any(unstable):
            self._floor = max(self._floor, self.margin * self._base)

    def _step(self, finger: _Finger, touch: Touch) -> float:
        lack = 1.0 - finger.probability / self.threshold
        if lack <= 0 or not finger.counts:
            return 0.0
        step = self.gain * (self.least_step + (1.0 - self.least_step) * lack)
        shaking = touch.instability / touch.normal if touch.normal > 0 else 0.0
        return step + self.shaking_gain * min(shaking, LARGEST_SHAKING) if shaking > 0 else step

    def _wish(self, finger: _Finger, touch: Touch, lowest: float, time: float, dt: float) -> Wish:
        scale = touch.scale
        if finger.target > scale and time - self._stepped_at < self._dead_time:
            return finger.target, GripReason.UNSTABLE
        if self._moves:
            needed = min(finger.needed(), self.most * self._base)
            if needed > scale * (1.0 + DEADBAND):
                return needed, GripReason.LOAD
        if not touch.known or time - self._unsettled_at <= self.settle_time:
            return scale, _NONE
        finger.calm_load += min(dt / FOLLOW_TIME, 1.0) * (finger.load - finger.calm_load)
        finger.calm_scale = scale  # the load grows from here on: a fall is no growth
        sure = min((lowest - self.settled) / self.settled, 1.0)
        floor = max(self._floor, self._needed, 1.0)
        return min(scale, max(scale * (1.0 - self.fall * sure * dt), floor)), _RELAX

    def _balance(self, touches: Sequence[Touch], wishes: list[Wish]) -> list[Wish]:
        own = [scale for scale, _ in wishes]
        if min(own) == max(own):
            return wishes  # a grip that is only scaled stays balanced
        scales = balanced(own, self._forces, self._thumb)
        for k, scale in enumerate(scales):
            if scale > own[k]:
                raised = scale > touches[k].scale
                wishes[k] = scale, GripReason.BALANCE if raised else wishes[k][1]
        return wishes


def _highest(touches: Sequence[Touch]) -> float:
    return max(touch.scale for touch in touches)


def balanced(wanted: Sequence[float], forces: Sequence[float], opposed: int) -> list[float]:
    """Return the smallest balanced force scales that are at least the wanted ones.

    The forces f of the start are balanced: the finger `opposed`, t, carries the sum of the
    others. After a change by the scales s this holds if s_t = sum(s_j f_j) / sum(f_j) over the
    other fingers j. If the wanted s_t is the larger side, the smallest s_j are raised to a common
    value; otherwise s_t is raised. No scale is lowered.

    Args:
        wanted: (n,) force scale that each finger needs.
        forces: (n,) normal force of each finger when the grip began, any unit, at least 0.
        opposed: index of the finger opposite to all others.

    Returns:
        (n,) scales, none above the largest of `wanted`.

    Example:
        >>> balanced([1.0, 2.0, 1.0], [3.0, 1.0, 2.0], opposed=0)
        [1.3333333333333333, 2.0, 1.0]
        >>> balanced([2.0, 1.0, 1.5], [3.0, 1.0, 2.0], opposed=0)
        [2.0, 2.0, 2.0]
    """
    total = mean = 0.0
    for j, scale in enumerate(wanted):
        if j != opposed:
            total += forces[j]
            mean += scale * forces[j]
    out = list(wanted)
    if not total > 0:
        return out
    mean /= total
    if out[opposed] <= mean:
        out[opposed] = mean
    else:
        _raise_to_mean(out, forces, opposed, out[opposed] * total)
    return out


def _raise_to_mean(
    scales: list[float], forces: Sequence[float], opposed: int, needed: float
) -> None:
    """Raise the smallest scales to a common level, so that sum(s_j f_j) = needed."""
    order = sorted((j for j in range(len(scales)) if j != opposed), key=scales.__getitem__)
    above = sum(scales[j] * forces[j] for j in order)
    weight = 0.0
    level = scales[opposed]
    for k, j in enumerate(order):
        weight += forces[j]
        above -= scales[j] * forces[j]
        level = (needed - above) / weight if weight > 0 else level
        if k + 1 == len(order) or level <= scales[order[k + 1]]:
            break
    for j in order:
        scales[j] = max(scales[j], min(level, scales[opposed]))
