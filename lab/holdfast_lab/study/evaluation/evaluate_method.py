"""Evaluation of one method: fit it to some recordings, score and count on others.

A recording that is evaluated has no influence on the fit that scores it: not on the classifiers,
not on the contact thresholds, and not on the thresholds for a rate of false alarms. Those are
chosen on the training recordings, each scored by a fit without it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.classifiers.folds import deal_folds, random_folds, shuffled
from holdfast.contact import STABLE, UNKNOWN
from holdfast.metrics import Decisions, FingerDecisions, Metrics, summarise
from holdfast.metrics.masks import Mask
from holdfast.training.splits import RANDOM_FOLDS
from holdfast_lab.study.evaluation.alarm_statistics import (
    AlarmStatistics,
    alarm_statistics,
    near_glitch,
)
from holdfast_lab.study.evaluation.common_samples import find_method, longest_warm_up
from holdfast_lab.study.evaluation.error_breakdown import (
    CountPair,
    ErrorBreakdown,
    break_down_errors,
    calibration_counts,
    decided_units,
)
from holdfast_lab.study.evaluation.fitted_method import (
    FittedMethod,
    TrainingSamples,
    gather_training_samples,
)
from holdfast_lab.study.evaluation.glitch_counts import GlitchCount, count_glitches
from holdfast_lab.study.evaluation.glitch_readings import EVENT, READINGS, labels_by_reading
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures, corpus_features
from holdfast_lab.study.evaluation.scores import RecordingScores
from holdfast_lab.study.evaluation.thresholds import FalseAlarmRanges, threshold_shift
from holdfast_lab.study.evaluation.variation import Variation
from holdfast_lab.study.methods import HAND, Method
from holdfast_lab.study.plan import Corpus

FALSE_ALARM_RATES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""Rates of false alarms that thresholds are chosen for, per minute of stable label [1/min]."""
COMPARED_RATE = 1.0
"""The rate of false alarms at which methods are compared [1/min]."""
HOLD_TIME = 0.1
"""Time for which a hand stays not stable at the chosen thresholds [s].

So one disturbance is one alarm, whatever the method.
"""

GroupSplit = Literal["recording", "object"]


class EvaluationEffort(msgspec.Struct, frozen=True):
    """Size of an evaluation.

    Attributes:
        folds: of whole recordings. Each object is spread over all folds.
        inner: folds of the training recordings of each fold, on which thresholds are chosen.
        stride: evaluate every n-th sample.
        max_samples: of a unit, that train a classifier; evenly thinned.
    """

    folds: int = 5
    inner: int = 3
    stride: int = 1
    max_samples: int = 20_000


class EvaluationJob(msgspec.Struct, frozen=True):
    """One method and the recordings that it is evaluated on.

    Attributes:
        method: its name.
        train: corpus that the method is fitted to.
        splits: of that corpus. A fold holds out recordings, or all recordings of one object.
        tests: other corpora, evaluated with a fit to all of `train`.
        variation: of the recordings of all corpora.
        effort: size of the evaluation.
        seed: of all random numbers.
        compared: names of the methods that must have an estimate too where this one is scored.
    """

    method: str
    train: Corpus
    splits: tuple[GroupSplit, ...] = ("recording",)
    tests: tuple[Corpus, ...] = ()
    variation: Variation = Variation()
    effort: EvaluationEffort = EvaluationEffort()
    seed: int = 0
    compared: tuple[str, ...] = ()

    @property
    def warm_up(self) -> float:
        """Time at the start of every stretch that is not scored [s]."""
        return longest_warm_up(self.compared, self.train.rate / self.variation.every)


class ReadingAlarms(msgspec.Struct, frozen=True):
    """Alarms of the hand under one reading of glitches. Lists have one entry per recording.

    Attributes:
        own: at the method's own threshold.
        held: the same, with decisions held for `HOLD_TIME`.
        by_rate: the same, held, at the threshold chosen for each of `FALSE_ALARM_RATES`.
    """

    own: list[AlarmStatistics]
    held: list[AlarmStatistics]
    by_rate: list[list[AlarmStatistics]]

    @property
    def compared(self) -> list[AlarmStatistics]:
        """Alarms at the threshold at which methods are compared."""
        return self.by_rate[FALSE_ALARM_RATES.index(COMPARED_RATE)]


