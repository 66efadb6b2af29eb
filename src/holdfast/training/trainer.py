"""Training: fit a model to all recordings, and cross-validate it with the detector itself."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import msgspec

from holdfast.detection import ANY_FINGER, FeatureSpec, Model
from holdfast.metrics import (
    Decisions,
    Metrics,
    RecordingResults,
    ResultTotal,
    score_recording,
)
from holdfast.metrics.slips import SlipCounts
from holdfast.parallel import Engine
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast.training.adaptation import (
    adaptation_warnings,
    choose_adaptation,
    known_recordings,
)
from holdfast.training.classifiers.fitting import Parameters, Samples
from holdfast.training.dataset_scan import (
    OneRecording,
    Progress,
    RecordingScan,
    combine_scans,
    scan_recording,
    show_nothing,
)
from holdfast.training.evaluation import combine_decisions, compute_decisions_and_tare
from holdfast.training.finger_samples import thin, thinning_step
from holdfast.training.head_fits import missing_heads
from holdfast.training.model_fit import (
    TrainingData,
    fit_full_model,
    fit_model,
    training_record,
)
from holdfast.training.parameter_grid import INNER_FOLDS, choose_parameters
from holdfast.training.setting import SEARCH_SAMPLES, Setting, Split
from holdfast.training.splits import DataSplit, inner_folds, split_data
from holdfast.training.thresholds import choose_slip_threshold, with_slip_threshold
from holdfast.training.training_samples import SamplesPlan, gather_samples
from holdfast.training.verdict import LoadedTares, verdict

MAX_CHOICES = 5
"""Maximum number of choices of parameters for the cross-validation.

The parameters with which a unit is evaluated come from a choice that leaves the unit out."""

MAX_FITS = 500
"""Maximum number of models that the cross-validation fits.

