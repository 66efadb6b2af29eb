"""Threshold on one feature."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.detection.heads import Linear
from holdfast.training.classifiers.fitting import (
    Fitted,
    Parameters,
    Samples,
    check_classes,
    sigmoid,
    standardise,
)

Side = Literal["below", "above", "either"]
"""Side of the cut on which contacts are stable; `either` is decided by the fit."""


class Cut(NamedTuple):
    """Cut of the values of one feature into two classes.

    Attributes:
        value: value of the feature at the cut.
        sign: 1 if contacts are stable above it, -1 if below.
        gain: 2 n_0 n_1 (balanced accuracy - 1/2), an integer.
    """

    value: float
    sign: int
    gain: int


@dataclass(frozen=True)
class Threshold:
    """Cut on one feature that maximises balanced accuracy. It is exact and has no parameters.

    All cuts halfway between neighbouring values are tried; the lowest of equal cuts is used. Of
    several features, the first with the best cut is used and the others are ignored. The
    probability is a sigmoid of the feature.

    Attributes:
        side: side of the cut on which contacts are stable. A slip rule with an upper threshold
            has `below`.
        reference: reference parameters: none.
    """

    side: Side = "either"
    reference: Parameters = field(default_factory=dict)

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Fitted:
        """Fit the classifier to the samples. The fit is deterministic; the seed is not used.

        Raises:
            TrainingError: the samples have only one class.
        """
        del parameters, seed
        check_classes(samples)
        cuts = [best_cut(column, samples.positive, self.side) for column in samples.features.T]
        chosen = int(np.argmax([cut.gain for cut in cuts]))
        value, sign, _ = cuts[chosen]
        mean, scale, features = standardise(samples.features)
        weights = np.zeros(len(mean))
        weights[chosen] = sign
        intercept = sign * (mean[chosen] - value) / scale[chosen]
        slope, offset = sigmoid(sign * features[:, chosen] + intercept, samples.positive)
        rule = Linear.of(mean, scale, weights, intercept, slope=slope, offset=offset)
        return Fitted(rule, float(1.0 / (1.0 + np.exp(-offset))))


def best_cut(
    values: npt.NDArray[np.float64], stable: npt.NDArray[np.bool_], side: Side = "either"
) -> Cut:
    """Return the cut that maximises balanced accuracy, computed in integers without rounding.

    Args:
        values: (n,) of a feature, finite.
        stable: (n,) class; both classes occur.
        side: side of the cut on which contacts are stable.

    Returns:
        The cut halfway between two neighbouring values; at the value itself if all are equal.

    Example:
        >>> best_cut(np.array([1.0, 4.0, 2.0, 8.0]), np.array([True, False, True, False]))
        Cut(value=3.0, sign=-1, gain=4)
    """
    order = np.argsort(values, kind="stable")
    ordered, is_stable = values[order], stable[order]
    edges = np.flatnonzero(ordered[1:] > ordered[:-1])
    if not len(edges):
        return Cut(float(ordered[0]), 1 if side == "above" else -1, 0)
    n_stable = int(is_stable.sum())
    n_below, stable_below = edges + 1, np.cumsum(is_stable)[edges]
    excess = stable_below * len(stable) - n_below * n_stable
    gains = {"below": excess, "above": -excess, "either": np.abs(excess)}[side]
    best = int(np.argmax(gains))
    # With `either`, the sign of the excess says on which side more are stable than by chance.
    below = side == "below" or (side == "either" and excess[best] > 0)
    left, right = ordered[edges[best]], ordered[edges[best] + 1]
    return Cut(float(left / 2 + right / 2), -1 if below else 1, int(gains[best]))
