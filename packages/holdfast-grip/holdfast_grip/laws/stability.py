"""The law of holdfast: one grip force for the hand, from slips, stability, load and friction.

The law has one force scale for all fingers. In a quiet grasp forces and moments balance, and a
common factor keeps both balances, however many fingers stand on either side. A law with a scale
for each finger has to correct the balance while it relaxes, and each correction is a rise.

Its rules have no units, so that they carry over between counts and newtons:

1. Doubt. The doubt in a finger is its probability of not being stable, or more if the slip rule of
   the model decides that it slides. The doubt in the hand is the mean over the fingers, weighted
   by their share of the normal force in the calm grip: a finger that carries little says little.
2. Reaction. The doubt above a level, summed over time, starts a step: at once if the hand surely
   slides, after some time if one finger does. The step grows with the doubt, and is smaller the
   harder the hand presses already. Where friction falls, all contacts slide smoothly and the hand
   carries less than in the calm grip: the missing share of the load adds to a doubt that is above
   its level, and the step is larger, because friction may fall further. A force that falls takes a
   part of the load with it, which is not missing.
3. Hysteresis. A step shakes the contacts itself. So there is a refractory time without any step,
   and then, until the episode is over, a higher level. A force that falls stirs the contacts a
   little, and has a level of its own.
4. Margin. While the hand is in doubt it keeps the ratio of tangential to normal force T/N of the
   calm grip: if the load grows so that T/N is beyond a margin, the force follows before anything
   slips. People raise grip and load force in parallel (R. S. Johansson and G. Westling, Exp. Brain
   Res. 56 (1984) 550-564).
5. Jerks. Where the hand reports its joints, a jerk of its own controller explains a doubt that
   begins with it. For a short time such a doubt starts nothing, unless load is missing. A doubt
   that lasts longer is a slip that the jerk began.
6. Relaxation. In a calm grip the force falls slowly, to a margin above what the load needs at the
   friction that a step has shown: T/N of the fingers that slide, or of all fingers where none is
   decided to slide. The calm grip held at its own T/N, so the friction is not much lower than
   that. It is forgotten slowly.
"""

import math
from collections.abc import Sequence

from holdfast_grip.command import GripReason
from holdfast_grip.laws.base import Law, Touch, Wish

_NONE, _RELAX = GripReason.NONE, GripReason.RELAX

SMOOTHING = 0.02
"""Time constant of the tangential and normal forces [s]."""
FOLLOW_TIME = 1.0
"""Time constant with which the forces of the calm grip are followed [s]."""
LEAST_FRICTION = 0.25
"""Least coefficient of friction that a slip can show."""
SLIDING_DOUBT = 0.7
"""Least doubt in a finger that is decided to slide."""
LARGEST_DOUBT = 2.0
"""Largest doubt, with the missing load, that enters a step."""
FALLING_STEP = 0.9
"""What a step is larger by where the hand carries less than in the calm grip: friction falls."""
HELD_SHARE = 0.9
"""Least friction that a step can show, as a share of T/N of the calm grip, which held."""
PRESS_TIME = 0.1
"""Time for which a step is wanted after it began, so that the limit of speed lets it end [s]."""
JERK_TIME = 0.25
"""Time for which a jerk of the hand explains a doubt [s]: two periods of its ringing, 8 Hz."""
JERK_LAG = 0.007
"""Time after a doubt began within which a jerk explains it [s]: joints and taxels have clocks and
delays of their own."""
JERK_MISSING_LOAD = 0.1
"""Share of the load of the calm grip that is missing from which a jerk explains nothing: half of
what contacts lose when all begin to slide, where kinetic friction is 20 to 27 % lower."""
NEVER = -math.inf


class _Finger:
    """Forces and doubt of a finger."""

    __slots__ = ("doubt", "load", "press", "share", "slides")

    def __init__(self, touch: Touch) -> None:
        self.load = touch.tangential
        self.press = self.share = touch.normal
        self.doubt, self.slides = 0.0, False

    def follow(self, touch: Touch, part: float) -> None:
        """Take a part of the difference to the present forces, and the present doubt."""
        self.load += part * (touch.tangential - self.load)
        self.press += part * (touch.normal - self.press)
        self.slides = touch.slides
        self.doubt = 1.0 - touch.probability if touch.touching else 1.0
        if touch.slides:
            sliding = SLIDING_DOUBT + (1.0 - SLIDING_DOUBT) * touch.slip_probability
            self.doubt = max(self.doubt, sliding)