Of more recordings (or objects), every 500th is held out together. It is a multiple of
`MAX_CHOICES`, so that the choice for each of these groups leaves it out."""

MAX_UNDECIDED_FRACTION = 0.2
"""Warn when more than this fraction of the labelled samples has no decision."""

Warn = Callable[[str], None]


@dataclass(frozen=True)
class Trained:
    """A model and its metrics.

    Attributes:
        model: fitted to all recordings.
        cross_validation: metrics of predictions out of fold.
        split: unit that the cross-validation left out.
        tares: recordings whose tare was taken under load, of all.
        known: names of the recordings that the model to adapt was trained on.
    """

    model: Model
    cross_validation: Metrics
    split: Split = "recording"
    tares: LoadedTares | None = None
    known: tuple[str, ...] = ()

    @property
    def verdict(self) -> str | None:
        """The verdict on the model; None if some recordings are `known`."""
        return None if self.known else verdict(self.cross_validation, self.tares)


def train(
    recordings: Sequence[Recording],
    setting: Setting | None = None,
    *,
    warn: Warn = lambda _: None,
    progress: Progress = show_nothing,
    n_jobs: int = 1,
    engine: Engine | None = None,
) -> Trained:
    """Train a model, and evaluate it on recordings that it was not trained on.

    Recordings are read one at a time, and more than once. Of their features, at most
    `setting.max_samples` for each finger stay in memory.

    Args:
        recordings: labelled; may be a lazy dataset.
        setting: of the training; by default the paper's deployed model has it.
        warn: is called with the text of every warning.
        progress: iterates over recordings, choices and fits.
        n_jobs: number of processes on this machine; -1 for one per processor.
        engine: that reads the recordings, chooses and fits, instead of `n_jobs` processes. The
            result is the same. On a cluster, all machines need the recordings at the same
            paths.

    Raises:
        TrainingError: there are no labels, only one class, or too few recordings or objects
            for the split.
        ModelError: the model to adapt lacks a finger of the recordings.
        RecordingError: a recording cannot be read.
        EngineError: the engine cannot be used.
    """
    setting, engine = setting or Setting(), engine or Engine(n_jobs)
    trainer = _Trainer.read(recordings, setting, warn, progress, engine)
    trainer.check()
    # The first choice has all samples, and gives the final model its parameters. The others leave
    # out the units that their parameters are evaluated on.
    final, *held_out = trainer.choose_parameters([set(), *trainer.choice_units()])
    model = fit_full_model(trainer.data, trainer.setting, final)
    scored = trainer.cross_validate(held_out or [final])
    n_undecided = scored.metrics.pooled.n_undecided
    fraction = n_undecided / max(scored.metrics.pooled.n + n_undecided, 1)
    if fraction > MAX_UNDECIDED_FRACTION:
        warn(
            f"{100 * fraction:.0f} % of the labelled samples have no decision because of tare, "
            "warm-up, gaps or faults (see holdfast detect --summary); recordings that begin in "
            "contact need --tare first"
        )
    # An adapted model keeps the other heads of the model that it comes from.
    if setting.init is None:
        samples = trainer.data.samples
        for warning in missing_heads(model, samples.of("slip"), samples.of("cause")):
            warn(warning)
    model, metrics = trainer.choose_slip_threshold(model, scored)
    # The figures in the file are those after the choice of the threshold: slips are among them.
    provenance = training_record(
        trainer.setting,
        trainer.data.scan,
        final,
        metrics.pooled,
        trainer.data.thinned,
        {
            finger: samples.n_positive
            for finger, samples in trainer.data.samples.of("slip").items()
            if model.finger(finger).slip is not None
        },
    )
    blocks = [recording.blocks for recording in trainer.data.scan.recordings]
    model = model.with_training(provenance, blocks)
    init = trainer.setting.init
    names = () if init is None else tuple(known_recordings(init, trainer.data.scan))
    tares = LoadedTares(scored.n_loaded, len(recordings))
    return Trained(model, metrics, trainer.setting.split, tares, names)


class OutOfFold(NamedTuple):
    """Results of models about recordings that they were not fitted to.

    Attributes:
        metrics: of all recordings.
        slip_curves: counts of slips of each finger at each threshold, of each recording.
        n_loaded: number of recordings whose tare was taken under load.
    """

    metrics: Metrics
    slip_curves: list[Mapping[str, SlipCounts]]
    n_loaded: int


@dataclass(frozen=True)
class _Trainer:
    """A dataset that is read, and what it is trained with.

    Attributes:
        recordings: of the dataset.
        setting: of the training, with what follows from the dataset.
        data: training samples of every head.
        warn: is called with the text of every warning.
        progress: iterates over recordings, choices and fits.
        engine: that reads the recordings, chooses and fits.
    """

    recordings: Sequence[Recording]
    setting: Setting
    data: TrainingData
    warn: Warn
    progress: Progress
    engine: Engine

    @classmethod
    def read(
        cls,
        recordings: Sequence[Recording],
        setting: Setting,
        warn: Warn,
        progress: Progress,
        engine: Engine,
    ) -> Self:
        """Scan the recordings, and gather the samples of every head from them."""
        parts = ((OneRecording(recordings, index),) for index in range(len(recordings)))
        scans = engine.map_ordered(_scan_part, parts, shared=(setting.relative,))
        read = progress(scans, "reading", len(recordings))
        scan = combine_scans(read, setting.rate, relative=setting.relative)
        init = setting.init
        if init is None:
            features = _that_fit(setting.features, scan.smallest, warn)
            setting = replace(setting, features=features)
        elif any(part.handling for part in init.fingers.values()):
            # Adaptation starts from the calibrated classifier: the calibration becomes a part of
            # its weights.
            setting = replace(setting, init=init.with_handling_of(scan.sensors))
        if setting.split == "recording" and init is not None and len(scan.recordings) == 1:
            # To adapt to a single grasp is allowed, though nothing else can be held out.
            warn(
                "one recording given: the metrics are by blocks of time within it (--split time), "
                "and too good; the next grasp is another"
            )
            setting = replace(setting, split="time")
        data_split = split_data(scan.recordings, setting.split, setting.seed)
        slips = setting.slip_features and _that_fit(setting.slip_features, scan.smallest, warn)
        plan = SamplesPlan(
            scan, setting, data_split, slips or setting.features,
            only_stable=setting.init is not None,
        )  # fmt: skip
        samples = gather_samples(recordings, plan, engine, progress)
        if slips and not samples.of("slip"):
            warn("no slips are known in the recordings: the model gets no slip rule")
        data = TrainingData(scan, data_split, samples, plan.slip_features, slip_squares=bool(slips))
        return cls(recordings, setting, data, warn, progress, engine)

    def check(self) -> None:
        """Check the samples, and warn of metrics that are missing or may be wrong.

        Raises:
            TrainingError: a finger has only one class, or cross-validation is not possible.
            ModelError: the model to adapt lacks a finger.
        """
        self.data.check_classes()
        for finger, (n_used, n) in self.data.thinned.items():
            step = thinning_step(self.data.scan.n_labelled, self.setting.max_samples)
            self.warn(
                f"{finger}: fitted to {n_used} of {n} labelled samples, one of {step} "
                "(--max-samples); the metrics are on all of them"
            )
        if (init := self.setting.init) is not None:
            for warning in adaptation_warnings(init, self.data.scan, self.data.fingers):
                self.warn(warning)
        for finger, names in self.data.units_without_model().items():
            first = ", ".join(names[:3]) + (" ..." if len(names) > 3 else "")
            self.warn(f"{finger} has only one class of labels without {first}: not evaluated there")

    def choice_units(self) -> list[set[int]]:
        """Return the units that each choice for the cross-validation leaves out."""
        n_units = len(self.data.data_split.units)
        n_choices = min(MAX_CHOICES, n_units) if self.setting.trials is None else 0
        return [set(range(k, n_units, n_choices)) for k in range(n_choices)]

    def choose_parameters(
        self, left_out_units: Sequence[Collection[int]]
    ) -> list[dict[str, Parameters]]:
        """Choose the parameters of every finger, once for each collection of held-out units.

        With 0 trials, return the reference parameters. A model to adapt has a few candidates
        instead of a grid.
        """
        setting, init, fingers = self.setting, self.setting.init, self.data.fingers
        if setting.trials is not None:
            reference = {finger: setting.recipe_of(finger).reference for finger in fingers}
            return [reference for _ in left_out_units]
        choices: list[dict[str, Parameters]] = [{} for _ in left_out_units]
        if init is not None:
            for left_out, parameters_of in zip(left_out_units, choices, strict=True):
                for finger, pool in fingers.items():
                    prior = init.finger(finger).stable.rule
                    adaptation = choose_adaptation(pool, prior, left_out)
                    parameters_of[finger] = adaptation.parameters
                    if not left_out:  # the final model: the one that the user gets
                        self.warn(adaptation.describe(init.name or "the model to adapt", finger))
            return choices
        tasks = (
            (thin(pool.without(left_out), SEARCH_SAMPLES), setting, finger)
            for left_out in left_out_units
            for finger, pool in fingers.items()
        )
        results = self.engine.map_ordered(_choose, tasks)
        n_tasks = len(left_out_units) * len(fingers)
        chosen = list(self.progress(results, "choosing", n_tasks))
        for warning in dict.fromkeys(warning for _, warning in chosen if warning):
            self.warn(warning)
        parameters = iter(parameters for parameters, _ in chosen)
        return [{finger: next(parameters) for finger in fingers} for _ in left_out_units]

    def cross_validate(self, chosen: Sequence[Mapping[str, Parameters]]) -> OutOfFold:
        """Score predictions out of fold.

        Args:
            chosen: parameters of every finger from each choice. Unit k uses the parameters of
                choice k modulo the number of choices.
        """
        n_units = len(self.data.data_split.units)
        n_fits = min(n_units, MAX_FITS)
        n = len(chosen)
        tasks = ((chosen[k % n], set(range(k, n_units, n_fits))) for k in range(n_fits))
        fits = self.engine.map_ordered(fit_model, tasks, shared=(self.data, self.setting))
        models = list(self.progress(fits, "fitting", n_fits))
        if n_fits < n_units:
            self.warn(f"{n_units} {self.setting.split}s are held out in {n_fits} groups, not alone")

        def calls() -> Iterator[tuple[int, str, Sequence[Recording], list[Model | None]]]:
            by_samples = self.data.data_split.split in ("time", "random")
            for index, scanned in enumerate(self.data.scan.recordings):
                # A recording is scored by the one model that was fitted without it; if samples
                # are held out, by each model on its samples; without labels, by none.
                used = models if scanned.n_labelled else []
                if used and not by_samples:
                    used = [models[self.data.data_split.group_of[index] % len(models)]]
                yield index, scanned.name, OneRecording(self.recordings, index), used

        context = (self.data.data_split, len(self.data.fingers))
        evaluated = self.engine.map_ordered(_score_out_of_fold, calls(), shared=context)
        total, slip_curves, n_loaded = ResultTotal(), [], 0
        for results, loaded in self.progress(evaluated, "evaluating", len(self.recordings)):
            total.add(results)
            slip_curves.append(results.slip_curves)
            n_loaded += loaded
        return OutOfFold(total.metrics(seed=self.setting.seed), slip_curves, n_loaded)

    def choose_slip_threshold(self, model: Model, scored: OutOfFold) -> tuple[Model, Metrics]:
        """Return the model with the threshold of its slip rules, and the metrics with slips.

        A model that is adapted keeps its slip rules. Warn of each rule that is not made.
        """
        replace_fields, init, metrics = msgspec.structs.replace, self.setting.init, scored.metrics
        if init is not None:
            fingers = {
                name: part.with_heads(
                    *(head for head in init.finger(name).heads if head.name != "stable")
                )
                for name, part in model.fingers.items()
            }
            return replace_fields(model, fingers=fingers), metrics
        if not model.has_slip_rule:
            return with_slip_threshold(model, None), replace_fields(metrics, slips=None)
        groups = self.data.data_split.group_of.tolist()
        chosen = choose_slip_threshold(scored.slip_curves, groups, self.setting.seed)
        if chosen.point is None:
            self.warn(f"{chosen.reason}; the model gets no slip rule")
        slips = None if chosen.point is None else chosen.metrics
        return with_slip_threshold(model, chosen.point), replace_fields(metrics, slips=slips)


def _that_fit(
    features: tuple[FeatureSpec, ...], smallest: Sensor, warn: Warn
) -> tuple[FeatureSpec, ...]:
    """Return the features that all sensors have, and warn of those that are left out."""
    n_taxels = smallest.n_taxels
    left_out = [spec for spec in features if spec.min_taxels > n_taxels]
    if not left_out:
        return features
    kinds = ", ".join(dict.fromkeys(spec.kind for spec in left_out))
    least = max(spec.min_taxels for spec in left_out)
    warn(
        f"{kinds} left out: {smallest.name} has {n_taxels} taxel{'s' * (n_taxels > 1)}, they "
        f"need at least {least}"
    )
    return tuple(spec for spec in features if spec.min_taxels <= n_taxels)


def _scan_part(relative: bool, part: Sequence[Recording]) -> RecordingScan:
    (recording,) = part
    return scan_recording(recording, relative=relative)


def _score_out_of_fold(
    data_split: DataSplit,
    n_fingers: int,
    index: int,
    name: str,
    part: Sequence[Recording],
    models: Sequence[Model | None],
) -> tuple[RecordingResults, bool]:
    """Return the results of models that are fitted without a recording, or parts of it.

    They are empty if there are no labels or no models.

    Args:
        data_split: of the dataset.
        n_fingers: number of fingers of the models.
        index: of the recording in the dataset.
        name: of the recording.
        part: only this recording.
        models: that are fitted without it, or without each unit of a split by samples.

    Returns:
        The results, and whether the tare of the recording was taken under load.
    """
    used = [model for model in models if model is not None]
    if not used:
        return score_recording(Decisions(name, {})), False
    (recording,) = part
    by_model, loaded = [], False
    for model in used:
        decisions = Decisions(name, {})
        # A model of other fingers cannot decide about this recording, and refuses it.
        if ANY_FINGER in model.fingers or set(model.fingers) & set(recording.modules):
            decisions, has_loaded_tare = compute_decisions_and_tare(model, recording)
            loaded |= has_loaded_tare
        by_model.append(decisions)
    combined = Decisions(name, {})
    if data_split.split not in ("time", "random"):
        combined = by_model[0]
    # Samples of a unit without a model have no decision out of fold, so all units need one.
    elif len(used) == len(models) and len({tuple(by.fingers) for by in by_model}) == 1:
        combined = combine_decisions(by_model, lambda n: data_split.units_of(index, n), n_fingers)
    return score_recording(combined, slip_curves=True), loaded


def _choose(samples: Samples, setting: Setting, finger: str) -> tuple[Parameters, str]:
    """Return the parameters of a finger, and a warning if they cannot be chosen."""
    folds, recipe = inner_folds(samples, INNER_FOLDS, setting.seed), setting.recipe_of(finger)
    if len(folds) >= 2:
        return choose_parameters(samples, folds, recipe, setting.seed), ""
    return recipe.reference, (
        f"{finger}: {len(folds)} of the folds by recording have both classes, 2 needed to choose "
        "parameters; the reference parameters are used"
    )
