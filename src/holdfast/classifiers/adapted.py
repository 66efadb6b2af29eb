"""Logistic regression that begins from what another model knows."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import Parameters, Samples, balance_of, check_classes
from holdfast.classifiers.linear import LinearClassifier

if TYPE_CHECKING:
    from optuna import Trial

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Adapted:
    """Logistic regression, regularised towards the weights of a model and not towards zero.

    With v_0 the intercept and the coefficients of the prior's log odds, over features
    standardised as in its training, and n samples of balanced weight, it minimises

        |v - v_0|^2 / 2 + C sum_i weight_i log(1 + exp(-y_i z_i(v)))

    so that a C of nearly 0 keeps the prior, and a large one forgets it.

    Attributes:
        prior: what is known before.
    """

    prior: LinearClassifier

    @property
    def name(self) -> str:
        """Names the prior too: a search from another one is another search."""
        return f"adapted {self.prior}"

    @property
    def reference(self) -> Parameters:
        """A thousand samples count as much as the prior does."""
        return {"C": 1e-3}

    def suggest(self, trial: "Trial") -> Parameters:
        """C over eight decades."""
        return {"C": trial.suggest_float("C", 1e-6, 1e2, log=True)}

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> LinearClassifier:
        """The classifier adapted to the samples; deterministic, the seed is not used.

        Raises:
            TrainingError: only one class.
            ValueError: another number of features than the prior has.
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
        known = _log_odds(prior)
        odds = balance_of(samples.stable)
        found = minimize(
            _loss,
            known,
            args=(np.column_stack([np.ones(len(rows)), rows]), samples.stable, known, parameters),
            jac=True,
            hess=_curvature,
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
    """Intercept and coefficients of the prior's log odds, less those of its threshold."""
    limit = np.clip(prior.threshold, 1e-12, 1 - 1e-12)
    shift = prior.offset - np.log(limit / (1 - limit))
    calibrated = prior.slope * np.array([prior.intercept, *prior.coefficients])
    calibrated[0] += shift
    return calibrated


def _loss(
    v: Array, rows: Array, stable: npt.NDArray[np.bool_], known: Array, parameters: Parameters
) -> tuple[float, Array]:
    """The regularised loss and its gradient."""
    weight = _weights(stable, parameters)
    sign = np.where(stable, 1.0, -1.0)
    margin = sign * (rows @ v)
    away = v - known
    loss = 0.5 * away @ away + weight @ np.logaddexp(0.0, -margin)
    pull = -weight * sign * np.exp(-np.logaddexp(0.0, margin))
    return float(loss), away + rows.T @ pull


def _curvature(
    v: Array, rows: Array, stable: npt.NDArray[np.bool_], _: Array, parameters: Parameters
) -> Array:
    """The Hessian of the loss."""
    probability = np.exp(-np.logaddexp(0.0, -(rows @ v)))
    weight = _weights(stable, parameters) * probability * (1.0 - probability)
    found: Array = np.eye(len(v)) + (rows * weight[:, None]).T @ rows
    return found


def _weights(stable: npt.NDArray[np.bool_], parameters: Parameters) -> Array:
    """Of each sample: both classes together count as much."""
    n, n_stable = len(stable), int(stable.sum())
    share = np.where(stable, n / (2 * n_stable), n / (2 * (n - n_stable)))
    return np.asarray(parameters["C"] * share)