class MethodEvaluation(msgspec.Struct, frozen=True):
    """Results of one method on one split or corpus. Lists have one entry per recording.

    Attributes:
        names: of the evaluated recordings.
        fingers: metrics by sample at the method's own threshold; None for a whole-hand method.
        hand: the same for the hand.
        without_estimate: labelled samples of what the method decides for, and those of them
            that have no estimate; before the samples are restricted to those of all methods.
        hand_without_estimate: the same for the hand.
        readings: alarms of the hand, by exact labels, for each of `READINGS`.
        glitches: of the hand's controller.
        breakdown: of the errors at the method's own threshold.
        calibration: (10, 3) sum of probabilities, stable samples and all samples of each bin.
    """

    names: list[str]
    fingers: Metrics | None
    hand: Metrics
    without_estimate: list[CountPair]
    hand_without_estimate: list[CountPair]
    readings: dict[str, ReadingAlarms]
    glitches: list[GlitchCount]
    breakdown: list[ErrorBreakdown]
    calibration: list[list[list[float]]]

    @property
    def metrics(self) -> Metrics:
        """Metrics of what the method decides for: the fingers, or the hand."""
        return self.fingers or self.hand

    @property
    def alarms(self) -> ReadingAlarms:
        """Alarms in the paper's reading: a glitch is an event."""
        return self.readings[EVENT]


class FittedFold(NamedTuple):
    """A fitted method and its thresholds.

    Attributes:
        fitted: to all training recordings.
        shifts: of the threshold for each of `FALSE_ALARM_RATES`, for each of `READINGS`.
    """

    fitted: FittedMethod
    shifts: Mapping[str, Sequence[float]]


class ScoredRecording(NamedTuple):
    """A recording, its scores and the shifts of the threshold, see `FittedFold`."""

    recording: RecordingFeatures
    scores: RecordingScores
    shifts: Mapping[str, Sequence[float]]


def evaluate_method(job: EvaluationJob) -> dict[str, MethodEvaluation]:
    """Return the results of a method on each split and on each other corpus.

    A split by object is left out if there are fewer than two objects, or an unknown one.

    Returns:
        By name of the split or of the corpus.

    Raises:
        TrainingError: a whole-hand method gets too few fingers.
    """
    return {key: summarise_recordings(scored) for key, scored in score_splits(job) if scored}


def score_splits(job: EvaluationJob) -> Iterator[tuple[str, list[ScoredRecording]]]:
    """Yield the scored recordings of each split and of each other corpus, in order."""
    method = find_method(job.method)
    recordings = _corpus_features(job, method, job.train)
    training = gather_training_samples(recordings, job.effort.max_samples)
    everything = frozenset(range(len(recordings)))
    for split in job.splits:
        scored: dict[int, ScoredRecording] = {}
        for held in held_out_folds(training.objects, split, job.effort.folds, job.seed):
            fold = _fit_fold(job, method, training, recordings, everything - held)
            scored |= {place: _score(fold, recordings[place]) for place in held}
        yield split, [scored[place] for place in sorted(scored)]
    if job.tests:
        fold = _fit_fold(job, method, training, recordings, everything)
        for corpus in job.tests:
            tested = _corpus_features(job, method, corpus)
            yield corpus.name, [_score(fold, recording) for recording in tested]


def _corpus_features(job: EvaluationJob, method: Method, corpus: Corpus) -> list[RecordingFeatures]:
    return corpus_features(method, corpus, job.variation, job.effort.stride, job.warm_up)


