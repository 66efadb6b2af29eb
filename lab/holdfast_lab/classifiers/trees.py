"""Gradient-boosted trees."""

from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.detection.heads import feature_rows
from holdfast.sensors.types import Array
from holdfast.training.classifiers.fitting import (
    Parameters,
    Samples,
    check_classes,
    class_ratio,
)


@dataclass(frozen=True, eq=False)
class Trees:
    """Fitted gradient-boosted trees.

    Attributes:
        estimator: of scikit-learn, fitted with balanced classes.
        class_ratio: factor by which the balanced classes multiplied the odds.
    """

    estimator: Any
    class_ratio: float

    @property
    def n_features(self) -> int:
        """Number of features of their input."""
        return int(self.estimator.n_features_in_)

    @property
    def threshold(self) -> float:
        """Probability from which on a contact is stable: even odds with balanced classes."""
        return 1.0 / (1.0 + self.class_ratio)

    def probability(self, features: npt.ArrayLike) -> Array:
        """Return the probability of stability of each row of (n, n_features); NaN if it has NaN.

        Raises:
            ValueError: the number of features is not `n_features`.
        """
        rows = feature_rows(features, self.n_features)
        probabilities = np.full(len(rows), np.nan)
        complete = ~np.isnan(rows).any(axis=1)
        if complete.any():
            with _one_thread():
                balanced = self.estimator.predict_proba(rows[complete])[:, 1]
            probabilities[complete] = balanced / (balanced + self.class_ratio * (1.0 - balanced))
        return probabilities


@dataclass(frozen=True)
class GradientBoosting:
    """Gradient-boosted trees over histograms of the features, without early stopping.

    Classes are balanced by weights. The weights multiply the odds by a factor. The probability
    is corrected by it; the decision is not changed by the correction.
    """

    reference: Parameters = field(
        default_factory=lambda: {
            "n_trees": 150,
            "learning_rate": 0.1,
            "n_leaves": 15,
            "leaf_samples": 50,
        }
    )

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Trees:
        """Fit the trees to the samples.

        Raises:
            TrainingError: the samples have only one class.
        """
        from sklearn.ensemble import HistGradientBoostingClassifier

        check_classes(samples)
        estimator = HistGradientBoostingClassifier(
            max_iter=parameters["n_trees"],
            learning_rate=parameters["learning_rate"],
            max_leaf_nodes=parameters["n_leaves"],
            min_samples_leaf=parameters["leaf_samples"],
            class_weight="balanced",
            # It would hold out random samples, neighbours of those that it is fitted to.
            early_stopping=False,
            random_state=seed,
        )
        with _one_thread():
            estimator.fit(samples.features, samples.positive)
        return Trees(estimator, class_ratio(samples.positive))


def _one_thread() -> AbstractContextManager[Any]:
    """Limit scikit-learn to one thread; its threads take six times as long on a busy machine."""
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[Any] = threadpool_limits(1)
    return limits
