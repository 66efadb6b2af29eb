"""Gradient-boosted trees."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.detection.heads import feature_rows
from holdfast.sensors.types import Array
from holdfast.training.classifiers.fitting import Parameters, Samples, check_classes


@dataclass(frozen=True, eq=False)
class Trees:
    """Fitted gradient-boosted trees.

    Attributes:
        estimator: of scikit-learn.
        threshold: probability from which on a contact is stable: even odds if both classes have the
            same weight.
    """

    estimator: Any
    threshold: float

    @property
    def n_features(self) -> int:
        """Number of features of their input."""
        return int(self.estimator.n_features_in_)

    def probability(self, features: npt.ArrayLike) -> Array:
        """Return the probability of stability of each row of (n, n_features); NaN if it has NaN.

        Raises:
            ValueError: the number of features is not `n_features`.
        """
        rows = feature_rows(features, self.n_features)
        probabilities = np.full(len(rows), np.nan)
        complete = ~np.isnan(rows).any(axis=1)
        if complete.any():
            probabilities[complete] = self.estimator.predict_proba(rows[complete])[:, 1]
        return probabilities


@dataclass(frozen=True)
class GradientBoosting:
    """Gradient-boosted trees over histograms of the features, without early stopping.

    Classes are balanced by the threshold. With weights scikit-learn takes longer to find the bins
    of the histograms than to grow the trees, and stability was decided no better; a rare class, as
    slips, needs them. The probabilities are then those of balanced classes.
    """

    reference: Parameters = field(
        default_factory=lambda: {
            "n_trees": 100,
            "learning_rate": 0.1,
            "n_leaves": 15,
            "leaf_samples": 50,
            "class_weight": None,
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
            class_weight=parameters["class_weight"],
            # It would hold out random samples, neighbours of those that it is fitted to.
            early_stopping=False,
            random_state=seed,
        )
        estimator.fit(samples.features, samples.positive)
        is_balanced = parameters["class_weight"] == "balanced"
        return Trees(estimator, 0.5 if is_balanced else float(samples.positive.mean()))
