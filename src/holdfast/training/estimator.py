"""Estimator for scikit-learn over lists of recordings."""

from collections.abc import Sequence
from typing import Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.validation import check_is_fitted

from holdfast.contact import STABLE
from holdfast.detection import DEFAULT_WINDOW, DEPLOYED_FEATURES, Tare, parse_features
from holdfast.recordings import Recording
from holdfast.resampling import at_rate
from holdfast.training.evaluation import compute_decisions, evaluate
from holdfast.training.model_fit import fit_recordings
from holdfast.training.setting import Setting


class StabilityClassifier(ClassifierMixin, BaseEstimator):
    """Classifier of the stability of contacts, for scikit-learn, over lists of recordings.

    Windows never cross the boundary of a recording. The labels are part of the recordings; `y`
    is ignored and may be None. `GridSearchCV(StabilityClassifier(), {"window": [8, 14]})` with
    `groups` works as for any estimator.

    Args:
        classifier: `logreg` or `svm`.
        window: N_w [samples].
        features: names, separated by commas.
        tare: seconds, "first", "none" or "START:END".
        C: inverse strength of the regularisation.
        class_weight: `balanced` or None.
        shared: one classifier for all fingers.
        seed: of all random numbers.

    Attributes:
        model_: the fitted `Model`.
    """

    def __init__(
        self,
        classifier: str = "logreg",
        window: int = DEFAULT_WINDOW,
        features: str = ",".join(DEPLOYED_FEATURES),
        tare: float | str = 0.5,
        C: float = 1.0,
        class_weight: str | None = "balanced",
        shared: bool = False,
        seed: int = 0,
    ) -> None:
        self.classifier = classifier
        self.window = window
        self.features = features
        self.tare = tare
        self.C = C
        self.class_weight = class_weight
        self.shared = shared
        self.seed = seed

    def fit(self, X: Sequence[Recording], y: object = None) -> Self:
        """Fit a classifier for every finger that has labels.

        Raises:
            TrainingError: there are no labels, or only one class.
        """
        # Checked here and not in the constructor, as scikit-learn's own estimators do.
        setting = Setting(
            classifier=self.classifier,
            features=parse_features(self.features, self.window),
            window=self.window,
            tare=Tare.parse(self.tare),
            trials=0,
            seed=self.seed,
            shared=self.shared,
        )
        parameters = {"C": self.C, "class_weight": self.class_weight}
        self.model_ = fit_recordings(X, setting, parameters)
        self.classes_ = np.array([0, 1])
        return self

    def predict_proba(self, X: Sequence[Recording]) -> list[dict[str, npt.NDArray[np.float64]]]:
        """Return, by recording and finger, (n,) probabilities of stability; NaN if unknown."""
        check_is_fitted(self)
        rate = self.model_.rate
        return [
            self.model_.predict_proba(recording if rate is None else at_rate(recording, rate))
            for recording in X
        ]

    def predict(self, X: Sequence[Recording]) -> list[dict[str, npt.NDArray[np.int64]]]:
        """Return, by recording and finger, (n,) 1 if the contact is stable, else 0."""
        check_is_fitted(self)
        decisions = [compute_decisions(self.model_, recording) for recording in X]
        return [
            {
                name: (finger.states == STABLE).astype(np.int64)
                for name, finger in decision.fingers.items()
            }
            for decision in decisions
        ]

    def score(self, X: Sequence[Recording], y: object = None) -> float:
        """Return the accuracy over all labelled samples, from 0 to 1."""
        check_is_fitted(self)
        accuracy = evaluate(self.model_, X).pooled.accuracy
        return float("nan") if accuracy is None else accuracy / 100
