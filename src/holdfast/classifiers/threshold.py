"""A threshold on one feature."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import (
    Parameters,
    Samples,
    check_classes,
    sigmoid,
    standardise,
)
from holdfast.classifiers.linear import LinearClassifier

if TYPE_CHECKING:
    from optuna import Trial


Side = Literal["below", "above", "either"]
"""On which side of the cut stable contacts may lie."""


class Cut(NamedTuple):
    """Where one feature is cut in two.

    Attributes:
        place: the value of the feature.
        sign: 1 where stable lies above it, -1 where below.
        gain: 2 n_0 n_1 (balanced accuracy - 1/2), which is a whole number.
    """

    place: float
    sign: int
    gain: int


@dataclass(frozen=True)
class Threshold:
    """The cut on one feature that maximises balanced accuracy: exact, nothing to set.

    All cuts halfway between neighbouring values are tried; among equals the lowest is taken. Of
    several features the one with the best cut is taken, the first among equals; the others have
    no say. The probability is a sigmoid of the feature.

    Attributes:
        side: on which side of the cut stable lies; a rule that calls slip what is above its
            threshold knows it, and keeps its meaning.
        name: of the way of fitting.
        reference: nothing.
    """

    side: Side = "either"
    name: str = "threshold"
    reference: Parameters = field(default_factory=dict)

    def suggest(self, trial: "Trial") -> Parameters:
        """Nothing: there is nothing to search for."""
        del trial
        return {}

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> LinearClassifier:
        """The classifier fitted to the samples; deterministic, the seed is not used.

        Raises:
            TrainingError: only one class.
        """
        del parameters, seed
        check_classes(samples)
        cuts = [best_cut(column, samples.stable, self.side) for column in samples.features.T]
        chosen = int(np.argmax([cut.gain for cut in cuts]))
        place, sign, _ = cuts[chosen]
        mean, scale, features = standardise(samples.features)
        coefficients = np.zeros(len(mean))
        coefficients[chosen] = sign
        intercept = sign * (mean[chosen] - place) / scale[chosen]
        slope, offset = sigmoid(sign * features[:, chosen] + intercept, samples.stable)
        return LinearClassifier(
            mean=tuple(mean.tolist()),
            scale=tuple(scale.tolist()),
            coefficients=tuple(coefficients.tolist()),
            intercept=float(intercept),
            slope=slope,
            offset=offset,
            threshold=float(1.0 / (1.0 + np.exp(-offset))),
        )


def best_cut(
    values: npt.NDArray[np.float64], stable: npt.NDArray[np.bool_], side: Side = "either"
) -> Cut:
    """The cut that maximises balanced accuracy; counted in whole numbers, so without rounding.

    Args:
        values: (n,) of a feature, finite.
        stable: (n,) the class; both are there.
        side: on which side of the cut stable may lie.

    Returns:
        Halfway between two neighbours; at the value itself where all are the same.

    Example:
        >>> best_cut(np.array([1.0, 4.0, 2.0, 8.0]), np.array([True, False, True, False]))
        Cut(place=3.0, sign=-1, gain=4)
    """
    order = np.argsort(values, kind="stable")
    ordered, is_stable = values[order], stable[order]
    places = np.flatnonzero(ordered[1:] > ordered[:-1])
    if not len(places):
        return Cut(float(ordered[0]), 1 if side == "above" else -1, 0)
    n_stable = int(is_stable.sum())
    n_below, stable_below = places + 1, np.cumsum(is_stable)[places]
    excess = stable_below * len(stable) - n_below * n_stable
    gains = {"below": excess, "above": -excess, "either": np.abs(excess)}[side]
    best = int(np.argmax(gains))
    below = side == "below" or (side == "either" and excess[best] > 0)
    left, right = ordered[places[best]], ordered[places[best] + 1]
    return Cut(float(left / 2 + right / 2), -1 if below else 1, int(gains[best]))
