"""Logistic regression."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import (
    Parameters,
    Samples,
    check_classes,
    class_ratio,
    standardise,
)
from holdfast.classifiers.linear import LinearClassifier
from holdfast.classifiers.newton import fit_logistic

if TYPE_CHECKING:
    from optuna import Trial


@dataclass(frozen=True)
class LogisticRegression:
    """L2-regularised logistic regression on standardised features.

    Balanced class weights multiply the odds by n_0 / n_1. The probability is corrected by that
    factor; the decision is not changed by the correction.
    """

    name: str = "logreg"
    reference: Parameters = field(default_factory=lambda: {"C": 1.0, "class_weight": "balanced"})

    def suggest(self, trial: "Trial") -> Parameters:
        """Draw C over eight decades, and whether classes are weighted."""
        return {
            "C": trial.suggest_float("C", 1e-4, 1e4, log=True),
            "class_weight": trial.suggest_categorical("class_weight", ["balanced", None]),
        }

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> LinearClassifier:
        """Fit the classifier to the samples by Newton's method; the seed is not used.

        Raises:
            TrainingError: the samples have only one class.
        """
        del seed
        check_classes(samples)
        mean, scale, features = standardise(samples.features)
        balanced = parameters["class_weight"] == "balanced"
        solution = fit_logistic(
            features,
            samples.stable,
            _balanced_weights(samples.stable) if balanced else (1.0, 1.0),
            parameters["C"],
        )
        odds = class_ratio(samples.stable) if balanced else 1.0
        return LinearClassifier(
            mean=tuple(mean.tolist()),
            scale=tuple(scale.tolist()),
            coefficients=tuple(solution.weights.tolist()),
            intercept=solution.intercept,
            offset=-float(np.log(odds)),
            threshold=1.0 / (1.0 + odds),
        )


def _balanced_weights(stable: npt.NDArray[np.bool_]) -> tuple[float, float]:
    """Return the weights n / (2 n_0) and n / (2 n_1) of the classes."""
    n, n_stable = len(stable), int(stable.sum())
    return n / (2 * (n - n_stable)), n / (2 * n_stable)