class Stability(Law):
    """Law that reacts to the doubt in the hand, and follows the load.

    Args:
        levels: doubt from which it counts: in a hold, while the force falls, and after a step.
        reaction: sum over time of the doubt above its level at which a step begins [s].
        step: rise of the scale in a step from the first grip, without doubt, and its growth with
            the doubt; from a higher scale, it is divided by that scale.
        missing_gain: growth of the doubt with the share of the load that is missing.
        refractory: time after a step in which there is no other one [s].
        episode: time after a step in which its level holds [s].
        growth: ratio of what the load needs to the present force from which the force follows.
        calm: doubt below which the grip is calm, for `settle_time` [s], before the force falls.
        settle_time: see `calm`.
        fall: relative speed of the fall [1/s].
        margin: force to which a calm hand relaxes, as a multiple of what the load needs.
        memory: time constant with which the friction is forgotten [s].
        lowest: scale to which a calm hand may relax; below 1, lighter than the first grip. The
            controller keeps it above `Limits.min_scale`.
    """

    def __init__(
        self,
        *,
        levels: tuple[float, float, float] = (0.15, 0.5, 0.85),
        reaction: float = 0.003,
        step: tuple[float, float] = (0.7, 0.4),
        missing_gain: float = 10.0,
        refractory: float = 0.2,
        episode: float = 0.6,
        growth: float = 1.1,
        calm: float = 0.22,
        settle_time: float = 0.15,
        fall: float = 0.5,
        margin: float = 1.25,
        memory: float = 20.0,
        lowest: float = 1.0,
    ) -> None:
        self.hold_level, self.fall_level, self.again_level = levels
        self.reaction, self.missing_gain = reaction, missing_gain
        self.least_step, self.step_growth = step
        self.refractory, self.episode = refractory, episode
        self.growth, self.calm, self.settle_time = growth, calm, settle_time
        self.fall, self.margin, self.memory, self.lowest = fall, margin, memory, lowest

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Take the present grip as the calm one."""
        self._fingers = [_Finger(touch) for touch in touches]
        self._start_force = sum(touch.start_normal for touch in touches)
        self._load = sum(finger.load for finger in self._fingers)
        self._press = sum(finger.press for finger in self._fingers)
        # The calm grip: `wishes` follows it while the hand is calm, and the rules compare with it.
        self._calm_load, self._calm_press, self._calm_scale = self._load, self._press, 1.0
        self._calm_ratio = self._load / self._press if self._press > 0 else 0.0
        # Doubt above its level, summed over time, and the scale at which a step ends.
        self._sum = self._target = 0.0
        # No slip has shown it yet: the floor is `lowest` alone.
        self._friction = math.inf
        self._stepped_at = self._followed_at = self._fell_at = self._unsettled_at = NEVER
        # Newest jerk that explains a doubt, and newest time without a doubt.
        self._jerked_at = self._rested_at = NEVER
        self._reason = GripReason.UNSTABLE

    def wishes(self, touches: Sequence[Touch], time: float, dt: float) -> list[Wish]:
        """Return the scale that doubt, load and friction need, the same for all fingers."""
        scale = max(touch.scale for touch in touches)
        doubt = self._observe(touches, dt)
        if doubt > self.calm:
            self._unsettled_at = time
        if doubt <= self.hold_level:
            self._rested_at = time
        # A jerk explains only a doubt that follows it; all touches have the same jerk.
        if touches[0].jerked and time - self._rested_at <= JERK_LAG:
            self._jerked_at = time
        is_calm = time - self._unsettled_at > self.settle_time
        if is_calm:
            # Follow the forces of the calm grip.
            part = min(dt / FOLLOW_TIME, 1.0)
            self._calm_load += part * (self._load - self._calm_load)
            self._calm_press += part * (self._press - self._calm_press)
            if self._press > 0:
                self._calm_ratio += part * (self._load / self._press - self._calm_ratio)
            self._calm_scale = scale
            for finger in self._fingers:
                finger.share += part * (finger.press - finger.share)
        # It rises slowly, so the floor falls: an old slip says little about this contact.
        self._friction *= 1.0 + dt / self.memory
        self._react(doubt, scale, time, dt)
        # The limit of speed may spread a step over several samples.
        pressing = time - max(self._stepped_at, self._followed_at) < PRESS_TIME
        if pressing and self._target > scale:
            wish = self._target, self._reason
        # UNKNOWN never lowers a force.
        elif is_calm and all(touch.known for touch in touches):
            wish = self._relaxed(scale, time, dt), _RELAX
        else:
            wish = scale, _NONE
        return [wish] * len(touches)

    def _observe(self, touches: Sequence[Touch], dt: float) -> float:
        """Follow the forces; return the doubt in the hand."""
        # At most the whole step: after a pause the filter would overshoot.
        part = min(dt / SMOOTHING, 1.0)
        doubt = total = load = press = 0.0
        for finger, touch in zip(self._fingers, touches, strict=True):
            if touch.known:
                finger.follow(touch, part)
            doubt += finger.share * finger.doubt
            total += finger.share
            load += finger.load
            press += finger.press
        self._load, self._press = load, press
        return doubt / total if total > 0 else 0.0

    def _react(self, doubt: float, scale: float, time: float, dt: float) -> None:
        """Begin a step if the doubt lasts; else follow a load that grows."""
        since = time - self._stepped_at
        # A jerk of the hand explains a doubt, unless load is missing.
        is_held = self._load >= (1.0 - JERK_MISSING_LOAD) * self._calm_load
        if since < self.refractory or (is_held and time - self._jerked_at < JERK_TIME):
            self._sum = 0.0
            return
        is_falling = time - self._fell_at < self.episode
        missing, load = 0.0, self._calm_load
        if doubt > self.hold_level:
            # Load that a falling force takes along is not missing: 50 false rises in 34 long holds
            # became 14 (docs/decisions/0025).
            if is_falling and self._calm_press > 0:
                load *= min(self._press / self._calm_press, 1.0)
            missing = max(1.0 - self._load / load, 0.0) if load > 0 else 0.0
        evidence = doubt + self.missing_gain * missing
        # A step counts until the doubt has come below its level once, a fall for an episode.
        level = self.hold_level
        if since < self.episode:
            level = self.again_level
        elif self._rested_at < self._stepped_at or is_falling:
            level = self.fall_level
        self._sum = max(0.0, self._sum + (evidence - level) * dt)
        if self._sum >= self.reaction:
            self._step(min(evidence, LARGEST_DOUBT), scale, time, missing)
        elif doubt > self.hold_level:
            self._follow_load(scale, time)

    def _step(self, evidence: float, scale: float, time: float, missing: float) -> None:
        """Begin a step; the first one of an episode shows the friction."""
        if time - self._stepped_at >= self.episode:
            # Take T/N of the fingers that slide, or of all, as the friction, if it is lower.
            sliding = [finger for finger in self._fingers if finger.slides] or self._fingers
            press = sum(finger.press for finger in sliding)
            if press > 0:
                ratio = sum(finger.load for finger in sliding) / press
                least = max(LEAST_FRICTION, HELD_SHARE * self._calm_ratio)
                self._friction = min(self._friction, max(ratio, least))
        step = self.least_step + self.step_growth * evidence
        if missing > 0:
            step += FALLING_STEP
        self._target = scale + step / max(scale, 1.0)
        self._stepped_at, self._reason, self._sum = time, GripReason.UNSTABLE, 0.0

    def _follow_load(self, scale: float, time: float) -> None:
        """Follow a load that has grown beyond the margin; a fall of N alone is no growth."""
        if not (self._press > 0 and self._calm_ratio > 0 and self._calm_load > 0):
            return
        by_growth = self._calm_scale * self._load / self._calm_load
        needed = min(by_growth, scale * self._load / self._press / self._calm_ratio)
        if needed > self.growth * scale and time - self._followed_at > PRESS_TIME:
            self._target = self.growth * needed
            self._followed_at, self._reason = time, GripReason.LOAD

    def _relaxed(self, scale: float, time: float, dt: float) -> float:
        """Return a scale that falls to what the load needs, `lowest` at least."""
        # What the load needs at the friction that slips have shown.
        force = self._friction * self._start_force
        needed = self.margin * self._load / force if force > 0 else 0.0
        relaxed = min(scale, max(scale * (1.0 - self.fall * dt), self.lowest, needed))
        if relaxed < scale:
            self._fell_at = time
        return relaxed
