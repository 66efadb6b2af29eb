"""Logistic regression, from nothing or as an adaptation of another linear classifier."""

from dataclasses import dataclass, field

import numpy as np
from msgspec.structs import replace

from holdfast.detection.heads import Linear
from holdfast.training.classifiers.fitting import (
    MIN_SLOPE,
    Fitted,
    Parameters,
    Samples,
    check_classes,
    class_ratio,
    class_weights,
    standardise,
)
from holdfast.training.classifiers.newton import Solution, fit_logistic

NONE, CALIBRATION, WEIGHTS = "none", "calibration", "weights"
"""Parts of the prior that are changed: none; intercept and slope of its log odds; all weights."""


@dataclass(frozen=True)
class LogisticRegression:
    """L2-regularised logistic regression on standardised features.

    Balanced class weights multiply the odds by n_0 / n_1. The probability is corrected by that
    factor; the decision is not changed by the correction.
    """

    reference: Parameters = field(default_factory=lambda: {"C": 1.0, "class_weight": "balanced"})

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Fitted:
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
            samples.positive,
            class_weights(samples.positive, parameters["class_weight"]),
            parameters["C"],
        )
        odds = class_ratio(samples.positive) if balanced else 1.0
        rule = Linear.of(
            mean, scale, solution.weights, solution.intercept, offset=-float(np.log(odds))
        )
        return Fitted(rule, 1.0 / (1.0 + odds))


@dataclass(frozen=True)
class Adapted:
    """Logistic regression, regularised towards another classifier, not to zero.

    z_i are the log odds of that classifier, the prior, at sample i. The change `calibration`
    replaces them by a z_i + b, and minimises

        ((a - 1)^2 + b^2) / 2 + C sum_i log(1 + exp(-y_i (a z_i + b)))

    The change `weights` replaces the intercept and coefficients v_0 of the log odds, over
    features standardised as in the training of the prior, and minimises

        |v - v_0|^2 / 2 + C sum_i log(1 + exp(-y_i z_i(v)))

    The change `none` keeps the prior. A C near 0 keeps it as well; a large C forgets it. The
    threshold stays that of the prior: what a false alarm costs against a miss does not depend on
    the hand.

    Attributes:
        prior: the linear function to adapt.
        threshold: of the prior.
    """

    prior: Linear
    threshold: float = 0.5

    @property
    def reference(self) -> Parameters:
        """Reference parameters: a cautious change of the calibration."""
        return {"change": CALIBRATION, "C": 1e-3}

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Fitted:
        """The classifier adapted to the samples; deterministic, the seed is not used.

        Raises:
            TrainingError: the samples have only one class.
            ValueError: the prior has another number of features.
        """
        del seed
        if samples.features.shape[1] != self.prior.n_features:
            raise ValueError(
                f"{samples.features.shape[1]} features given, {self.prior.n_features} expected "
                "to adapt"
            )
        if parameters["change"] == NONE:
            return Fitted(self.prior, self.threshold)
        check_classes(samples)
        prior, positive, c = self.prior, samples.positive, parameters["C"]
        # Classes weigh as they are: balancing would move the odds away from the prior's.
        if parameters["change"] == CALIBRATION:
            odds = prior.slope * prior.decision(samples.features) + prior.offset
            identity = Solution(np.array([1.0]), 0.0)
            (slope,), shift = fit_logistic(odds[:, None], positive, (1.0, 1.0), c, identity)
            stretch = max(float(slope), MIN_SLOPE)  # more of the prior never means less stable
            offset = stretch * prior.offset + shift
            return Fitted(
                replace(prior, slope=stretch * prior.slope, offset=offset), self.threshold
            )
        mean, scale = prior.moments
        standardised = (samples.features - mean) / scale
        fitted = fit_logistic(standardised, positive, (1.0, 1.0), c, log_odds(prior))
        return Fitted(Linear.of(mean, scale, fitted.weights, fitted.intercept), self.threshold)


def log_odds(prior: Linear) -> Solution:
    """Return weights and intercept of the log odds of a rule, of standardised features."""
    weights = prior.slope * np.array(prior.weights[0])
    return Solution(weights, prior.slope * prior.intercepts[0] + prior.offset)