def held_out_folds(
    objects: Sequence[str | None], split: GroupSplit, n_folds: int, seed: int
) -> Iterator[frozenset[int]]:
    """Yield the numbers of the recordings that each fold holds out.

    Every recording is in one fold. There is no fold by object if there are fewer than two
    objects, or an unknown one.

    Args:
        objects: of the recordings; None if unknown.
        split: `recording` or `object`.
        n_folds: maximum, by recording.
        seed: of the folds by recording.
    """
    if split == "object":
        names = list(dict.fromkeys(objects))
        if len(names) < 2 or None in names:
            return
        folds = np.array([names.index(name) for name in objects])
    else:
        folds = balanced_groups(objects, min(n_folds, len(objects)), seed)
    for fold in np.unique(folds):
        yield frozenset(np.flatnonzero(folds == fold).tolist())


def balanced_groups(
    objects: Sequence[str | None], n_groups: int, seed: int
) -> npt.NDArray[np.int64]:
    """Return (n_recordings,) groups of equal size, with each object spread over the groups."""
    order = shuffled(len(objects), seed)
    order = order[np.argsort(np.array([str(objects[k]) for k in order]), kind="stable")]
    return deal_folds(len(objects), n_groups, order)


def _fit_fold(
    job: EvaluationJob,
    method: Method,
    training: TrainingSamples,
    recordings: Sequence[RecordingFeatures],
    places: frozenset[int],
) -> FittedFold:
    """Fit the method to the recordings at `places`, and choose its thresholds on them."""
    ordered = sorted(places)
    objects = [training.objects[place] for place in ordered]
    n_inner = min(job.effort.inner, len(ordered))
    folds = held_out_folds(objects, "recording", n_inner, job.seed + 1) if n_inner > 1 else ()
    ranges: list[dict[str, FalseAlarmRanges]] = []
    for fold in folds:
        held = {ordered[k] for k in fold}
        fitted = FittedMethod.fit(method, training, places - held, job.seed)
        ranges += [_false_alarm_ranges(fitted, recordings[place]) for place in sorted(held)]
    return FittedFold(FittedMethod.fit(method, training, places, job.seed), _shifts(ranges))


def _false_alarm_ranges(
    fitted: FittedMethod, recording: RecordingFeatures
) -> dict[str, FalseAlarmRanges]:
    """Return the ranges of the false alarms for each reading of glitches."""
    scores = fitted.scores(recording).hand(recording).hold(HOLD_TIME)
    return {
        reading: FalseAlarmRanges.of(
            scores,
            hand.labels,
            near_glitch(scores.times, hand.glitch) if hand.without_glitches else None,
        )
        for reading, hand in labels_by_reading(recording).items()
    }


def _shifts(ranges: Sequence[Mapping[str, FalseAlarmRanges]]) -> dict[str, list[float]]:
    if not ranges:
        return {reading: [0.0] * len(FALSE_ALARM_RATES) for reading in READINGS}
    return {
        reading: [threshold_shift([each[reading] for each in ranges], rate)
                  for rate in FALSE_ALARM_RATES]
        for reading in READINGS
    }  # fmt: skip


def _score(fold: FittedFold, recording: RecordingFeatures) -> ScoredRecording:
    """Score a recording; its features are dropped to save memory."""
    scores = fold.fitted.scores(recording)
    return ScoredRecording(replace(recording, features={}), scores, fold.shifts)


def summarise_recordings(scored: Sequence[ScoredRecording]) -> MethodEvaluation:
    """Return the results of a method on scored recordings."""
    decisions = [
        each.scores.decide(each.recording, each.recording.scored_labels) for each in scored
    ]
    every = [each.scores.decide(each.recording, each.recording.labels) for each in scored]
    alarms = [_alarms(each) for each in scored]
    pairs = zip(scored, decisions, strict=True)
    return MethodEvaluation(
        names=[each.recording.name for each in scored],
        fingers=summarise(decisions) if any(decision.fingers for decision in decisions) else None,
        hand=summarise(_hands(decisions)),
        without_estimate=[_n_without_estimate(decided_units(each).values()) for each in every],
        hand_without_estimate=[_n_without_estimate([each.hand]) for each in every],
        readings={reading: _pooled([alarm[reading] for alarm in alarms]) for reading in READINGS},
        glitches=[count_glitches(each.recording.truth) for each in scored],
        breakdown=[break_down_errors(each.recording.truth, decided) for each, decided in pairs],
        calibration=[calibration_counts(decision) for decision in decisions],
    )


