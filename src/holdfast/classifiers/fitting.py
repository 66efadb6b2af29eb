"""What every way of fitting has in common: samples in, a classifier of plain numbers out."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.linear import LinearClassifier
from holdfast.errors import TrainingError

if TYPE_CHECKING:
    from optuna import Trial

Parameters = Mapping[str, Any]

LEAST_SLOPE = 1e-6
"""Of a sigmoid: so little that the probability is the base rate, yet it rises."""


class Samples(NamedTuple):
    """Training samples of one classifier.

    Attributes:
        features: (n, n_features) finite.
        stable: (n,) the class: True where the label is STABLE.
        groups: (n,) which recording (or object) a sample comes from.
    """

    features: npt.NDArray[np.float64]
    stable: npt.NDArray[np.bool_]
    groups: npt.NDArray[np.int64]

    def take(self, rows: npt.NDArray[np.bool_]) -> "Samples":
        """The samples where `rows` is True."""
        return Samples(self.features[rows], self.stable[rows], self.groups[rows])

    @property
    def one_class(self) -> bool:
        """Whether all labels are the same, or there are none."""
        return not self.stable.any() or bool(self.stable.all())


class Classifier(Protocol):
    """What every way of fitting gives."""

    @property
    def n_features(self) -> int:
        """How many features it looks at."""
        ...

    @property
    def threshold(self) -> float:
        """The probability from which on a contact is called stable."""
        ...

    def probability(self, features: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """The probability of stability of each row of (n, n_features); NaN for rows with NaN."""
        ...


class Recipe(Protocol):
    """A way of fitting a classifier."""

    @property
    def name(self) -> str:
        """What it is called on the command line."""
        ...

    @property
    def reference(self) -> Parameters:
        """The parameters of the reference setting (no search)."""
        ...

    def suggest(self, trial: "Trial") -> Parameters:
        """Parameters to try, drawn from an Optuna trial."""
        ...

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Classifier:
        """The classifier fitted to the samples, with a calibrated probability."""
        ...


class LinearRecipe(Recipe, Protocol):
    """A way of fitting a classifier that a model file can hold."""

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> LinearClassifier:
        """The classifier fitted to the samples, with a calibrated probability."""
        ...


def standardise(features: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], ...]:
    """Mean and scale of each feature, and the features standardised by them."""
    mean = features.mean(axis=0)
    scale = features.std(axis=0)
    scale[np.ptp(features, axis=0) == 0] = 1.0  # rounding may leave a constant 1e-17 of spread
    return mean, scale, (features - mean) / scale


def check_classes(samples: Samples) -> None:
    """Does nothing where there is something to learn.

    Raises:
        TrainingError: fewer than two classes among the samples.
    """
    if samples.one_class:
        n_stable = int(samples.stable.sum())
        raise TrainingError(
            f"{n_stable} samples labelled stable and {len(samples.stable) - n_stable} labelled "
            "not stable given; both classes are needed to train"
        )


def balance_of(stable: npt.NDArray[np.bool_]) -> float:
    """n_0 / n_1: by how much balanced classes multiply the odds of stability."""
    n_stable = int(stable.sum())
    return (len(stable) - n_stable) / n_stable


def unbalanced(probability: npt.NDArray[np.float64], balance: float) -> npt.NDArray[np.float64]:
    """The probability whose odds are `balance` times less."""
    return probability / (probability + balance * (1.0 - probability))


def sigmoid(values: npt.NDArray[np.float64], stable: npt.NDArray[np.bool_]) -> tuple[float, float]:
    """Slope and offset of the logistic function that the classes follow along the values.

    The slope stays above 0; where the classes call for less, the offset is the base rate's.
    """
    from sklearn.linear_model import LogisticRegression

    spread = float(values.std()) or 1.0
    fit = LogisticRegression(C=1e6, max_iter=1000).fit(values[:, None] / spread, stable)
    slope = float(fit.coef_[0, 0]) / spread
    if slope < LEAST_SLOPE:
        return LEAST_SLOPE, -float(np.log(balance_of(stable)))
    return slope, float(fit.intercept_[0])
