"""Fit of the causes of an unstable contact: multinomial logistic regression."""

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import standardise
from holdfast.classifiers.linear import Linear
from holdfast.classifiers.newton import fit_multinomial
from holdfast.contact import Cause
from holdfast.sensors.types import Array


def fit_causes(
    features: Array, causes: npt.NDArray[np.str_], c: float
) -> tuple[Linear, tuple[Cause, ...]]:
    """Fit the scores of causes to unstable samples; all causes weigh alike.

    Args:
        features: (n, n_features) finite.
        causes: (n,) name of the cause of each sample.
        c: inverse strength of the L2 penalty on the weights of standardised features.

    Returns:
        The rule, and the causes of its outputs.
    """
    names, classes, counts = np.unique(causes, return_inverse=True, return_counts=True)
    mean, scale, standardised = standardise(features)
    balanced = len(causes) / (len(names) * counts)
    solution = fit_multinomial(standardised, classes, balanced, c)
    rule = Linear.of(mean, scale, solution.weights, solution.intercepts)
    return rule, tuple(map(Cause, names.tolist()))