def _n_without_estimate(units: Iterable[FingerDecisions | None]) -> CountPair:
    """Return the number of labelled samples, and of those of them without an estimate."""
    n = n_without = 0
    for unit in units:
        if unit is not None:
            labelled = unit.labels != UNKNOWN
            n += int(labelled.sum())
            n_without += int((labelled & (unit.states == UNKNOWN)).sum())
    return n, n_without


def _alarms(scored: ScoredRecording) -> dict[str, list[AlarmStatistics]]:
    """Return the alarms for each reading: at the own threshold, held at it, at each chosen one."""
    recording = scored.recording
    scores = scored.scores.hand(recording)
    held = scores.hold(HOLD_TIME)
    by_reading = {}
    for reading, hand in labels_by_reading(recording).items():
        decided = [scores.decide(hand.labels)]
        decided += [held.decide(hand.labels, s) for s in (0.0, *scored.shifts[reading])]
        left_out = hand.without_glitches
        by_reading[reading] = [
            alarm_statistics(each, hand.glitch, without_glitches=left_out) for each in decided
        ]
    return by_reading


def _pooled(alarms: Sequence[Sequence[AlarmStatistics]]) -> ReadingAlarms:
    """Return the alarms of all recordings, by threshold."""
    return ReadingAlarms(
        own=[alarm[0] for alarm in alarms],
        held=[alarm[1] for alarm in alarms],
        by_rate=[[alarm[2 + k] for alarm in alarms] for k in range(len(FALSE_ALARM_RATES))],
    )


def _hands(decisions: Iterable[Decisions]) -> Iterator[Decisions]:
    """Yield the hands alone, each as the one finger of its recording."""
    for decision in decisions:
        if decision.hand is not None:
            yield Decisions(decision.name, {HAND: decision.hand}, decision.hand)


def evaluate_pooled(job: EvaluationJob) -> list[list[int]]:
    """Return [TN, FP, FN, TP] of each recording by random folds of the pooled samples.

    This is the paper's split: neighbours of a test sample are in the training set. Everything
    else is as in the other splits, so that the difference is due to the split alone.

    Args:
        job: gives the method, the training corpus, the variation, the effort and the seed.
    """
    method = find_method(job.method)
    recordings = _corpus_features(job, method, job.train)
    generator = np.random.default_rng(job.seed)
    folds = [
        {
            unit: random_folds(len(rows), RANDOM_FOLDS, generator)
            for unit, rows in recording.features.items()
        }
        for recording in recordings
    ]
    counts = np.zeros((len(recordings), 4), dtype=np.int64)
    for fold in range(RANDOM_FOLDS):
        trained = [
            _with_features_of(recording, {unit: each != fold for unit, each in own.items()})
            for recording, own in zip(recordings, folds, strict=True)
        ]
        training = gather_training_samples(trained, job.effort.max_samples)
        fitted = FittedMethod.fit(method, training, range(len(recordings)), job.seed)
        for place, (recording, own) in enumerate(zip(recordings, folds, strict=True)):
            tested = _with_features_of(
                recording, {unit: each == fold for unit, each in own.items()}
            )
            counts[place] += _confusion(fitted.scores(tested).decide(tested, tested.scored_labels))
    return [[int(n) for n in row] for row in counts]


def _with_features_of(
    recording: RecordingFeatures, chosen: Mapping[str, Mask]
) -> RecordingFeatures:
    """Return the recording with NaN as the features of all other samples."""
    features = {
        unit: np.where(chosen[unit][:, None], rows, np.nan)
        for unit, rows in recording.features.items()
    }
    return replace(recording, features=features)


def _confusion(decisions: Decisions) -> npt.NDArray[np.int64]:
    """Return (4,) TN, FP, FN, TP of the samples with a label and a decision."""
    counts = np.zeros(4, dtype=np.int64)
    for unit in decided_units(decisions).values():
        known = (unit.labels != UNKNOWN) & (unit.states != UNKNOWN)
        place = 2 * (unit.labels == STABLE) + (unit.states == STABLE)
        counts += np.bincount(place[known], minlength=4)
    return counts
