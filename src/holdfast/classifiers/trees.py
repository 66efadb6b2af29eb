"""Gradient-boosted trees."""

from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import (
    Parameters,
    Samples,
    balance_of,
    check_classes,
    unbalanced,
)
from holdfast.classifiers.linear import Array, rows_of

if TYPE_CHECKING:
    from optuna import Trial


@dataclass(frozen=True, eq=False)
class Trees:
    """Fitted trees.

    Attributes:
        estimator: of scikit-learn, fitted with balanced classes.
        balance: by how much the balance has multiplied the odds.
    """

    estimator: Any
    balance: float

    @property
    def n_features(self) -> int:
        """How many features they look at."""
        return int(self.estimator.n_features_in_)

    @property
    def threshold(self) -> float:
        """The probability from which on a contact is called stable: even odds once balanced."""
        return 1.0 / (1.0 + self.balance)

    def probability(self, features: npt.ArrayLike) -> Array:
        """The probability of stability of each row of (n, n_features); NaN for rows with NaN.

        Raises:
            ValueError: another number of features.
        """
        rows = rows_of(features, self.n_features)
        found = np.full(len(rows), np.nan)
        known = ~np.isnan(rows).any(axis=1)
        if known.any():
            with _one_thread():
                balanced = self.estimator.predict_proba(rows[known])[:, 1]
            found[known] = unbalanced(balanced, self.balance)
        return found


@dataclass(frozen=True)
class GradientBoosting:
    """Gradient-boosted trees over histograms of the features, as many as asked for.

    Classes are balanced by weights, the probability is corrected by the factor that they put on
    the odds, the decision stays where they put it: as of logistic regression.
    """

    name: str = "trees"
    reference: Parameters = field(
        default_factory=lambda: {
            "n_trees": 150,
            "learning_rate": 0.1,
            "n_leaves": 15,
            "leaf_samples": 50,
        }
    )

    def suggest(self, trial: "Trial") -> Parameters:
        """How many trees, how large, and how much each of them says."""
        return {
            "n_trees": trial.suggest_int("n_trees", 50, 400, log=True),
            "learning_rate": trial.suggest_float("learning_rate", 0.02, 0.3, log=True),
            "n_leaves": trial.suggest_int("n_leaves", 4, 63, log=True),
            "leaf_samples": trial.suggest_int("leaf_samples", 10, 500, log=True),
        }

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Trees:
        """The trees fitted to the samples.

        Raises:
            TrainingError: only one class.
        """
        from sklearn.ensemble import HistGradientBoostingClassifier

        check_classes(samples)
        estimator = HistGradientBoostingClassifier(
            max_iter=parameters["n_trees"],
            learning_rate=parameters["learning_rate"],
            max_leaf_nodes=parameters["n_leaves"],
            min_samples_leaf=parameters["leaf_samples"],
            class_weight="balanced",
            early_stopping=False,
            random_state=seed,
        )
        with _one_thread():
            estimator.fit(samples.features, samples.stable)
        return Trees(estimator, balance_of(samples.stable))


def _one_thread() -> AbstractContextManager[Any]:
    """Scikit-learn's threads wait for each other: on a busy machine six times as long."""
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[Any] = threadpool_limits(1)
    return limits
