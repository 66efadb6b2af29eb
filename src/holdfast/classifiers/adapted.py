"""Logistic regression that adapts another linear classifier."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from holdfast.classifiers.fitting import MIN_SLOPE, Parameters, Samples, check_classes
from holdfast.classifiers.linear import LinearClassifier

if TYPE_CHECKING:
    from optuna import Trial

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

NONE, CALIBRATION, WEIGHTS = "none", "calibration", "weights"
CHANGES = (NONE, CALIBRATION, WEIGHTS)
"""What is changed of the prior: nothing; intercept and slope of its log odds; or all weights."""


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
        prior: the classifier to adapt.
    """

    prior: LinearClassifier

    @property
    def name(self) -> str:
        """Name of the recipe, with the prior: another prior is another search."""
        return f"adapted {self.prior}"

    @property
    def reference(self) -> Parameters:
        """Reference parameters: a cautious change of the calibration."""
        return {"change": CALIBRATION, "C": 1e-3}

    def suggest(self, trial: "Trial") -> Parameters:
        """Draw what is changed, and C over eight decades."""
        return {
            "change": trial.suggest_categorical("change", CHANGES),
            "C": trial.suggest_float("C", 1e-6, 1e2, log=True),
        }

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> LinearClassifier:
        """The classifier adapted to the samples; deterministic, the seed is not used.

        Raises:
            TrainingError: the samples have only one class.
            ValueError: the number of features is not that of the prior, or the change is
                unknown.
        """
        del seed
        if parameters["change"] not in CHANGES:
            raise ValueError(
                f"unknown change {parameters['change']!r}; there are {', '.join(CHANGES)}"
            )
        if samples.features.shape[1] != self.prior.n_features:
            raise ValueError(
                f"{samples.features.shape[1]} features given, {self.prior.n_features} expected "
                "to adapt"
            )
        if parameters["change"] == NONE:
            return self.prior
        check_classes(samples)
        fit = _calibrated if parameters["change"] == CALIBRATION else _reweighted
        return fit(self.prior, samples, parameters["C"])


def _calibrated(prior: LinearClassifier, samples: Samples, c: float) -> LinearClassifier:
    odds = prior.slope * prior.decision(samples.features) + prior.offset
    rows = np.column_stack([np.ones(len(odds)), odds])
    shift, stretch = _fit_towards(np.array([0.0, 1.0]), rows, samples.stable, c).tolist()
    stretch = max(stretch, MIN_SLOPE)
    return replace(prior, slope=stretch * prior.slope, offset=stretch * prior.offset + shift)


def _reweighted(prior: LinearClassifier, samples: Samples, c: float) -> LinearClassifier:
    rows = (samples.features - np.array(prior.mean)) / np.array(prior.scale)
    rows = np.column_stack([np.ones(len(rows)), rows])
    weights = _fit_towards(_log_odds(prior), rows, samples.stable, c).tolist()
    return replace(
        prior, intercept=weights[0], coefficients=tuple(weights[1:]), slope=1.0, offset=0.0
    )


def _log_odds(prior: LinearClassifier) -> Array:
    """Return intercept and coefficients of the prior's log odds."""
    found: Array = prior.slope * np.array([prior.intercept, *prior.coefficients])
    found[0] += prior.offset
    return found


def _fit_towards(initial: Array, rows: Array, stable: Flags, c: float) -> Array:
    """Return the weights with the least regularised loss."""
    from scipy.optimize import minimize

    found = minimize(
        _loss,
        initial,
        args=(rows, stable, initial, c),
        jac=True,
        hess=_hessian,
        method="trust-exact",
        options={"gtol": 1e-8 * (1.0 + c * len(rows))},
    )
    return np.asarray(found.x)


def _loss(v: Array, rows: Array, stable: Flags, initial: Array, c: float) -> tuple[float, Array]:
    """Return the regularised loss and its gradient."""
    sign = np.where(stable, 1.0, -1.0)
    margin = sign * (rows @ v)
    difference = v - initial
    loss = 0.5 * difference @ difference + c * np.logaddexp(0.0, -margin).sum()
    slope = -c * sign * np.exp(-np.logaddexp(0.0, margin))
    return float(loss), difference + rows.T @ slope


def _hessian(v: Array, rows: Array, stable: Flags, initial: Array, c: float) -> Array:
    """Return the Hessian of the loss."""
    del stable, initial
    probability = np.exp(-np.logaddexp(0.0, -(rows @ v)))
    weight = c * probability * (1.0 - probability)
    found: Array = np.eye(len(v)) + (rows * weight[:, None]).T @ rows
    return found
