"""The rule of contact: whether a finger touches anything. Compiled, one sample at a time.

A finger without contact has a small load. What counts as none follows a slow drift, and a skin
that is released and relaxes.
"""

import math

from holdfast.compiled import compiled_step, inlined, joined_step
from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE
from holdfast.detector import arrays as rule_at
from holdfast.features import arrays as at
from holdfast.features.motion import LOAD_DECAY_SECONDS, NOISE_WEIGHT, RELEASED_SHARE
from holdfast.sensors.types import Array, Integers

DRIFT_SECONDS = 1.0
"""A touch brings F_a over the threshold of contact in less time than this; a drift does not [s]."""
CONTACT_RELEASE_RATIO = 0.7
"""Share of the threshold of contact below which a contact ends."""
FOLLOW_SECONDS = 3.0
"""Time constant with which the tare follows the force of a finger without contact [s]."""
TOUCH_SHARE = 1.5 * RELEASED_SHARE
"""Share of the largest load so far that a touch exceeds."""
REST_SECONDS = 0.2
"""A force is at rest if it has not moved, or not been shaken, for this time [s]."""
IN_CONTACT, UNSTEADY, WITHOUT_CONTACT = range(3)
"""What a force shows. UNSTEADY: what is left of it is as small as without contact, but it moves
still; or a large share of it comes or goes at once. Such a finger closes, opens or is pushed."""
UNSTEADY_SHARE, UNSTEADY_TO_NOISE = 0.25, 16.0
"""Share of the largest load so far, and multiple of the noise, by which an unsteady force changes
within MOVE_SECONDS."""
CALM_RATIO = 3.0
"""A finger is calm while sigma is at most this many times the sigma of noise alone."""


@compiled_step
def contact_threshold(noise: float, limits: Array) -> float:
    """Return the threshold of contact of F_a; NaN, which no value is under, if there is none."""
    # F_a without contact: an absolute value, or a multiple of the noise of a component.
    if math.isnan(limits[rule_at.AMPLITUDE_LIMIT]):
        return float(limits[rule_at.AMPLITUDE_TO_NOISE_LIMIT] * noise)
    return float(limits[rule_at.AMPLITUDE_LIMIT])


@compiled_step
def contact_by_load(
    motion: Array,
    decided: Array,
    normal: Array,
    limit: float,
    latest: int,
    time: float,
    zero_unknown: bool,
) -> int:
    """Return IN_CONTACT, UNSTEADY or WITHOUT_CONTACT: by the load, and whether the force rests.

    Args:
        motion: of the finger, as in `Memory`.
        decided: of the finger, as in `DecisionMemory`; is changed.
        normal: (3,) of the finger.
        limit: threshold of contact, as a multiple of the noise.
        latest: the state of the last sample, before debouncing.
        time: of the sample [s].
        zero_unknown: whether the stream began in contact, with a load that is not known.
    """
    # No contact: load < limit noise, or a small share of the peak. It begins after 0.2 s of that
    # without motion, and ends with the load alone.
    threshold, peak = limit * motion[at.NOISE_NOW], motion[at.PEAK_CONTACT_LOAD]
    if zero_unknown:
        # fall = -zero . n: the load of the start, once it has gone.
        fall = 0.0
        for axis in range(3):
            fall -= motion[at.CONTACT_ZERO + axis] * normal[axis]
        if fall < NOISE_WEIGHT * motion[at.NOISE_NOW]:
            return IN_CONTACT
        peak = max(peak, fall)
    if not _is_unloaded(motion[at.CONTACT_LOAD], peak, threshold, latest):
        decided[rule_at.LOADED_AT] = time
        # Unsteady: |F(k) - F(k - MOVE_SECONDS / T)| > max(peak / 4, 16 noise).
        least = max(UNSTEADY_SHARE * peak, UNSTEADY_TO_NOISE * motion[at.NOISE_NOW])
        return UNSTEADY if motion[at.MOVED_BY] > least else IN_CONTACT
    rest = time - max(motion[at.MOVED_AT], decided[rule_at.LOADED_AT])
    if latest == NO_CONTACT or rest > REST_SECONDS:
        return WITHOUT_CONTACT
    # A grip was seen: peak >= 100 noise. A stream may begin in contact undeclared.
    return UNSTEADY if peak >= NOISE_WEIGHT * motion[at.NOISE_NOW] else IN_CONTACT


@compiled_step
def contact_by_force(
    load: float, decided: Array, threshold: float, latest: int, time: float, zero_unknown: bool
) -> int:
    """Return IN_CONTACT, UNSTEADY or WITHOUT_CONTACT: by F_a, and whether a share of it rests.

    A released skin relaxes slowly: its load is a small share of the largest one, and at rest.

    Args:
        load: of the finger, beyond its rest [unit of the readings].
        decided: of the finger, as in `DecisionMemory`.
        threshold: of contact; NaN for none, and then there is always contact.
        latest: the state of the last sample, before debouncing.
        time: of the sample [s].
        zero_unknown: whether the stream began in contact, with a load that is not known.
    """
    if not (threshold > 0.0 and _is_unloaded(load, decided[rule_at.PEAK], threshold, latest)):
        return IN_CONTACT
    # A share of the peak counts only after 0.2 s in which sigma was that of noise, and so does all
    # of the load if it counts from the least so far.
    at_rest = time - decided[rule_at.SHAKEN_AT] > REST_SECONDS
    if at_rest or (not zero_unknown and _is_unloaded(load, 0.0, threshold, latest)):
        return WITHOUT_CONTACT
    return UNSTEADY


