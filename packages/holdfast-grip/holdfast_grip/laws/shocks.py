"""Sudden changes of the forces, as of a blow: they explain a doubt that begins with them."""

import math

SHOCK = 0.03
"""Change of the change of the forces between two samples from which it is a shock: the sum over the
fingers, as a share of the normal force. On the twin at 150 Hz it is 0.05 to 0.3 in impacts and
jerks, and 0.01 to 0.03 when a load comes or a slide begins."""
SHOCK_NOISE = 3.0
"""The same over the noise: the fourth root of the running mean of its fourth power. Readings that
rest between steps have a small mean, but steps in 1 of 81 samples are noise by this measure.
Shocks in quiet holds of real sensors are counted in docs/study/grip.md."""
SHOCK_SAMPLE = 1 / 150
"""Time between two samples for which both hold [s]; they grow with a longer time, in which a load
that comes, or an arm that moves, changes its rate more."""
NOISE_TIME = 2.0
"""Time constant of that running mean [s]; before it has passed, all samples count alike."""
LEARNING_TIME = 0.1
"""Time in which the noise is measured before anything is a shock [s]."""
BLOW_TIME = 0.03
"""Time for which a shock explains everything, even a slide [s]: most stop by themselves. With 0.05
the hand answered 2 % fewer impacts, and dropped more where friction fell."""
SHOCK_TIME, LONGEST_SHOCK = 0.25, 1.0
"""Time for which a shock explains a doubt [s]: two periods of a hand that rings at 8 Hz; with a
slip rule, which decides whether a finger slides, until the doubt has come to rest, at most this."""
SHOCK_LAG, SHORT_SHOCK_LAG = 0.014, 0.007
"""Time after a doubt began within which a shock explains it [s]; without a slip rule it is shorter,
because the shock would hide the slide of a hand that slid before it."""
SHOCK_MISSING_LOAD = 0.1
"""Share of the load of the calm grip that is missing from which a shock explains nothing: half of
what contacts lose when all begin to slide, where kinetic friction is 20 to 27 % lower."""


class Shocks:
    """Find shocks among the changes of the forces, and what they explain.

    Args:
        knows_slips: whether the model has a slip rule.

    Example:
        >>> shocks = Shocks(knows_slips=True)
        >>> noise = [0.001, 0.0, 0.002, 0.001] * 10
        >>> [k for k, x in enumerate([*noise, 0.2]) if shocks.update(x, 1.0, k / 150, 1 / 150, 0.0)]
        [40]
    """

    def __init__(self, *, knows_slips: bool) -> None:
        self._knows_slips = knows_slips
        self._lag = SHOCK_LAG if knows_slips else SHORT_SHOCK_LAG
        # Mean of the fourth power of the changes, and the time that it covers.
        self._power = self._covered = 0.0
        # Newest shock that explains a doubt.
        self._shocked_at = -math.inf

    def update(self, change: float, press: float, time: float, dt: float, rested_at: float) -> bool:
        """Add a sample; return whether it is a shock.

        Args:
            change: change of the change of normal and tangential force, summed over the fingers.
            press: normal force of the calm grip.
            time: time of the sample [s].
            dt: time since the last sample [s].
            rested_at: newest time without a doubt [s].
        """
        longer = max(dt / SHOCK_SAMPLE, 1.0)
        power = change**4
        limit = max((SHOCK * press) ** 4, SHOCK_NOISE**4 * self._power) * longer**4
        is_shock = False
        if self._covered >= LEARNING_TIME:
            is_shock = power > limit
            # A shock counts as the least one, so that it is hardly part of its own measure.
            power = min(power, limit)
            if is_shock and time - rested_at <= self._lag:
                self._shocked_at = time
        self._covered += dt
        if self._covered > 0:
            self._power += dt / min(self._covered, NOISE_TIME) * (power - self._power)
        return is_shock

    def explain(self, time: float, rested_at: float, carried: float, *, slides: bool) -> bool:
        """Return whether a shock explains the present doubt.

        Args:
            time: time now [s].
            rested_at: newest time without a doubt [s].
            carried: load, as a share of that of the calm grip.
            slides: whether a finger is decided to slide.
        """
        since = time - self._shocked_at
        is_held = carried >= 1.0 - SHOCK_MISSING_LOAD
        if not self._knows_slips:
            return is_held and since < SHOCK_TIME
        if since < BLOW_TIME:
            return True
        # Until the instability that it began has come to rest; a slide is no part of it.
        lasts = rested_at <= self._shocked_at and since < LONGEST_SHOCK
        return lasts and is_held and not slides
