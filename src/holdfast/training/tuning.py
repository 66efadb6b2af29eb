"""The search for hyper-parameters, and the file of its trials from which it resumes.

It is a Bayesian optimisation over folds grouped by recording.
"""

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.errors import OutputError
from holdfast.training.classifiers.fitting import Parameters, Recipe, Samples

if TYPE_CHECKING:
    from optuna import Trial

INNER_FOLDS = 5

Objective = Literal["error", "log_loss"]


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

    def loss_of(trial: "Trial") -> float:
        # Each trial is drawn even if its loss is known: the next draws depend on it.
        parameters = recipe.suggest(trial)
        loss = None if known is None else known.find(parameters)
        if loss is not None:
            return loss
        total, n = 0.0, 0
        for fitted, tested in pairs:
            classifier = recipe.fit(fitted, parameters, seed)
            probability = classifier.probability(tested.features)
            if objective == "error":
                total += float(((probability >= classifier.threshold) != tested.positive).sum())
            else:
                total += float(log_losses(probability, tested.positive).sum())
            n += len(tested.positive)
        loss = total / n
        if known is not None:
            known.add(parameters, loss)
        return loss

    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed))
    study.enqueue_trial(dict(recipe.reference))
    study.optimize(loss_of, n_trials=n_trials)
    return dict(study.best_params)


def log_losses(
    probability: npt.NDArray[np.float64], stable: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float64]:
    """Return (n,) the log loss of the probability of stability of each sample."""
    bounded = np.clip(probability, 1e-12, 1 - 1e-12)
    return -np.log(np.where(stable, bounded, 1 - bounded))


class _Trial(msgspec.Struct, frozen=True):
    search: str
    parameters: dict[str, float | str | None]
    loss: float


class Journal:
    """Losses of the trials of one search, by their parameters; one line of JSON for each trial.

    The key of a search depends on its samples and its setting, so that the losses are never used
    with other data or another setting. Several searches may write to one file, also at the same
    time. Incomplete lines are ignored.

    Args:
        path: of the file, which is created with the first trial.
        search: key of the search, from `search_key`.

    Raises:
        OutputError: the file cannot be read.
    """

    def __init__(self, path: Path, search: str) -> None:
        self._path, self._search = path, search
        self._losses: dict[str, float] = {}  # by the text of the parameters; `add` adds to them
        try:
            lines = path.read_bytes().splitlines() if path.exists() else []
        except OSError as cause:
            raise OutputError(f"cannot read {path}: {cause.strerror}") from cause
        for line in filter(None, lines):
            # A line may be cut: the search was stopped. msgspec's own errors are ValueErrors.
            with suppress(ValueError):
                trial = msgspec.json.decode(line, type=_Trial)
                if trial.search == search:
                    self._losses[_text(trial.parameters)] = trial.loss

    def find(self, parameters: Mapping[str, Any]) -> float | None:
        """Return the loss of some parameters; None if they have not been tried."""
        return self._losses.get(_text(parameters))

    def add(self, parameters: Mapping[str, Any], loss: float) -> None:
        """Append the loss of some parameters.

        Raises:
            OutputError: the file cannot be written.
        """
        self._losses[_text(parameters)] = loss
        line = msgspec.json.encode(_Trial(self._search, dict(parameters), loss))
        try:
            with self._path.open("ab", buffering=0) as file:
                file.write(b"\n" + line + b"\n")  # one write: parallel searches do not mix
        except OSError as cause:
            raise OutputError(f"cannot write {self._path}: {cause.strerror}") from cause


def search_key(*parts: object) -> str:
    """Return a hash of arrays and plain values."""
    state = hashlib.blake2b(digest_size=16)
    for part in parts:
        if isinstance(part, np.ndarray):
            state.update(repr((part.dtype.str, part.shape)).encode())
            state.update(np.ascontiguousarray(part).data)
        else:
            state.update(repr(part).encode())
    return state.hexdigest()


def _text(parameters: Mapping[str, Any]) -> str:
    return repr(sorted(parameters.items()))


def search_journal(model: Path, *, resume: bool, force: bool) -> Path:
    """Return the file that keeps the trials of a search until the model is written.

    Args:
        model: path of the model.
        resume: continue the search that the file has.
        force: delete the file, and begin again.

    Raises:
        OutputError: there is a file and it is neither continued nor deleted, or none to continue.
    """
    journal = model.with_name(f"{model.name}.search")
    if journal.exists() and force and not resume:
        journal.unlink()
    if journal.exists() and not resume:
        raise OutputError(
            f"{journal} holds a search that was stopped: continue it with --resume, or start "
            "again with --force"
        )
    if resume and not journal.exists():
        raise OutputError(f"nothing to resume: {journal} does not exist")
    return journal
