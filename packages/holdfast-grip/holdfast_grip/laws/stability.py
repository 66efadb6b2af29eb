"""The law `holdfast`: it sets one force scale for all fingers of the hand.

It reads slips, stability, load and friction. In a quiet grasp forces and moments balance, and a
common factor keeps both balances, however many fingers stand on either side. A law with a scale
for each finger has to correct the balance while it relaxes, and each correction is a rise.

Its rules have no units, so that they carry over between counts and newtons:

1. Doubt. The doubt in a finger is its probability of not being stable, or more if the slip rule of
   the model decides that it slides. The doubt in the hand is the mean over the fingers, weighted
   by their share of the normal force in the calm grip: a finger that carries little says little.
   Where the model has a slip rule, only the doubt counts that exceeds that of the calm grip, since
   a light grip that the model never saw is always "unstable"; it counts in full once a finger is
   decided to slide, and for less and after a longer time before.
2. Advance. The first of two speeds. While the hand is a little unstable and its load grows, the
   force follows the load that is foreseen for the time that the hand needs to respond, before
   anything slips. People raise grip and load force in parallel (R. S. Johansson and G. Westling,
   Exp. Brain Res. 56 (1984) 550-564). A calm hand gives it back.
3. Reaction, the second speed. The doubt above a level, summed over time, starts a step: at once if
   the hand surely slides, after some time if one finger does. The step grows with the doubt, and is
   smaller the harder the hand presses already. Where friction falls, all contacts slide smoothly
   and the hand carries less than in the calm grip: the missing share of the load adds to a doubt
   that is above its level, and the step is larger, because friction may fall further. A force that
   falls takes a part of the load with it, which is not missing. Where the calm grip itself is one
   that the model calls unstable, the missing load alone can start a step.
4. Hysteresis. A step shakes the contacts itself. So there is a refractory time without any step,
   and then, until the episode is over, a higher level. A force that falls stirs the contacts a
   little, and has a level of its own. What still slides when the hand has responded is no shaking.
5. What explains a doubt. A shock: forces that change suddenly when the doubt begins, as when a tool
   knocks, the arm bumps into something or the controller of the hand jerks, while a load comes
   and an object begins to slide smoothly. And a hand that presses more than it was told. After
   the blow itself, neither explains a missing load, nor a slide that the slip rule decides.
6. Response. When the object rests, the hand presses a little more for 0.2 s, and the law measures
   how long the sensors take to see it: latency, lag and bus together. A slow hand keeps a reserve
   of force in proportion to that time, because a slide runs on until the force comes.
7. Relaxation. In a calm grip the force falls slowly, to a margin above what the load needs at the
   friction that a step has shown: T/N of the fingers that slide, or of all fingers where none is
   decided to slide. The calm grip held at its own T/N, so the friction is not much lower than
   that. It is forgotten slowly.
8. A new grip. While a person may still hold the object, its load is not known: the hand presses
   more, and only a finger that is decided to slide starts a step.

Rules 6 and 8 and the shares of rules 1 and 2 need a slip rule; without one the law reacts to
instability.
"""

import math
from collections.abc import Sequence

from holdfast_grip.command import GripReason
from holdfast_grip.laws.base import ForceTarget, Law, Touch
from holdfast_grip.laws.loaded_finger import LoadedFinger
from holdfast_grip.laws.response import PROBE_RISE, HandResponse
from holdfast_grip.laws.shocks import Shocks

_NONE, _RELAX = GripReason.NONE, GripReason.RELAX