@compiled_step
def _is_unloaded(load: float, peak: float, threshold: float, latest: int) -> bool:
    """Return whether a load is below the threshold of contact, which is lower while in contact.

    Args:
        load: of the finger.
        peak: its largest load of the last seconds.
        threshold: that a touch exceeds.
        latest: the state of the last sample, before debouncing.
    """
    # In contact: load < max(0.7 threshold, 0.08 peak); else load < max(threshold, 0.12 peak).
    if latest in (STABLE, UNSTABLE):
        return bool(load < max(CONTACT_RELEASE_RATIO * threshold, RELEASED_SHARE * peak))
    return bool(load < max(threshold, TOUCH_SHARE * peak))


@inlined
def update_load(values: Array, decided: Array, quiet: float, time: float, period: float) -> float:
    """Return the load of a finger: its force beyond that without contact. Update its peak.

    Args:
        values: of the finger, as in `Output`.
        decided: of the finger, as in `DecisionMemory`; is changed.
        quiet: the sigma of noise alone; 0 for a window of two samples.
        time: of the sample [s].
        period: of the samples [s].
    """
    # load = |F_tip - rest|, peak(k) = max(load(k), (1 - T / tau) peak(k-1)).
    x, y, z = (
        values[0] - decided[rule_at.REST],
        values[1] - decided[rule_at.REST + 1],
        values[2] - decided[rule_at.REST + 2],
    )
    load = math.sqrt(x * x + y * y + z * z)
    decided[rule_at.PEAK] = max(
        load, (1.0 - min(1.0, period / LOAD_DECAY_SECONDS)) * decided[rule_at.PEAK]
    )
    # Shaken: sigma > 3 sigma_n, the sigma of noise alone.
    if not (quiet > 0.0 and values[at.SIGMA] <= CALM_RATIO * quiet):
        decided[rule_at.SHAKEN_AT] = time
    return load


@compiled_step
def update_reference(values: Array, decided: Array, normal: Array) -> None:
    """Take the force at the least normal force so far as that without contact."""
    # rest = F at the least F . n; at the start rest = 0, the load of the first sample.
    least = force = 0.0
    for axis in range(3):
        least += decided[rule_at.REST + axis] * normal[axis]
        force += values[axis] * normal[axis]
    if force < least:
        for axis in range(3):
            decided[rule_at.REST + axis] = values[axis]


@compiled_step
def fall_of(decided: Array, normal: Array) -> float:
    """Return how far the normal force fell below that of the first sample."""
    fall = 0.0
    for axis in range(3):
        fall -= decided[rule_at.REST + axis] * normal[axis]
    return fall


@compiled_step
def follow(values: Array, decided: Array, period: float) -> None:
    """Let the force without contact follow slowly."""
    # rest(k) = rest(k-1) + (T / tau) (F_tip(k) - rest(k-1)).
    share = min(1.0, period / FOLLOW_SECONDS)
    for axis in range(3):
        decided[rule_at.REST + axis] += share * (values[axis] - decided[rule_at.REST + axis])


@joined_step
def has_drifted(
    load: float,
    values: Array,
    codes: Integers,
    decided: Array,
    threshold: float,
    quiet: float,
    time: float,
    period: float,
) -> bool:
    """Return whether the load crept over the threshold, slower and calmer than a touch.

    The tare follows a slower drift, so that its load stays below the threshold.

    Args:
        load: beyond that without contact [unit of the readings].
        values: of the finger, as in `Output`.
        codes: of the finger, as in `DecisionMemory`; is changed.
        decided: of the finger, as in `DecisionMemory`; is changed.
        threshold: of contact; NaN for none.
        quiet: the sigma of noise alone; 0 for a window of two samples.
        time: of the sample [s].
        period: of the samples [s].
    """
    # mean = sqrt(2) m is the mean of F_a over the window (equation 1); s(k) = s(k-1) +
    # (T / tau) (F_a(k) - s(k-1)). Calm: sigma <= 3 sigma_n and |mean - s| <= threshold / 2.
    amplitude, mean = values[at.AMPLITUDE], math.sqrt(2.0) * values[at.MEAN]
    if math.isnan(decided[rule_at.SMOOTHED]):
        decided[rule_at.SMOOTHED], decided[rule_at.RESTLESS_AT] = amplitude, time
    away = abs(mean - decided[rule_at.SMOOTHED])
    jumped = abs(amplitude - decided[rule_at.SMOOTHED]) > 0.5 * threshold
    decided[rule_at.SMOOTHED] += min(1.0, period / DRIFT_SECONDS) * (
        amplitude - decided[rule_at.SMOOTHED]
    )
    calm = quiet > 0.0 and values[at.SIGMA] <= CALM_RATIO * quiet and away <= 0.5 * threshold
    if not calm:
        decided[rule_at.RESTLESS_AT] = time
    # A drift comes over the threshold after 1 s of calm and without a jump; a touch does not.
    if load < threshold:
        codes[rule_at.EXCESS] = rule_at.NO_EXCESS
    elif not calm:
        codes[rule_at.EXCESS] = rule_at.TOUCH
    elif codes[rule_at.EXCESS] == rule_at.NO_EXCESS:
        long = time - decided[rule_at.RESTLESS_AT] + 0.5 * period >= DRIFT_SECONDS
        codes[rule_at.EXCESS] = rule_at.DRIFT if long and not jumped else rule_at.TOUCH
    return bool(codes[rule_at.EXCESS] == rule_at.DRIFT)
