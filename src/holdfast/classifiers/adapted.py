"""Logistic regression that adapts another linear classifier."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import Parameters, Samples, check_classes, class_ratio
from holdfast.classifiers.linear import LinearClassifier

if TYPE_CHECKING:
    from optuna import Trial

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Adapted:
    """Logistic regression, regularised towards the weights of another classifier, not to zero.

    v_0 are the intercept and the coefficients of the log odds of that classifier, the prior, over
    features standardised as in its training. With balanced weights of the samples it minimises

        |v - v_0|^2 / 2 + C sum_i weight_i log(1 + exp(-y_i z_i(v)))

    A C near 0 keeps the prior; a large C forgets it.

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
        """Reference parameters: a thousand samples count as much as the prior."""
        return {"C": 1e-3}

    def suggest(self, trial: "Trial") -> Parameters:
        """Draw C over eight decades."""
        return {"C": trial.suggest_float("C", 1e-6, 1e2, log=True)}

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> LinearClassifier:
        """The classifier adapted to the samples; deterministic, the seed is not used.

        Raises:
            TrainingError: the samples have only one class.
            ValueError: the number of features is not that of the prior.
        """
        from scipy.optimize import minimize

        del seed
        check_classes(samples)
        prior = self.prior
        if samples.features.shape[1] != prior.n_features:
            raise ValueError(
                f"{samples.features.shape[1]} features given, {prior.n_features} expected to adapt"
            )
        rows = (samples.features - np.array(prior.mean)) / np.array(prior.scale)
        initial = _log_odds(prior)
        odds = class_ratio(samples.stable)
        found = minimize(
            _loss,
            initial,
            args=(np.column_stack([np.ones(len(rows)), rows]), samples.stable, initial, parameters),
            jac=True,
            hess=_hessian,
            method="trust-exact",
            options={"gtol": 1e-8 * (1.0 + parameters["C"] * len(rows))},
        )
        return LinearClassifier(
            mean=prior.mean,
            scale=prior.scale,
            coefficients=tuple(found.x[1:].tolist()),
            intercept=float(found.x[0]),
            offset=-float(np.log(odds)),
            threshold=1.0 / (1.0 + odds),
        )


def _log_odds(prior: LinearClassifier) -> Array:
    """Return intercept and coefficients of the prior's log odds, minus those of its threshold."""
    limit = np.clip(prior.threshold, 1e-12, 1 - 1e-12)
    shift = prior.offset - np.log(limit / (1 - limit))
    calibrated = prior.slope * np.array([prior.intercept, *prior.coefficients])
    calibrated[0] += shift
    return calibrated


def _loss(
    v: Array, rows: Array, stable: npt.NDArray[np.bool_], initial: Array, parameters: Parameters
) -> tuple[float, Array]:
    """Return the regularised loss and its gradient."""
    weight = _weights(stable, parameters)
    sign = np.where(stable, 1.0, -1.0)
    margin = sign * (rows @ v)
    difference = v - initial
    loss = 0.5 * difference @ difference + weight @ np.logaddexp(0.0, -margin)
    slope = -weight * sign * np.exp(-np.logaddexp(0.0, margin))
    return float(loss), difference + rows.T @ slope


def _hessian(
    v: Array, rows: Array, stable: npt.NDArray[np.bool_], _: Array, parameters: Parameters
) -> Array:
    """Return the Hessian of the loss."""
    probability = np.exp(-np.logaddexp(0.0, -(rows @ v)))
    weight = _weights(stable, parameters) * probability * (1.0 - probability)
    found: Array = np.eye(len(v)) + (rows * weight[:, None]).T @ rows
    return found


def _weights(stable: npt.NDArray[np.bool_], parameters: Parameters) -> Array:
    """Return C times the weight of each sample; both classes have the same total weight."""
    n, n_stable = len(stable), int(stable.sum())
    fraction = np.where(stable, n / (2 * n_stable), n / (2 * (n - n_stable)))
    return np.asarray(parameters["C"] * fraction)