HOLD_LEVEL, FALL_LEVEL, AGAIN_LEVEL = 0.15, 0.5, 0.85
"""Doubt from which it counts: in a hold, while the force falls, and after a step."""
REACTION, UNCONFIRMED = 0.003, 0.015
"""Sum over time of the doubt above its level at which a step begins [s], and where a model with a
slip rule has not decided that a finger slides."""
STEP, STEP_GROWTH = 0.7, 0.4
"""Rise of the scale in a step from the first grip, without doubt, and its growth with the doubt;
from a higher scale, it is divided by that scale."""
MISSING_GAIN = 10.0
"""Growth of the doubt with the share of the load that is missing."""
REFRACTORY, EPISODE = 0.2, 0.6
"""Time after a step in which there is no other one, and in which its level holds [s]."""
GROWTH = 1.1
"""Ratio of what the load needs to the present force from which the force follows."""
CALM, SETTLE_TIME = 0.22, 0.15
"""Doubt below which the grip is calm, and the time before the force falls [s]."""
FALL = 0.5
"""Relative speed of the fall [1/s]."""
MARGIN = 1.25
"""Force to which a calm hand relaxes, as a multiple of what the load needs."""
MEMORY = 20.0
"""Time constant with which the friction is forgotten [s]."""
SMOOTHING = 0.02
"""Time constant of the tangential and normal forces [s]."""
FOLLOW_TIME, START_FOLLOW_TIME = 1.0, 0.1
"""Time constant with which the forces of the calm grip are followed [s], and in a new grip."""
START_TIME, START_SCALE = 0.7, 1.2
"""Time for which a grip is new [s], longer than a person takes to let go of the object, and the
least scale in it: people, too, press more when they take an object, until it rests."""
LEAST_FRICTION = 0.25
"""Least coefficient of friction that a slip can show."""
LARGEST_DOUBT = 2.0
"""Largest doubt, with the missing load, that enters a step."""
FALLING_STEP = 0.9
"""Growth of a step where the hand carries less than in the calm grip: friction falls."""
HELD_SHARE = 0.9
"""Least friction that a step can show, as a share of T/N of the calm grip, which held."""
PRESS_TIME = 0.1
"""Time for which a step is wanted after it began, so that the limit of speed lets it end [s]."""
BLIND = 0.5
"""Doubt of the calm grip from which the missing load alone can start a step."""
STILL_UNSTABLE = 0.5
"""Instability from which a finger that slides on, when the hand has responded, starts a step."""
UNSTABLE_SHARE = 0.7
"""Weight of an instability without a finger that is decided to slide. With 0.4 the hand answered
too few slides of the hard plant (12 % dropped in place of 6)."""
KICK_STEP = 0.2
"""Growth of a step with a slip rule, which starts fewer of them."""
RESPONSE_MARGIN = 0.04
"""Time after the response of the hand from which a slide that goes on starts another step [s]."""
RESERVE = 3.0
"""Reserve of a calm hand for its response time, as a share of the first grip [1/s]."""
ADVANCE_LEVEL, ADVANCE_PAUSE = 0.05, 0.03
"""Instability from which the force follows the load with a slip rule, and the time between two such
rises [s]; without the rule they are `HOLD_LEVEL` and `PRESS_TIME`."""
SQUEEZE, SQUEEZE_LOAD = 1.02, 0.97
"""Ratio to the commanded force and to the calm load from which a hand holds by pressing more."""
NEVER = -math.inf


