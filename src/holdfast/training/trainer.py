"""Training and its honest figures: fit on all, judge out of fold, by the detector itself."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Protocol, TypeVar

import msgspec

from holdfast.classifiers import Parameters, Samples
from holdfast.metrics import Decisions, Metrics, summarise
from holdfast.model import ANY_FINGER, Model, Training
from holdfast.parallel import map_ordered
from holdfast.recordings import Recording
from holdfast.training.design import gather, thin
from holdfast.training.fitting import Material, fit_model, fit_whole
from holdfast.training.judging import decisions_of, pick
from holdfast.training.origin import doubts, seen_by
from holdfast.training.setting import SEARCH_SAMPLES, Setting
from holdfast.training.splits import divide, inner_folds
from holdfast.training.survey import survey
from holdfast.training.tuning import INNER_FOLDS, search

N_SEARCHES = 5
"""Searches for the parameters of the figures. What is held out takes no part in the search for
the parameters that it is judged with."""

UNDECIDED_SHARE = 0.2
"""Share of labelled samples without a decision from which on the user is told."""

NOBODY: frozenset[int] = frozenset()

T = TypeVar("T")
Tell = Callable[[str], None]


class Follow(Protocol):
    """Goes through items, with a word on what for and how many; may show progress."""

    def __call__(self, items: Iterable[T], what: str, total: int) -> Iterator[T]:
        """Yields the items."""
        ...


@dataclass(frozen=True)
class Trained:
    """A model and its figures.

    Attributes:
        model: fitted to all recordings.
        cross_validation: from predictions out of fold.
    """

    model: Model
    cross_validation: Metrics


def train(
    recordings: Sequence[Recording],
    setting: Setting | None = None,
    *,
    journal: Path | None = None,
    tell: Tell = lambda _: None,
    follow: Follow = lambda items, _, __: iter(items),
    n_jobs: int = 1,
) -> Trained:
    """Trains a model, and measures it on what it has not seen.

    Recordings are read one at a time, and more than once; memory holds their features.

    Args:
        recordings: labelled; a lazy dataset will do.
        setting: how to train; the default of the paper's deployed model.
        journal: file that keeps the search, so that a stopped one can go on.
        tell: is given every warning.
        follow: goes through recordings and through what is done with them.
        n_jobs: searches or fits at a time; -1 for as many as there are processors.

    Raises:
        TrainingError: no labels, one class, or too few recordings or objects for the split.
        ModelError: the model to begin from does not have all the fingers of the recordings.
        RecordingError: a recording cannot be read.
        OutputError: the journal cannot be written.
    """
    setting = setting or Setting()
    trainer = _Trainer(recordings, setting, journal, tell, follow, n_jobs)
    trainer.check()
    whole, *without = trainer.search([NOBODY, *trainer.searches_without()])
    model = fit_whole(trainer.material, setting, whole)
    metrics = trainer.cross_validate(without or [whole])
    _tell_undecided(metrics, tell)
    return Trained(trainer.sign(model, whole, metrics), metrics)


class _Trainer:
    def __init__(
        self,
        recordings: Sequence[Recording],
        setting: Setting,
        journal: Path | None,
        tell: Tell,
        follow: Follow,
        n_jobs: int,
    ) -> None:
        self.recordings, self.setting, self.journal = recordings, setting, journal
        self.tell, self.follow, self.n_jobs = tell, follow, n_jobs
        self.found = survey(self._read("reading"), setting.rate)
        self.division = divide(self.found.entries, setting.split, setting.seed)
        self.designs = gather(self._read("features"), self.found, setting, self.division)
        self.material = Material(self.found, self.division, self.designs)

    def check(self) -> None:
        """Tells which figures there cannot be, before any work is done.

        Raises:
            TrainingError: a finger has only one class; or there is no figure at all.
            ModelError: the model to begin from has no such finger.
        """
        self.material.check_classes()
        if self.setting.init is not None:
            for doubt in doubts(self.setting.init, self.found, self.designs):
                self.tell(doubt)
        for finger, names in self.material.not_judged().items():
            some = ", ".join(names[:3]) + (" ..." if len(names) > 3 else "")
            self.tell(
                f"{finger} has labels of only one class left without {some}: not judged there"
            )

    def searches_without(self) -> list[set[int]]:
        """The units that each search for the parameters of the figures leaves out."""
        n_units = len(self.division.units)
        n_searches = min(N_SEARCHES, n_units) if self.setting.trials else 0
        return [set(range(k, n_units, n_searches)) for k in range(n_searches)]

    def search(self, without: Sequence[Collection[int]]) -> list[dict[str, Parameters]]:
        """The parameters of every finger, found without those units, for each set of units."""
        setting = self.setting
        if not setting.trials:
            reference = {finger: setting.recipe_of(finger).reference for finger in self.designs}
            return [reference for _ in without]
        tasks = [
            (thin(design.without(held), SEARCH_SAMPLES), setting, finger, self.journal)
            for held in without
            for finger, design in self.designs.items()
        ]
        found = list(self.follow(map_ordered(_search, tasks, self.n_jobs), "searching", len(tasks)))
        for warning in dict.fromkeys(warning for _, warning in found if warning):
            self.tell(warning)
        parameters = iter(parameters for parameters, _ in found)
        return [{finger: next(parameters) for finger in self.designs} for _ in without]

    def cross_validate(self, found: Sequence[Mapping[str, Parameters]]) -> Metrics:
        """The metrics of predictions out of fold.

        Args:
            found: parameters of every finger; unit k takes those of place k, modulo how many.
        """
        n_units = len(self.division.units)
        tasks = [
            (self.material, self.setting, found[unit % len(found)], {unit})
            for unit in range(n_units)
        ]
        models = list(self.follow(map_ordered(fit_model, tasks, self.n_jobs), "fitting", n_units))
        judged = (
            self._judge(models, place, recording)
            for place, recording in enumerate(self._read("judging"))
        )
        return summarise(judged, seed=self.setting.seed)

    def sign(self, model: Model, parameters: Mapping[str, Parameters], metrics: Metrics) -> Model:
        """The model with its origin written into it."""
        pooled = metrics.pooled
        training = Training(
            recordings=seen_by(self.setting.init, self.found),
            split=self.setting.split,
            parameters={finger: dict(found) for finger, found in parameters.items()},
            figures={name: getattr(pooled, name) for name in ("accuracy", "fdr", "fnr", "auc")},
            seed=self.setting.seed,
            versions={name: version(name) for name in ("holdfast", "numpy", "scikit-learn")},
        )
        return msgspec.structs.replace(model, training=training)

    def _read(self, what: str) -> Iterator[Recording]:
        return self.follow(self.recordings, what, len(self.recordings))

    def _judge(self, models: Sequence[Model | None], place: int, recording: Recording) -> Decisions:
        """What the models that have not seen it say; nothing where there is nothing to say."""
        nothing = Decisions(recording.name, {})
        if not self.found.entries[place].n_labelled:
            return nothing
        if self.division.split != "random":
            model = models[self.division.group_of[place]]
            return nothing if model is None else _judged(model, recording)
        judged = [_judged(model, recording) for model in models if model is not None]
        if len(judged) < len(models) or len({tuple(each.fingers) for each in judged}) > 1:
            return nothing
        return pick(judged, lambda n: self.division.units_of(place, n), len(self.designs))


def _judged(model: Model, recording: Recording) -> Decisions:
    if ANY_FINGER not in model.fingers and not set(model.fingers) & set(recording.modules):
        return Decisions(recording.name, {})
    return decisions_of(model, recording)


def _search(
    samples: Samples, setting: Setting, finger: str, journal: Path | None
) -> tuple[Parameters, str]:
    """The parameters found, and a warning where no search was possible."""
    folds = inner_folds(samples, INNER_FOLDS, setting.seed)
    if len(folds) < 2:
        return setting.recipe_of(finger).reference, (
            f"{finger}: {len(folds)} of the folds by recording hold both classes, 2 needed to "
            "search for parameters; the reference setting is taken"
        )
    return search(
        samples,
        folds,
        setting.recipe_of(finger),
        n_trials=setting.trials,
        seed=setting.seed,
        journal=journal,
    ), ""


def _tell_undecided(metrics: Metrics, tell: Tell) -> None:
    """Warns where much of the labelled data was left without a decision."""
    n_labelled = metrics.pooled.n + metrics.pooled.n_undecided
    share = metrics.pooled.n_undecided / max(n_labelled, 1)
    if share > UNDECIDED_SHARE:
        tell(
            f"{100 * share:.0f} % of the labelled samples have no decision, for tare, warm-up, "
            "gaps or faults (holdfast detect --summary tells which); recordings that begin in "
            "contact need --tare first"
        )
