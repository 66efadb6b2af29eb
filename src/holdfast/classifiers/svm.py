"""The linear support vector machine."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import (
    Fitted,
    Parameters,
    Samples,
    check_classes,
    class_weights,
    logistic,
    sigmoid,
    standardise,
)
from holdfast.classifiers.folds import group_folds
from holdfast.classifiers.interior_point import fit_svm
from holdfast.classifiers.linear import Linear
from holdfast.classifiers.newton import Solution

SIGMOID_FOLDS = 5
"""Folds, by group, whose held-out decision values the sigmoid is fitted to."""

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

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Fitted:
        """Fit the classifier to the samples, to the minimum of its loss; the seed is not used.

        Raises:
            TrainingError: the samples have only one class.
        """
        del seed
        check_classes(samples)
        mean, scale, features = standardise(samples.features)
        # Not by scikit-learn's LinearSVC: with the C of a search (up to 1e3) its coordinate descent
        # had not ended after 300,000 passes, the weights 2 to 7 % off and decisions changed.
        solution = _fit(features, samples.positive, parameters)
        values = _values_out_of_fold(samples._replace(features=features), parameters)
        if values is None:
            values = solution.decision(features)
        slope, offset = sigmoid(values, samples.positive)
        rule = Linear.of(
            mean, scale, solution.weights, solution.intercept, slope=slope, offset=offset
        )
        return Fitted(rule, logistic(offset))


def _fit(
    features: npt.NDArray[np.float64], positive: npt.NDArray[np.bool_], parameters: Parameters
) -> Solution:
    weights = class_weights(positive, parameters["class_weight"])
    return fit_svm(features, positive, weights, parameters["C"])


def _values_out_of_fold(samples: Samples, parameters: Parameters) -> npt.NDArray[np.float64] | None:
    """Compute decision values out of fold by group; None if a fold lacks a class."""
    features, positive, groups = samples
    left_out = group_folds(groups, SIGMOID_FOLDS)
    if len(left_out) < 2 or any(samples.take(~rows).one_class for rows in left_out):
        return None
    values = np.empty(len(positive))
    for rows in left_out:
        values[rows] = _fit(features[~rows], positive[~rows], parameters).decision(features[rows])
    return values
