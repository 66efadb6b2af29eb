"""Training and its honest figures: fit on all, judge out of fold, by the detector itself."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import msgspec

from holdfast.classifiers import Parameters, Recipe, Samples
from holdfast.metrics import Decisions, Metrics, summarise
from holdfast.model import Model, Training
from holdfast.parallel import each
from holdfast.recordings import Recording
from holdfast.training.design import gather
from holdfast.training.fitting import Material, fit_model
from holdfast.training.judging import decisions_of, pick
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

Tell = Callable[[str], None]
Follow = Callable[[Sequence[Recording], str], Iterator[Recording]]


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
    follow: Follow = lambda items, _: iter(items),
    n_jobs: int = 1,
) -> Trained:
    """Trains a model, and measures it on what it has not seen.

    Recordings are read one at a time, and more than once; memory holds their features.

    Args:
        recordings: labelled; a lazy dataset will do.
        setting: how to train; the default of the paper's deployed model.
        journal: file that keeps the search, so that a stopped one can go on.
        tell: is given every warning.
        follow: goes through recordings, with a word on what for; may show progress.
        n_jobs: fits at a time; -1 for as many as there are processors.

    Raises:
        TrainingError: no labels, one class, or too few recordings or objects for the split.
        RecordingError: a recording cannot be read.
    """
    setting = setting or Setting()
    trainer = _Trainer(recordings, setting, journal, tell, follow, n_jobs)
    parameters = trainer.search(NOBODY)
    model = fit_model(trainer.material, setting, parameters, NOBODY)
    metrics = trainer.cross_validate(parameters)
    _tell_undecided(metrics, tell)
    return Trained(trainer.sign(model, parameters, metrics), metrics)


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
        self.found = survey(follow(recordings, "reading"))
        self.division = divide(self.found.entries, setting.split, setting.seed)
        self.designs = gather(follow(recordings, "features"), self.found, setting, self.division)
        self.material = Material(self.found, self.division, self.designs)
        self.material.check_classes()

    def search(self, held: Collection[int]) -> dict[str, Parameters]:
        """The parameters of every finger, found without those units."""
        setting = self.setting
        if not setting.trials:
            return dict.fromkeys(self.designs, setting.recipe.reference)
        tasks = [
            (design.without(held), setting, finger, _study_name(finger, held), self.journal)
            for finger, design in self.designs.items()
        ]
        n_jobs = 1 if self.journal else self.n_jobs  # a journal has one writer at a time
        found = list(each(_search, tasks, n_jobs))
        for warning in dict.fromkeys(warning for _, warning in found if warning):
            self.tell(warning)
        return dict(zip(self.designs, (parameters for parameters, _ in found), strict=True))

    def cross_validate(self, whole: Mapping[str, Parameters]) -> Metrics:
        """The metrics of predictions out of fold."""
        models = self._fold_models(whole)
        judged = (
            self._judge(models, place, recording)
            for place, recording in enumerate(self.follow(self.recordings, "judging"))
        )
        return summarise(judged, seed=self.setting.seed)

    def sign(self, model: Model, parameters: Mapping[str, Parameters], metrics: Metrics) -> Model:
        """The model with its origin written into it."""
        pooled = metrics.pooled
        training = Training(
            recordings={entry.name: entry.digest for entry in self.found.entries},
            split=self.setting.split,
            parameters={finger: dict(found) for finger, found in parameters.items()},
            figures={name: getattr(pooled, name) for name in ("accuracy", "fdr", "fnr", "auc")},
            seed=self.setting.seed,
            versions={name: version(name) for name in ("holdfast", "numpy", "scikit-learn")},
        )
        return msgspec.structs.replace(model, training=training)

    def _fold_models(self, whole: Mapping[str, Parameters]) -> list[Model]:
        """A model for each unit, none of whose parts has seen that unit."""
        n_units = len(self.division.units)
        n_searches = min(N_SEARCHES, n_units) if self.setting.trials else 1
        found = [whole]
        if self.setting.trials:
            found = [self.search(set(range(k, n_units, n_searches))) for k in range(n_searches)]
        tasks = [
            (self.material, self.setting, found[unit % n_searches], {unit})
            for unit in range(n_units)
        ]
        return list(each(fit_model, tasks, self.n_jobs))

    def _judge(self, models: Sequence[Model], place: int, recording: Recording) -> Decisions:
        if self.division.split != "random":
            return decisions_of(models[self.division.group_of[place]], recording)
        judged = [decisions_of(model, recording) for model in models]
        return pick(judged, lambda n: self.division.units_of(place, n), len(models[0].fingers))


def _tell_undecided(metrics: Metrics, tell: Tell) -> None:
    """Warns where much of the labelled data was left without a decision."""
    n_labelled = metrics.pooled.n + metrics.pooled.n_undecided
    share = metrics.pooled.n_undecided / max(n_labelled, 1)
    if share > UNDECIDED_SHARE:
        tell(
            f"{100 * share:.0f} % of the labelled samples have no decision, for the tare, gaps or "
            "faults (holdfast detect tells which); recordings that begin in contact need "
            "--tare first"
        )


def _search(
    samples: Samples, setting: Setting, finger: str, name: str, journal: Path | None
) -> tuple[Parameters, str]:
    """The parameters found, and a warning where no search was possible."""
    step = max(1, len(samples.stable) // SEARCH_SAMPLES)
    spread = Samples(samples.features[::step], samples.stable[::step], samples.groups[::step])
    folds = inner_folds(spread, INNER_FOLDS, setting.seed)
    recipe: Recipe = setting.recipe
    if len(folds) < 2:
        return recipe.reference, (
            f"{finger}: {len(folds)} of the folds by recording hold both classes, 2 needed to "
            "search for parameters; the reference setting is taken"
        )
    return search(
        spread,
        folds,
        recipe,
        n_trials=setting.trials,
        seed=setting.seed,
        journal=journal,
        name=name,
    ), ""


def _study_name(finger: str, held: Collection[int]) -> str:
    return f"{finger} without {sorted(held)}" if held else finger
