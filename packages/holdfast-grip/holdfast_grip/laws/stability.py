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
6. Response. At the start the hand presses a little more for 0.2 s, and the law measures how long
   the sensors take to see it: latency, lag and bus together. A slow hand keeps a reserve of force
   in proportion to that time, because a slide runs on until the force comes.
7. Relaxation. In a calm grip the force falls slowly, to a margin above what the load needs at the
   friction that a step has shown: T/N of the fingers that slide, or of all fingers where none is
   decided to slide. The calm grip held at its own T/N, so the friction is not much lower than
   that. It is forgotten slowly.

Rule 6 and the shares of rules 1 and 2 need a slip rule; without one the law reacts to instability.
"""

import math
from collections.abc import Sequence

from holdfast_grip.command import GripReason
from holdfast_grip.laws.base import ForceTarget, Law, Touch
from holdfast_grip.laws.response import ResponseTimer

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
SHOCK, SHOCK_NOISE = 0.03, 4.0
"""Change of the change of the forces between two samples from which it is a shock: sum over the
fingers as a share of the normal force, and over its running mean. On the twin at 150 Hz it is 0.05
to 0.3 in impacts and jerks, and 0.01 to 0.03 when a load comes or a slide begins."""
SHOCK_SAMPLE = 1 / 150
"""Time between two samples for which `SHOCK` holds; it grows with a longer time [s]."""
NOISE_TIME = 0.5
"""Time constant of that running mean [s]."""
BLOW_TIME = 0.03
"""Time for which a shock explains everything, even a slide [s]: most stop by themselves. With 0.05
the hand answered 2 % fewer impacts, and dropped more where friction fell."""
SHOCK_TIME, LONGEST_SHOCK = 0.25, 1.0
"""Time for which a shock explains a doubt [s]: two periods of a hand that rings at 8 Hz; with a
slip rule, which decides whether a finger slides, until the doubt has come to rest, at most this."""
SHOCK_LAG, SHORT_SHOCK_LAG = 0.014, 0.007
"""Time after a doubt began within which a shock explains it [s]; without a slip rule it is shorter,
because the shock would hide the slide of a hand that slid before it."""
UNCONFIRMED = 0.015
"""Sum over time of the doubt at which a step begins where no finger is decided to slide [s]."""
BLIND = 0.5
"""Doubt of the calm grip from which the missing load alone can start a step."""
STILL_UNSTABLE = 0.5
"""Instability from which a finger that slides on, when the hand has responded, starts a step."""
UNSTABLE_SHARE = 0.7
"""Weight of an instability without a finger that is decided to slide. With 0.4 the hand answered
too few slides of the hard plant (12 % dropped in place of 6)."""
KICK_STEP, KICK_MARGIN = 0.2, 0.1
"""What step and margin are larger by with a slip rule, which starts fewer of them."""
RESPONSE_MARGIN = 0.04
"""Time after the response of the hand from which a slide that goes on starts another step [s]."""
RESERVE = 3.0
"""Reserve of a calm hand for its response time, as a share of the first grip [1/s]."""
ADVANCE_LEVEL, ADVANCE_PAUSE = 0.05, 0.03
"""Instability from which the force follows the load, and the time between two such rises [s]."""
SQUEEZE, SQUEEZE_LOAD = 1.02, 0.97
"""Ratio to the commanded force and to the calm load from which a hand holds by pressing more."""
SHOCK_MISSING_LOAD = 0.1
"""Share of the load of the calm grip that is missing from which a shock explains nothing: half of
what contacts lose when all begin to slide, where kinetic friction is 20 to 27 % lower."""
PROBE_DELAY, PROBE_TIME, PROBE_RISE = 0.05, 0.26, 0.06
"""When the loop presses more, how long, and by what share, to measure the response of the hand."""
LONGEST_LEAD = 0.12
"""Longest response time that counts [s]: the rate at which a load changes is known no further."""
CHANGED_RESPONSE = 0.03, 0.5
"""Change of the response time that is reported to the user, in seconds and as a share."""
NEVER = -math.inf


class _Finger:
    """Forces and doubt of a finger."""

    __slots__ = ("base", "doubt", "drag", "last", "load", "press", "rise", "share", "slides")

    def __init__(self, touch: Touch) -> None:
        self.load = touch.tangential
        self.press = self.share = touch.normal
        # Newest forces, not filtered, and how they changed in the last sample.
        self.last = touch.normal, touch.tangential
        self.rise = self.drag = 0.0
        self.doubt, self.slides = 0.0, False
        # Doubt of the calm grip, which says nothing about a slip.
        self.base = 1.0 - touch.probability if touch.touching else 1.0

    def follow(self, touch: Touch, part: float) -> float:
        """Take a part of the difference to the present forces, and the present doubt.

        Returns:
            How much the change of the forces differs from that of the last sample.
        """
        self.load += part * (touch.tangential - self.load)
        self.press += part * (touch.normal - self.press)
        rise, drag = touch.normal - self.last[0], touch.tangential - self.last[1]
        shock = abs(rise - self.rise) + abs(drag - self.drag)
        self.last, self.rise, self.drag = (touch.normal, touch.tangential), rise, drag
        self.slides = touch.slides
        self.doubt = 1.0 - touch.probability if touch.touching else 1.0
        if touch.slides:
            sliding = SLIDING_DOUBT + (1.0 - SLIDING_DOUBT) * touch.slip_probability
            self.doubt = max(self.doubt, sliding)
        return shock


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
        self._knows_slips = knows_slips = any(touch.knows_slips for touch in touches)
        self._least_step = self.least_step + (KICK_STEP if knows_slips else 0.0)
        self._margin = self.margin + (KICK_MARGIN if knows_slips else 0.0)
        self._advance_level = ADVANCE_LEVEL if knows_slips else self.hold_level
        self._advance_pause = ADVANCE_PAUSE if knows_slips else PRESS_TIME
        self._fingers = [_Finger(touch) for touch in touches]
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
        # Newest shock that explains a doubt, and newest time without a doubt.
        self._shocked_at = self._rested_at = NEVER
        # Shock of this sample, and its running mean: the noise of the sensors.
        self._shock, self._noise = 0.0, 0.01 * self._press
        self._reason = GripReason.UNSTABLE
        # Response time of the hand: 0 until it is known, and where it cannot be measured.
        self.response, self._timer = 0.0, ResponseTimer()
        self._probes = knows_slips  # until the response was measured
        self._n_changed = 0  # steps in a row with another response
        self._started_at = math.nan
        self._first_press, self._n_first = 0.0, 0
        # Rate of the load; instability beyond that of the calm grip, and that of the calm grip.
        self._load_rate = self._unstable = self._base = 0.0
        self._scale, self._slides, self._all_known = 1.0, False, True

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Return the scale that doubt, load and friction need, the same for all fingers."""
        doubt = self._observe(touches, dt)
        scale = self._scale
        if doubt > self.calm:
            self._unsettled_at = time
        if self._unstable <= self.hold_level:
            self._rested_at = time
        self._notice_shock(time, dt)
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
                finger.base += part * (finger.doubt - finger.base)
        # It rises slowly, so the floor falls: an old slip says little about this contact.
        self._friction *= 1.0 + dt / self.memory
        if self._probes or self._timer.running:
            self._measure(touches, time)
        self._react(doubt, scale, time, dt)
        # The limit of speed may spread a step over several samples.
        pressing = time - max(self._stepped_at, self._followed_at) < PRESS_TIME
        if pressing and self._target > scale:
            target = self._target, self._reason
        elif self._probes and PROBE_DELAY <= time - self._started_at < PROBE_TIME:
            target = max(scale, 1.0 + PROBE_RISE), GripReason.MARGIN
        elif self._knows_slips and not self._probes and scale < self._lowest():
            target = self._lowest(), GripReason.MARGIN
        # UNKNOWN never lowers a force.
        elif is_calm and self._all_known:
            target = self._relaxed(scale, time, dt), _RELAX
        else:
            target = scale, _NONE
        return [target] * len(touches)

    def _lowest(self) -> float:
        """Return the lowest scale in calm: a slow hand needs a reserve until it responds."""
        return self.lowest + RESERVE * self.response

    def _measure(self, touches: Sequence[Touch], time: float) -> None:
        """Measure the response of the hand: by a small rise at the start, and then by its steps."""
        press = sum(touch.normal for touch in touches)
        if self._probes:
            if math.isnan(self._started_at):
                self._started_at = time
            if time - self._started_at < PROBE_DELAY:
                self._first_press += press
                self._n_first += 1
            elif not self._timer.running:
                self._timer.begin(time, self._first_press / max(self._n_first, 1))
                # The rise shakes the contacts, as a step does.
                self._stepped_at = time
            if self._slides:  # a slide changes the force too
                self._timer.stop()
                self._probes = False
                self.notice = "no response time of the hand: something slid at the start"
        if self._timer.update(time, press):
            self._take_response(self._timer.result)

    def _take_response(self, response: float) -> None:
        """Take the first response time; compare later ones with it."""
        if self._probes:
            self._probes = False
            if math.isnan(response):
                self.notice = "no response time of the hand: its force did not follow the command"
            else:
                self.response = min(response, LONGEST_LEAD)
            return
        least, share = CHANGED_RESPONSE
        change = abs(response - self.response)
        # A step in a slide measures roughly: two in a row must agree.
        is_changed = self.response > 0 and change > max(least, share * self.response)
        self._n_changed = self._n_changed + 1 if is_changed else 0
        if self._n_changed == 2:
            self.notice = (
                f"the response time of the hand changed from {1e3 * self.response:.0f} to "
                f"{1e3 * response:.0f} ms: start again, so that the law knows it"
            )

    def _observe(self, touches: Sequence[Touch], dt: float) -> float:
        """Follow the forces and the scale; return the doubt in the hand."""
        # At most the whole step: after a pause the filter would overshoot.
        part = min(dt / SMOOTHING, 1.0)
        unstable = sliding = base = total = load = press = shock = scale = 0.0
        known = slides = 0
        knows_slips = self._knows_slips
        for finger, touch in zip(self._fingers, touches, strict=True):
            if touch.known:
                known += 1
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
        self._all_known, self._slides = known == len(touches), slides > 0
        self._unstable = unstable / total if total > 0 else 0.0
        self._base = base / total if total > 0 else 0.0
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

    def _notice_shock(self, time: float, dt: float) -> None:
        """Take the time of a shock that begins with the doubt, and follow the noise."""
        # A load that comes smoothly changes its rate more within a longer sample.
        longer = max(dt / SHOCK_SAMPLE, 1.0)
        limit = max(SHOCK * longer * self._calm_press, SHOCK_NOISE * self._noise)
        lag = SHOCK_LAG if self._knows_slips else SHORT_SHOCK_LAG
        if self._shock > limit and time - self._rested_at <= lag:
            self._shocked_at = time
        # At most twice the noise, so that a shock is no part of its own measure.
        part = min(dt / NOISE_TIME, 1.0)
        self._noise += part * (min(self._shock, 2.0 * self._noise) - self._noise)

    def _is_explained(self, time: float) -> bool:
        """Return whether a shock explains the doubt."""
        since = time - self._shocked_at
        is_held = self._load >= (1.0 - SHOCK_MISSING_LOAD) * self._calm_load
        if not self._knows_slips:
            return is_held and since < SHOCK_TIME
        if since < BLOW_TIME:
            return True
        # Until the instability that it began has come to rest; a slide is no part of it.
        lasts = self._rested_at <= self._shocked_at and since < LONGEST_SHOCK
        return lasts and is_held and not self._slides

    def _react(self, doubt: float, scale: float, time: float, dt: float) -> None:
        """Begin a step if the doubt lasts; else follow a load that grows."""
        is_blind = self._knows_slips and self._base > BLIND
        # In nearly all samples of a hold nothing asks for a reaction.
        if max(doubt, self._unstable) <= self._advance_level and not (self._sum or is_blind):
            return
        since = time - self._stepped_at
        refractory = self.refractory
        # What still slides when the hand has responded to a step needs another one.
        slides_on = self._slides and self._unstable >= STILL_UNSTABLE
        if slides_on:
            refractory = min(refractory, self.response + RESPONSE_MARGIN)
        if since < refractory or self._is_explained(time):
            self._sum = 0.0
            return
        is_falling = time - self._fell_at < self.episode
        missing, load = 0.0, self._calm_load
        if self._unstable > self.hold_level or is_blind:
            # Load that a falling force takes along is not missing: 50 false rises in 34 long holds
            # became 14 (docs/decisions/0025).
            if is_falling and self._calm_press > 0:
                load *= min(self._press / self._calm_press, 1.0)
            missing = max(1.0 - self._load / load, 0.0) if load > 0 else 0.0
        evidence = doubt + self.missing_gain * missing
        # A step counts until the doubt has come below its level once, a fall for an episode.
        level = self.hold_level
        if since < self.episode and not slides_on:
            level = self.again_level
        elif self._rested_at < self._stepped_at or is_falling:
            level = self.fall_level
        self._sum = max(0.0, self._sum + (evidence - level) * dt)
        is_sure = self._slides or not self._knows_slips
        if self._sum >= (self.reaction if is_sure else UNCONFIRMED):
            self._step(min(evidence, LARGEST_DOUBT), scale, time, missing)
        elif self._unstable > self._advance_level:
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
        step = self._least_step + self.step_growth * evidence
        if missing > 0:
            step += FALLING_STEP
        self._target = scale + step / max(scale, 1.0)
        self._stepped_at, self._reason, self._sum = time, GripReason.UNSTABLE, 0.0
        if self.response > 0:
            self._timer.begin(time, self._press)

    def _follow_load(self, scale: float, time: float) -> None:
        """Follow a load that has grown beyond the margin; a fall of N alone is no growth."""
        if not (self._press > 0 and self._calm_ratio > 0 and self._calm_load > 0):
            return
        # The load when the hand will have responded; without a response time, that of now.
        load = self._load + max(self.response * self._load_rate, 0.0)
        by_growth = self._calm_scale * load / self._calm_load
        needed = min(by_growth, scale * load / self._press / self._calm_ratio)
        if needed > self.growth * scale and time - self._followed_at > self._advance_pause:
            # With a short pause it may follow during a step, whose end may be higher.
            self._target = max(self.growth * needed, self._target if self._knows_slips else 0.0)
            self._followed_at, self._reason = time, GripReason.LOAD

    def _relaxed(self, scale: float, time: float, dt: float) -> float:
        """Return a scale that falls to what the load needs, `lowest` at least."""
        # What the load needs at the friction that slips have shown.
        force = self._friction * self._start_force
        needed = self._margin * self._load / force if force > 0 else 0.0
        relaxed = min(scale, max(scale * (1.0 - self.fall * dt), self._lowest(), needed))
        if relaxed < scale:
            self._fell_at = time
        return relaxed
