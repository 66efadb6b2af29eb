"""The linear support vector machine."""

import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import (
    Parameters,
    Samples,
    check_classes,
    logistic,
    sigmoid,
    standardise,
)
from holdfast.classifiers.folds import group_folds
from holdfast.classifiers.linear import LinearClassifier

SIGMOID_FOLDS = 5
"""Folds, by group, whose held-out decision values the sigmoid is fitted to."""
MAX_PASSES = 2000
"""Passes of the solver over the samples. On 80,000 samples of the twin, 1,000 passes reach the
minimum of the objective within 0.04 % for every C of the search; more change no decision."""

if TYPE_CHECKING:
    from optuna import Trial


@dataclass(frozen=True)
class LinearSVM:
    """Linear SVM on standardised features: L2 penalty, hinge loss, a sigmoid for the probability.

    The loss is max(0, 1 - y z), as in MATLAB's toolbox, which the paper used. The sigmoid is
    fitted, without class weights, to decision values out of fold where the groups allow it,
    else to those of the training samples (Platt 1999).
    """

    name: str = "svm"
    reference: Parameters = field(default_factory=lambda: {"C": 1.0, "class_weight": "balanced"})

    def suggest(self, trial: "Trial") -> Parameters:
        """Draw C over eight decades, and whether classes are weighted."""
        return {
            "C": trial.suggest_float("C", 1e-5, 1e3, log=True),
            "class_weight": trial.suggest_categorical("class_weight", ["balanced", None]),
        }

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> LinearClassifier:
        """Fit the classifier to the samples.

        Raises:
            TrainingError: the samples have only one class.
        """
        check_classes(samples)
        mean, scale, features = standardise(samples.features)
        coefficients, intercept = _fit(features, samples.stable, parameters, seed)
        values = _values_out_of_fold(samples._replace(features=features), parameters, seed)
        if values is None:
            values = features @ coefficients + intercept
        slope, offset = sigmoid(values, samples.stable)
        return LinearClassifier(
            mean=tuple(mean.tolist()),
            scale=tuple(scale.tolist()),
            coefficients=tuple(coefficients.tolist()),
            intercept=intercept,
            slope=slope,
            offset=offset,
            threshold=logistic(offset),
        )


def _fit(
    features: npt.NDArray[np.float64],
    stable: npt.NDArray[np.bool_],
    parameters: Parameters,
    seed: int,
) -> tuple[npt.NDArray[np.float64], float]:
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.svm import LinearSVC

    estimator = LinearSVC(
        loss="hinge", dual=True, random_state=seed, max_iter=MAX_PASSES, **parameters
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # see MAX_PASSES
        estimator.fit(features, stable)
    return estimator.coef_[0], float(estimator.intercept_[0])


def _values_out_of_fold(
    samples: Samples, parameters: Parameters, seed: int
) -> npt.NDArray[np.float64] | None:
    """Compute decision values out of fold by group; None if a fold lacks a class."""
    features, stable, groups = samples
    held = group_folds(groups, SIGMOID_FOLDS)
    if len(held) < 2 or any(samples.take(~rows).one_class for rows in held):
        return None
    values = np.empty(len(stable))
    for rows in held:
        coefficients, intercept = _fit(features[~rows], stable[~rows], parameters, seed)
        values[rows] = features[rows] @ coefficients + intercept
    return values
