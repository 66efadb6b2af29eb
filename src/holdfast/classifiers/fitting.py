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
