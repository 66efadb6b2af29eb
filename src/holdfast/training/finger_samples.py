"""Labelled samples of one finger with features, and how they are joined and thinned."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.contact import STABLE, UNKNOWN
from holdfast.errors import TrainingError
from holdfast.sensors import Sensor
from holdfast.sensors.types import Integers
from holdfast.training.classifiers.fitting import Samples

CONTACT_DEVIATIONS = 5.0
"""Contact threshold: number of standard deviations of F_a at rest above its mean."""


@dataclass(frozen=True)
class FingerSamples:
    """Training samples of one classifier.

    Attributes:
        sensor: of the finger; None for any sensor.
        samples: labelled, with features; the groups are those of the split.
        units: (n,) unit of each sample, with which it is held out; -1 if it is held out with
            every unit.
        recordings: (n,) index of the recording of each sample.
        times: (n,) time of each sample since the start of its recording [s].
        at_rest: (n_recordings, 3) number, sum and sum of squares of F_a in each tare interval.
        n_usable: number of samples from which these were taken.
    """

    sensor: Sensor | None
    samples: Samples
    units: Integers
    recordings: Integers
    times: npt.NDArray[np.float64]
    at_rest: npt.NDArray[np.float64]
    n_usable: int = 0

    def without(self, left_out: Collection[int]) -> Samples:
        """Return the samples that are in no unit that is left out."""
        return self.samples.take(self.kept(left_out))

    def kept(self, left_out: Collection[int]) -> npt.NDArray[np.bool_]:
        """Return (n,) whether a sample is in no unit that is left out."""
        return outside_units(self.units, left_out)

    def can_evaluate(self, n_units: int) -> npt.NDArray[np.bool_]:
        """Return (n_units,) whether a unit has samples, and both classes are left without it."""
        counts = self._class_counts(n_units)
        left = counts.sum(axis=1, keepdims=True) - counts
        return np.asarray(self.present(n_units) & (left > 0).all(axis=0))

    def present(self, n_units: int) -> npt.NDArray[np.bool_]:
        """Return (n_units,) whether a unit has samples."""
        return np.asarray(self._class_counts(n_units).sum(axis=0) > 0)

    def _class_counts(self, n_units: int) -> Integers:
        """Return (2, n_units) number of samples of class 0 and class 1 in each unit."""
        positive, whole = self.samples.positive, self.units >= 0
        parts = (self.units[whole & (positive == kind)] for kind in (False, True))
        return np.array([np.bincount(part, minlength=n_units) for part in parts])

    def contact_threshold(self, recordings: Sequence[int]) -> float | None:
        """Return the contact threshold from the tare intervals of some recordings."""
        return contact_threshold(self.at_rest[list(recordings)])


def outside_units(units: Integers, left_out: Collection[int]) -> npt.NDArray[np.bool_]:
    """Return (n,) whether a sample is in no unit that is left out; -1 is left out with each."""
    return ~np.isin(units, [-1, *left_out] if left_out else [])


def finite_rows(features: npt.NDArray[np.floating[Any]], used: npt.NDArray[np.bool_]) -> Integers:
    """Return the rows that are used (n,) and have finite features (n, n_features)."""
    return np.flatnonzero(used & np.isfinite(features).all(axis=1))


def usable_rows(features: npt.NDArray[np.floating[Any]], states: npt.NDArray[np.int8]) -> Integers:
    """Return the rows that have a label and finite features.

    Args:
        features: (n, n_features).
        states: (n,) state codes of the labels.
    """
    return finite_rows(features, states != UNKNOWN)


def labelled_samples(
    features: npt.NDArray[Any], states: npt.NDArray[np.int8], rows: Integers, group: int
) -> Samples:
    """Return the samples in some rows of one recording, all of the same group."""
    return Samples(features[rows], states[rows] == STABLE, np.full(len(rows), group))


def concatenate(parts: Sequence[Samples]) -> Samples:
    """Return all samples of at least one part, in order."""
    return Samples(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def thinning_step(n: int, n_max: int) -> int:
    """Return the smallest step at which every step-th of n samples makes at most `n_max`.

    Example:
        >>> thinning_step(10, 4), thinning_step(3, 4)
        (3, 1)
    """
    return max(1, -(-n // n_max))


def thin(samples: Samples, n_max: int) -> Samples:
    """Return at most `n_max` of the samples, at even steps."""
    step = thinning_step(len(samples.positive), n_max)
    return Samples(samples.features[::step], samples.positive[::step], samples.groups[::step])


def contact_threshold(moments: npt.NDArray[np.float64]) -> float | None:
    """Return the mean + 5 standard deviations of F_a at rest.

    Args:
        moments: (n_recordings, 3) number, sum and sum of squares of F_a in each tare interval.

    Returns:
        F_a from which on there is contact [unit of the readings]; None with fewer than two
        samples.
    """
    # Moments of each tare, not its samples: they add up over any choice of recordings.
    n, total, squares = moments.sum(axis=0)
    if n < 2:
        return None
    mean = total / n
    return float(mean + CONTACT_DEVIATIONS * np.sqrt(max(squares / n - mean**2, 0.0)))


def pool_fingers(fingers: Mapping[str, FingerSamples]) -> FingerSamples:
    """Return the samples of all fingers together."""
    parts = list(fingers.values())
    if len({part.sensor for part in parts}) > 1:
        raise TrainingError(
            "one classifier for all fingers needs one sensor; given are "
            + ", ".join(
                f"{name} ({part.sensor.name})" for name, part in fingers.items() if part.sensor
            )
        )
    return join_samples(parts, np.sum([part.at_rest for part in parts], axis=0))


def join_samples(parts: Sequence[FingerSamples], at_rest: npt.NDArray[np.float64]) -> FingerSamples:
    """Return the samples of at least one part, in order, with the moments of the result."""
    return FingerSamples(
        parts[0].sensor,
        concatenate([part.samples for part in parts]),
        np.concatenate([part.units for part in parts]),
        np.concatenate([part.recordings for part in parts]),
        np.concatenate([part.times for part in parts]),
        at_rest,
        sum(part.n_usable for part in parts),
    )
