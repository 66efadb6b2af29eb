"""The search for hyper-parameters: Bayesian optimisation over folds grouped by recording."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Parameters, Recipe, Samples
from holdfast.training.journal import Journal, search_key

if TYPE_CHECKING:
    from optuna import Trial

INNER_FOLDS = 5

Objective = Literal["error", "log_loss"]
OBJECTIVES: tuple[Objective, ...] = ("error", "log_loss")


def search(
    samples: Samples,
    folds: Sequence[npt.NDArray[np.bool_]],
    recipe: Recipe,
    *,
    n_trials: int,
    seed: int,
    objective: Objective = "log_loss",
    journal: Path | None = None,
) -> Parameters:
    """Find the parameters with the least loss over the held-out samples of the folds.

    The first trial is the reference setting; the others are drawn by TPE. A search that was
    stopped is gone through again with the losses from its journal, so that it ends where it
    would have ended.

    Args:
        samples: to fit and to score.
        folds: which samples each fold holds out.
        recipe: the way of fitting.
        n_trials: altogether, those in the journal included.
        seed: of the search.
        objective: the loss: the share of wrong decisions, or the log loss of the probability.
        journal: file that keeps the trials, so that a stopped search can go on.

    Raises:
        OutputError: the journal cannot be read or written.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)  # its warnings are tracebacks
    known = None
    if journal is not None:
        known = Journal(journal, search_key(*samples, *folds, recipe.name, seed, objective))

    pairs = [(samples.take(~held_out), samples.take(held_out)) for held_out in folds]

    def loss(trial: "Trial") -> float:
        parameters = recipe.suggest(trial)
        found = None if known is None else known.find(parameters)
        if found is None:
            found = _loss(pairs, recipe, parameters, seed, objective)
            if known is not None:
                known.add(parameters, found)
        return found

    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed))
    study.enqueue_trial(dict(recipe.reference))
    study.optimize(loss, n_trials=n_trials)
    return dict(study.best_params)


def log_losses(
    probability: npt.NDArray[np.float64], stable: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float64]:
    """Return (n,) the log loss of the probability of stability of each sample."""
    bounded = np.clip(probability, 1e-12, 1 - 1e-12)
    return -np.log(np.where(stable, bounded, 1 - bounded))


def _loss(
    pairs: Sequence[tuple[Samples, Samples]],
    recipe: Recipe,
    parameters: Parameters,
    seed: int,
    objective: Objective,
) -> float:
    """Compute the mean loss over the held-out samples; a pair is (to fit, held out)."""
    total = 0.0
    n = 0
    for fitted, tested in pairs:
        classifier = recipe.fit(fitted, parameters, seed)
        probability = classifier.probability(tested.features)
        if objective == "error":
            total += float(((probability >= classifier.threshold) != tested.stable).sum())
        else:
            total += float(log_losses(probability, tested.stable).sum())
        n += len(tested.stable)
    return total / n
