"""Training of speed rules: how fast a finger slides, from samples of slips whose truth is known."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from holdfast.classifiers.fitting import standardise
from holdfast.classifiers.slip import MAX_DEVIATION, SpeedRule
from holdfast.metrics.slip_truth import DISTANCES, SLIDING, SlipTruth, has_slip_truth
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Flags, Integers

MIN_SPEED_SAMPLES = 500
"""Fewer sliding samples train no speed rule."""
SPEED_PENALTY = 10.0
"""Weight of the squared coefficients, beside the sum of squared errors over the samples."""
MILLIMETRES = 1e3
"""Millimetres in a metre."""


@dataclass(frozen=True)
class SpeedSamples:
    """Samples that slide, of slips over 1 mm, and their true speed.

    Attributes:
        features: (n, n_features) of the slip rule.
        speed: (n,) of the contact [mm/s].
        units: (n,) unit of each sample, with which it is held out.
    """

    features: Array
    speed: Array
    units: Integers

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the samples of at least one part, in order."""
        columns = zip(*((part.features, part.speed, part.units) for part in parts), strict=True)
        return cls(*map(np.concatenate, columns))

    def fit(self, held: Collection[int]) -> SpeedRule | None:
        """Fit a rule to the samples that are not in held units; None with too few of them.

        The root of the speed is fitted by least squares with a small penalty. So fast slides
        count more than with the logarithm, and less than with the speed itself.
        """
        kept = ~np.isin(self.units, [*held])
        if np.count_nonzero(kept) < MIN_SPEED_SAMPLES:
            return None
        mean, scale, standard = standardise(self.features[kept])
        squares = np.minimum(np.abs(standard), MAX_DEVIATION) ** 2
        columns = np.hstack([np.ones((len(standard), 1)), standard, squares])
        penalty = np.diag([0.0, *[SPEED_PENALTY] * (columns.shape[1] - 1)])
        # (A^T A + penalty) w = A^T sqrt(v), the intercept without penalty.
        target = np.sqrt(self.speed[kept])
        weights = np.linalg.solve(columns.T @ columns + penalty, columns.T @ target).tolist()
        n = len(mean)
        return SpeedRule(
            mean=tuple(mean.tolist()),
            scale=tuple(scale.tolist()),
            coefficients=tuple(weights[1 : n + 1]),
            squares=tuple(weights[n + 1 :]),
            intercept=weights[0],
            highest=float(self.speed[kept].max()),
        )


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
    speed = true_speed(recording, finger, recording.modules[finger].times)
    used = in_long_slips(recording.modules[finger].times, truth) & np.isfinite(features).all(axis=1)
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
