"""The search for hyper-parameters: Bayesian optimisation over folds grouped by recording."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Parameters, Recipe, Samples

if TYPE_CHECKING:
    from optuna import Study, Trial
    from optuna.storages import BaseStorage

INNER_FOLDS = 5


def search(
    samples: Samples,
    folds: Sequence[npt.NDArray[np.bool_]],
    recipe: Recipe,
    *,
    n_trials: int,
    seed: int,
    journal: Path | None = None,
    name: str = "search",
) -> Parameters:
    """The parameters with the least log loss over the held-out samples of the folds.

    The first trial is the reference setting; the others are drawn by TPE. Every trial has its
    own seed, so that a search that was stopped and goes on ends where it would have ended.

    Args:
        samples: to fit and to score.
        folds: which samples each fold holds out.
        recipe: the way of fitting.
        n_trials: altogether, those in the journal included.
        seed: of the search.
        journal: file that keeps the trials, so that a stopped search can go on.
        name: of the search within the journal.
    """
    import optuna
    from optuna.trial import TrialState

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(
        study_name=name, storage=_storage(journal), direction="minimize", load_if_exists=True
    )
    _finish_stopped(study)
    n_done = len(study.get_trials(states=(TrialState.COMPLETE,)))
    if n_done == 0:
        study.enqueue_trial(dict(recipe.reference), skip_if_exists=True)

    def loss(trial: "Trial") -> float:
        return _log_loss(samples, folds, recipe, recipe.suggest(trial), seed)

    for number in range(n_done, n_trials):
        study.sampler = optuna.samplers.TPESampler(seed=seed + number)
        study.optimize(loss, n_trials=1)
    return dict(study.best_params)


def _storage(journal: Path | None) -> "BaseStorage | None":
    if journal is None:
        return None
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    return JournalStorage(JournalFileBackend(str(journal)))


def _finish_stopped(study: "Study") -> None:
    """Puts back the trials that were under way when a search was stopped."""
    from optuna.trial import TrialState

    for trial in study.get_trials(states=(TrialState.RUNNING,)):
        study.tell(trial.number, state=TrialState.FAIL)


def _log_loss(
    samples: Samples,
    folds: Sequence[npt.NDArray[np.bool_]],
    recipe: Recipe,
    parameters: Parameters,
    seed: int,
) -> float:
    """The mean over held-out samples of -log of the probability of their class."""
    total = 0.0
    n = 0
    for held_out in folds:
        classifier = recipe.fit(samples.take(~held_out), parameters, seed)
        tested = samples.take(held_out)
        probability = np.clip(classifier.probability(tested.features), 1e-12, 1 - 1e-12)
        total -= float(np.log(np.where(tested.stable, probability, 1 - probability)).sum())
        n += len(tested.stable)
    return total / n