class Stability(Law):
    """Law that reacts to the doubt in the hand, and follows the load.

    Args:
        kick: whether a step is larger with a slip rule.
        advance: whether the force follows a load that grows.
    """

    def __init__(self, *, kick: bool = True, advance: bool = True) -> None:
        self._kick, self._advances = kick, advance

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Take the present grip as the calm one."""
        self._knows_slips = knows_slips = any(touch.knows_slips for touch in touches)
        self._least_step = STEP + (KICK_STEP if knows_slips and self._kick else 0.0)
        self._advance_level = ADVANCE_LEVEL if knows_slips else HOLD_LEVEL
        self._advance_pause = ADVANCE_PAUSE if knows_slips else PRESS_TIME
        self._fingers = [LoadedFinger(touch) for touch in touches]
        self._start_force = sum(touch.start_normal for touch in touches)
        self._load = sum(finger.load for finger in self._fingers)
        self._press = sum(finger.press for finger in self._fingers)
        # The calm grip: `targets` follows it while the hand is calm, and the rules compare with it.
        self._calm_load, self._calm_press, self._calm_scale = self._load, self._press, 1.0
        self._calm_ratio = self._load / self._press if self._press > 0 else 0.0
        # Doubt above its level, summed over time, and the scale at which a step ends.
        self._sum = self._target = 0.0
        # No slip has shown it yet: the floor is `lowest` alone.
        self._friction = math.inf
        self._stepped_at = self._followed_at = self._fell_at = self._unsettled_at = NEVER
        self._started_at, self._is_new = math.nan, knows_slips
        self._rested_at = NEVER  # newest time without a doubt
        self._shocks, self._shock = Shocks(knows_slips=knows_slips), 0.0
        self._reason = GripReason.UNSTABLE
        self.response, self._probed_scale = HandResponse(measures=knows_slips), 0.0
        # Rate of the load; instability beyond that of the calm grip, and that of the calm grip.
        self._load_rate = self._unstable = self._base = 0.0
        self._scale, self._slides, self._all_known = 1.0, False, True

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Return the scale that doubt, load and friction need, the same for all fingers."""
        if math.isnan(self._started_at):
            self._started_at = time
        self._is_new = self._knows_slips and time - self._started_at < START_TIME
        doubt = self._observe(touches, dt)
        scale = self._scale
        if doubt > CALM:
            self._unsettled_at = time
        if self._unstable <= HOLD_LEVEL:
            self._rested_at = time
        self._shocks.update(self._shock, self._calm_press, time, dt, self._rested_at)
        is_calm = time - self._unsettled_at > SETTLE_TIME
        if is_calm:
            # Follow the forces of the calm grip.
            part = min(dt / (START_FOLLOW_TIME if self._is_new else FOLLOW_TIME), 1.0)
            self._calm_load += part * (self._load - self._calm_load)
            self._calm_press += part * (self._press - self._calm_press)
            if self._press > 0:
                self._calm_ratio += part * (self._load / self._press - self._calm_ratio)
            self._calm_scale = scale
            for finger in self._fingers:
                finger.share += part * (finger.press - finger.share)
                finger.base += part * (finger.doubt - finger.base)
        # It rises slowly, so the floor falls: an old slip says little about this contact.
        self._friction *= 1.0 + dt / MEMORY
        if not self._is_new:
            self._measure(touches, time, scale)
        self._react(doubt, scale, time, dt)
        # The limit of speed may spread a step over several samples.
        pressing = time - max(self._stepped_at, self._followed_at) < PRESS_TIME
        if pressing and self._target > scale:
            target = self._target, self._reason
        elif self.response.presses(time):
            target = max(scale, self._probed_scale), GripReason.MARGIN
        elif scale < self._lowest() and (self._is_new or not self.response.probes):
            target = self._lowest(), GripReason.MARGIN
        # UNKNOWN never lowers a force, and a force that falls would hide the response.
        elif is_calm and self._all_known and (self._is_new or not self.response.probes):
            target = self._relaxed(scale, time, dt), _RELAX
        else:
            target = scale, _NONE
        return [target] * len(touches)

    def _measure(self, touches: Sequence[Touch], time: float, scale: float) -> None:
        """Measure the response of the hand."""
        if self.response.update(touches, time, slides=self._slides):
            # The rise shakes the contacts, as a step does.
            self._stepped_at, self._target = time, 0.0
            self._probed_scale = (1.0 + PROBE_RISE) * scale
        if self.response.notice:
            self.notice, self.response.notice = self.response.notice, ""

    def _lowest(self) -> float:
        """Return the lowest scale in calm: a slow hand needs a reserve until it responds."""
        if self._is_new:
            return START_SCALE
        return 1.0 + RESERVE * self.response.time

    def _observe(self, touches: Sequence[Touch], dt: float) -> float:
        """Follow the forces and the scale; return the doubt in the hand."""
        # At most the whole step: after a pause the filter would overshoot.
        part = min(dt / SMOOTHING, 1.0)
        unstable = sliding = base = total = load = press = shock = scale = 0.0
        n_known = slides = 0
        knows_slips = self._knows_slips
        for finger, touch in zip(self._fingers, touches, strict=True):
            if touch.known:
                n_known += 1
                shock += finger.follow(touch, part)
            share, excess = finger.share, finger.doubt
            if finger.slides:
                slides += 1
                sliding += share * excess
            if knows_slips:
                base += share * finger.base
                excess -= finger.base
            if excess > 0.0:
                unstable += share * excess
            total += share
            load += finger.load
            press += finger.press
            scale = max(scale, touch.scale)
        # The rate at which the filtered load changes.
        self._load_rate += part * ((load - self._load) / dt - self._load_rate) if dt > 0 else 0.0
        self._load, self._press, self._shock, self._scale = load, press, shock, scale
        self._all_known, self._slides = n_known == len(touches), slides > 0
        self._unstable = unstable / total if total > 0 else 0.0
        self._base = base / total if total > 0 else 0.0
        # The calm grip of an object that a person still holds is not known: only slides count.
        if self._is_new and not self._slides:
            self._unstable = 0.0
        if not knows_slips or total <= 0:
            return self._unstable
        # A finger that is decided to slide confirms the instability of the others.
        if self._slides:
            return max(sliding / total, self._unstable)
        # A hand that presses more than it was told, and carries its load, holds: as when its
        # controller jerks.
        squeezes = press * self._calm_scale > SQUEEZE * self._calm_press * scale
        if squeezes and load >= SQUEEZE_LOAD * self._calm_load:
            return 0.0
        return UNSTABLE_SHARE * self._unstable

    def _react(self, doubt: float, scale: float, time: float, dt: float) -> None:
        """Begin a step if the doubt lasts; else follow a load that grows."""
        is_blind = self._knows_slips and self._base > BLIND
        # In nearly all samples of a hold nothing asks for a reaction.
        if max(doubt, self._unstable) <= self._advance_level and not (self._sum or is_blind):
            return
        if self._is_new and not self._slides:
            self._sum = 0.0
            return
        since = time - self._stepped_at
        refractory = REFRACTORY
        # What still slides when the hand has responded to a step needs another one.
        slides_on = self._slides and self._unstable >= STILL_UNSTABLE
        if slides_on:
            refractory = min(refractory, self.response.time + RESPONSE_MARGIN)
        carried = self._load / self._calm_load if self._calm_load > 0 else 1.0
        if since < refractory or self._shocks.explain(
            time, self._rested_at, carried, slides=self._slides
        ):
            self._sum = 0.0
            return
        missing, load = 0.0, self._calm_load
        if not self._is_new and (self._unstable > HOLD_LEVEL or is_blind):
            # Load that a falling force takes along is not missing: 50 false rises in 34 long holds
            # became 14 (docs/decisions/0025). The calm grip follows later than the force falls.
            if self._calm_press > 0:
                load *= min(self._press / self._calm_press, 1.0)
            missing = max(1.0 - self._load / load, 0.0) if load > 0 else 0.0
        evidence = doubt + MISSING_GAIN * missing
        # A step and a fall count until the doubt has come below its level once, a fall for an
        # episode at least.
        level = HOLD_LEVEL
        if since < EPISODE and not slides_on:
            level = AGAIN_LEVEL
        elif (
            self._rested_at < max(self._stepped_at, self._fell_at) or time - self._fell_at < EPISODE
        ):
            level = FALL_LEVEL
        self._sum = max(0.0, self._sum + (evidence - level) * dt)
        is_sure = self._slides or not self._knows_slips
        if self._sum >= (REACTION if is_sure else UNCONFIRMED):
            self._step(min(evidence, LARGEST_DOUBT), scale, time, missing)
        elif self._advances and self._unstable > self._advance_level:
            self._follow_load(scale, time)

    def _step(self, evidence: float, scale: float, time: float, missing: float) -> None:
        """Begin a step; the first one of an episode shows the friction."""
        if time - self._stepped_at >= EPISODE and not self._is_new:
            # Take T/N of the fingers that slide, or of all, as the friction, if it is lower.
            sliding = [finger for finger in self._fingers if finger.slides] or self._fingers
            press = sum(finger.press for finger in sliding)
            if press > 0:
                ratio = sum(finger.load for finger in sliding) / press
                least = max(LEAST_FRICTION, HELD_SHARE * self._calm_ratio)
                self._friction = min(self._friction, max(ratio, least))
        step = self._least_step + STEP_GROWTH * evidence
        if missing > 0:
            step += FALLING_STEP
        self._target = scale + step / max(scale, 1.0)
        self._stepped_at, self._reason, self._sum = time, GripReason.UNSTABLE, 0.0
        self.response.begin_step(time, self._press)

    def _follow_load(self, scale: float, time: float) -> None:
        """Follow a load that has grown beyond the margin; a fall of N alone is no growth."""
        if not (self._press > 0 and self._calm_ratio > 0 and self._calm_load > 0):
            return
        # The load when the hand will have responded; without a response time, that of now.
        load = self._load + max(self.response.time * self._load_rate, 0.0)
        by_growth = self._calm_scale * load / self._calm_load
        needed = min(by_growth, scale * load / self._press / self._calm_ratio)
        if needed > GROWTH * scale and time - self._followed_at > self._advance_pause:
            # With a short pause it may follow during a step, whose end may be higher.
            self._target = max(GROWTH * needed, self._target if self._knows_slips else 0.0)
            self._followed_at, self._reason = time, GripReason.LOAD

    def _relaxed(self, scale: float, time: float, dt: float) -> float:
        """Return a scale that falls to what the load needs, the lowest at least."""
        # What the load needs at the friction that slips have shown.
        force = self._friction * self._start_force
        needed = MARGIN * self._load / force if force > 0 else 0.0
        relaxed = min(scale, max(scale * (1.0 - FALL * dt), self._lowest(), needed))
        if relaxed < scale:
            self._fell_at = time
        return relaxed
