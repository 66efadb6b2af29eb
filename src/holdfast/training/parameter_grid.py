"""Choice of the parameters of a classifier: on a grid, by folds grouped by recording."""

from collections.abc import Sequence

import numpy as np

from holdfast.sensors.types import Array, Flags
from holdfast.training.classifiers.fitting import Parameters, Recipe, Samples
from holdfast.training.classifiers.svm import LinearSVM

GRID: tuple[Parameters, ...] = tuple(
    {"C": c, "class_weight": weight}
    for c in (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3)
    for weight in ("balanced", None)
)
"""Parameters that are tried, the strongest regularisation first; of equal losses the first wins.

Decades are enough: over a factor of 10 in C the loss hardly changes, because a few features have
many samples. Of random hands the best C is near the low end. docs/decisions/0004 compares the
grid with a search of 30 trials."""
INNER_FOLDS = 5


def choose_parameters(
    samples: Samples, folds: Sequence[Flags], recipe: Recipe, seed: int
) -> Parameters:
    """Return the parameters of `GRID` with the least loss over the held-out samples of the folds.

    The loss is the log loss. For the SVM, which has no probability of its own, it is the share of
    wrong decisions, as in the paper.

    Args:
        samples: to fit and to score.
        folds: which samples each fold holds out.
        recipe: the way of fitting.
        seed: of the fits.
    """
    pairs = [(samples.take(~held_out), samples.take(held_out)) for held_out in folds]

    def loss(parameters: Parameters) -> float:
        total = 0.0
        for fitted, tested in pairs:
            classifier = recipe.fit(fitted, parameters, seed)
            probability = classifier.probability(tested.features)
            if isinstance(recipe, LinearSVM):
                total += float(((probability >= classifier.threshold) != tested.positive).sum())
            else:
                total += float(log_losses(probability, tested.positive).sum())
        return total

    return min(GRID, key=loss)


def log_losses(probability: Array, stable: Flags) -> Array:
    """Return (n,) the log loss of the probability of stability of each sample."""
    bounded = np.clip(probability, 1e-12, 1 - 1e-12)
    return -np.log(np.where(stable, bounded, 1 - bounded))
