"""Training of speed rules: how fast a finger slides, from samples whose true speed is known."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from holdfast.classifiers.fitting import standardise
from holdfast.classifiers.linear import MAX_DEVIATION, Linear
from holdfast.metrics.slip_truth import DISTANCES, SLIDING, STILL, SlipTruth, has_slip_truth
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Flags, Integers

MIN_SPEED_SAMPLES = 500
"""Fewer sliding samples train no speed rule."""
SPEED_PENALTY = 10.0
"""Weight of the squared coefficients, beside the sum of squared errors over the samples."""
STILL_STEP = 10
"""Every tenth sample that holds still trains, with the speed 0."""
STILL_WEIGHT = 0.3
"""Weight of all samples that hold still, as a share of that of those that slide.

Without them the speed rises less with that of the marker on the real recordings, and a false alarm
slides further."""
MILLIMETRES = 1e3
"""Millimetres in a metre."""


@dataclass(frozen=True)
class SpeedSamples:
    """Samples that slide, of slips over 1 mm, and some that hold still, with their true speed.

    Attributes:
        features: (n, n_features) of the slip rule.
        speed: (n,) of the contact [mm/s]; 0 where it holds still.
        units: (n,) unit of each sample, with which it is held out.
    """

    features: Array
    speed: Array
    units: Integers

    @property
    def n_sliding(self) -> int:
        """Number of samples that slide."""
        return int(np.count_nonzero(self.speed))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the samples of at least one part, in order."""
        columns = zip(*((part.features, part.speed, part.units) for part in parts), strict=True)
        return cls(*map(np.concatenate, columns))

    def fit(self, held: Collection[int]) -> tuple[Linear, float] | None:
        """Fit a rule to the samples that are not in held units.

        The root of the speed is fitted by least squares with a small penalty. So fast slides
        count more than with the logarithm, and less than with the speed itself.

        Args:
            held: units whose samples are left out.

        Returns:
            The rule and the highest speed [mm/s]; None with too few samples that slide.
        """
        kept = ~np.isin(self.units, [*held])
        features, speed = self.features[kept], self.speed[kept]
        slides = speed > 0
        if np.count_nonzero(slides) < MIN_SPEED_SAMPLES:
            return None
        mean, scale, _ = standardise(features[slides])
        standard = (features - mean) / scale
        squares = np.minimum(np.abs(standard), MAX_DEVIATION) ** 2
        columns = np.hstack([np.ones((len(standard), 1)), standard, squares])
        weights = _solve(columns, np.sqrt(speed), _sample_weights(slides))
        n = len(mean)
        rule = Linear.of(mean, scale, weights[1 : n + 1], weights[0], weights[n + 1 :])
        return rule, float(speed.max())


def _sample_weights(slides: Flags) -> Array:
    """Return (n,) 1 for samples that slide, and what `STILL_WEIGHT` leaves for each other one."""
    n_sliding = int(np.count_nonzero(slides))
    n_still = max(len(slides) - n_sliding, 1)
    return np.where(slides, 1.0, STILL_WEIGHT * n_sliding / n_still)


def _solve(columns: Array, target: Array, weights: Array) -> Array:
    """Return the coefficients of the columns, of which the first has no penalty."""
    # (A^T W A + penalty) c = A^T W y.
    weighted = (columns * weights[:, None]).T
    penalty = np.diag([0.0, *[SPEED_PENALTY] * (columns.shape[1] - 1)])
    return np.asarray(np.linalg.solve(weighted @ columns + penalty, weighted @ target))


def speed_samples(
    recording: Recording, finger: str, features: Array, truth: SlipTruth, units: Integers
) -> SpeedSamples | None:
    """Return the samples of a finger that train its speed rule.

    Args:
        recording: with the truth.
        finger: name of the finger.
        features: (n, n_features) of the slip rule.
        truth: of the slips of the finger.
        units: (n,) of the split.

    Returns:
        The samples; None if the true speed is not known.
    """
    if recording.truth is None or not has_slip_truth(recording.truth, finger):
        return None
    times = recording.modules[finger].times
    slides, still = in_long_slips(times, truth), np.flatnonzero(truth.codes == STILL)
    used = slides.copy()
    used[still[::STILL_STEP]] = True
    used &= np.isfinite(features).all(axis=1)
    speed = np.where(slides, true_speed(recording, finger, times), 0.0)
    return SpeedSamples(features[used], speed[used], units[used])


def true_speed(recording: Recording, finger: str, times: Array) -> Array:
    """Return (n,) the true speed of a finger over its object at some times [mm/s].

    Args:
        recording: with a truth that has the speed of the finger.
        finger: name of the finger.
        times: (n,) [s].
    """
    if recording.truth is None:
        raise ValueError(f"recording {recording.name!r} has no truth; one with a speed expected")
    truth = recording.truth
    place = np.clip(np.searchsorted(truth.times, times, side="right") - 1, 0, None)
    return np.asarray(MILLIMETRES * truth.fingers[finger]["slip_speed"][place])


def in_long_slips(times: Array, truth: SlipTruth) -> Flags:
    """Return (n,) where a finger slides, in a slip over 1 mm."""
    inside = np.zeros(len(times), dtype=np.bool_)
    for slip in truth.slips:
        if slip.distance >= DISTANCES[0]:
            first, last = np.searchsorted(times, (slip.onset, slip.end))
            inside[first:last] = True
    return np.asarray(inside & (truth.codes == SLIDING))
