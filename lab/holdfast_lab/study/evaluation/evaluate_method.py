"""Evaluation of one method: fit it to some recordings, score and count on others.

A recording that is evaluated has no influence on the fit that scores it: not on the classifiers,
not on the contact thresholds, and not on the thresholds for a rate of false alarms. Those are
chosen on the training recordings, each scored by a fit without it.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Literal

import msgspec
import numpy as np

from holdfast.contact import UNKNOWN
from holdfast.detection import Tare
from holdfast.metrics import Decisions, Metrics, calibration_sums, summarise
from holdfast.metrics.samples import score_samples
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.training.classifiers.folds import deal_folds, random_folds, shuffled
from holdfast.training.splits import RANDOM_FOLDS
from holdfast_lab.study.evaluation.alarm_labels import EVENT, READINGS
from holdfast_lab.study.evaluation.alarms import (
    AlarmStatistics,
    FalseAlarmRanges,
    threshold_shift,
)
from holdfast_lab.study.evaluation.fitted_method import (
    FittedMethod,
    MethodTraining,
    ScoredRecording,
)
from holdfast_lab.study.evaluation.held_object import (
    CountPair,
    GlitchCount,
    count_glitches,
    held_errors,
)
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures, corpus_features
from holdfast_lab.study.methods import HAND, METHODS, Method, hand_signal
from holdfast_lab.study.methods.slip_methods import SLIP_METHODS
from holdfast_lab.study.plan import Corpus

FALSE_ALARM_RATES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""Rates of false alarms that thresholds are chosen for, per minute of stable label [1/min]."""
COMPARED_RATE = 1.0
"""The rate of false alarms at which methods are compared [1/min]."""
PROBE_DURATION = 3.0
"""Duration of the random recording on which the history of a method is measured [s]."""
PROBE_FINGERS = ("thumb", "index")
HOLD_TIME = 0.1
"""Time for which a hand stays not stable at the chosen thresholds [s].

So one disturbance is one alarm, whatever the method.
"""

OWN, LASTING = "own", f"own, held {HOLD_TIME:g} s"
"""Names of a method's own threshold, and of the same with states held for `HOLD_TIME`."""
BY_RATE = {f"for {rate:g}/min": rate for rate in FALSE_ALARM_RATES}
"""Rates by the names of the thresholds that are chosen for them; states are held."""
COMPARED = f"for {COMPARED_RATE:g}/min"
"""Name of the threshold at which methods are compared."""

GroupSplit = Literal["recording", "object"]


def find_method(name: str) -> Method:
    """Return the method of that name, of `METHODS` or `SLIP_METHODS`."""
    return METHODS.get(name) or SLIP_METHODS[name].method


@lru_cache
def warm_up(method: str, rate: float) -> float:
    """Return the time from the start of a stretch until a method has an estimate [s].

    Methods need histories of different lengths: one sample, a window of 14, a second. It is
    measured: on a random recording of two fingers, it is the time of the first sample with
    features; 0 if there is none within `PROBE_DURATION`.

    Args:
        method: name.
        rate: samples per second [Hz].

    Example:
        >>> round(150 * warm_up("logreg", 150.0)), round(150 * warm_up("difference", 150.0))
        (13, 1)
    """
    generator = np.random.default_rng(0)
    times = np.arange(math.ceil(PROBE_DURATION * rate)) / rate
    kind = replace(sensor("uskin-4x4"), rate=rate, range=None)  # of small readings
    modules = {
        name: Tactile(kind, times, generator.normal(100.0, 10.0, (len(times), kind.n_taxels, 3)))
        for name in PROBE_FINGERS  # two, because whole-hand methods refuse one
    }
    hand = hand_signal(Recording("probe", modules), Tare.parse("none"), PROBE_FINGERS)
    features = find_method(method).features(hand)
    complete = np.all([np.isfinite(rows).all(axis=1) for rows in features.values()], axis=0)
    # argmax is 0 where nothing is known: such a method takes no samples from the others.
    return int(np.argmax(complete)) / rate


class EvaluationEffort(msgspec.Struct, frozen=True):
    """Size of an evaluation.

    Attributes:
        folds: of whole recordings. Each object is spread over all folds.
        inner: folds of the training recordings of each fold, on which thresholds are chosen.
        max_samples: of a unit, that train a classifier; evenly thinned.
    """

    folds: int = 5
    inner: int = 3
    max_samples: int = 20_000


class EvaluationJob(msgspec.Struct, frozen=True):
    """One method and the recordings that it is evaluated on.

    Attributes:
        method: its name, see `find_method`.
        train: corpus that the method is fitted to.
        splits: of that corpus. A fold leaves out recordings, or all recordings of one object.
        tests: other corpora, evaluated with a fit to all of `train`.
        effort: size of the evaluation.
        seed: of all random numbers.
        compared: names of the methods that must have an estimate too where this one is scored.
        slips: whether it decides about slips: only recordings whose slips are known are used, in
            the first split that is possible, and no thresholds are chosen for events.
    """

    method: str
    train: Corpus
    splits: tuple[GroupSplit, ...] = ("recording",)
    tests: tuple[Corpus, ...] = ()
    effort: EvaluationEffort = EvaluationEffort()
    seed: int = 0
    compared: tuple[str, ...] = ()
    slips: bool = False

    def features(self, corpus: Corpus) -> list[RecordingFeatures]:
        """Return the features of the recordings of a corpus."""
        longest = max(warm_up(name, self.train.rate) for name in (self.method, *self.compared))
        featured = corpus_features(find_method(self.method), corpus, longest)
        return [recording for recording in featured if recording.slips or not self.slips]

    def training(self, recordings: Sequence[RecordingFeatures]) -> MethodTraining:
        """Return the samples of recordings, from which the method is fitted."""
        sliding = self.slips and SLIP_METHODS[self.method].target == "sliding"
        method, most = find_method(self.method), self.effort.max_samples
        return MethodTraining.of(method, recordings, most, self.seed, sliding=sliding)


class MethodEvaluation(msgspec.Struct, frozen=True):
    """Results of one method on one split or corpus. Lists have one entry per recording.

    Attributes:
        fingers: metrics by sample at the method's own threshold; None for a whole-hand method.
        hand: the same for the hand.
        without_estimate: labelled samples of what the method decides for, and those of them
            that have no estimate; before the samples are restricted to those of all methods.
        hand_without_estimate: the same for the hand.
        readings: alarms of the hand by exact labels, for each of `READINGS` and each threshold.
        glitches: of the hand's controller.
        held: samples while the hand holds the object, and the errors among them.
        calibration: (10, 3) sum of probabilities, stable samples and all samples of each bin.
    """

    fingers: Metrics | None
    hand: Metrics
    without_estimate: list[CountPair]
    hand_without_estimate: list[CountPair]
    readings: dict[str, dict[str, list[AlarmStatistics]]]
    glitches: list[GlitchCount]
    held: list[CountPair]
    calibration: list[list[list[float]]]

    @property
    def metrics(self) -> Metrics:
        """Metrics of what the method decides for: the fingers, or the hand."""
        return self.fingers or self.hand

    @property
    def alarms(self) -> dict[str, list[AlarmStatistics]]:
        """Alarms at each threshold in the paper's reading: a glitch is an event."""
        return self.readings[EVENT]


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
    training = job.training(job.features(job.train))
    everything = frozenset(range(len(training.recordings)))

    for split in job.splits:
        scored: dict[int, ScoredRecording] = {}
        folds = held_out_folds(training.objects, split, job.effort.folds, job.seed)
        for number, left_out in enumerate(folds):
            fitted = _fit_fold(job, training, everything - left_out, number)
            scored |= {index: fitted.scores(training.recordings[index]) for index in left_out}
        yield split, [scored[index] for index in sorted(scored)]
        if job.slips and scored:
            break  # later splits only stand in for one that is not possible
    if job.tests:
        fitted = _fit_fold(job, training, everything)
        for corpus in job.tests:
            yield corpus.name, list(map(fitted.scores, job.features(corpus)))


def held_out_folds(
    objects: Sequence[str | None], split: GroupSplit, n_folds: int, seed: int
) -> Iterator[frozenset[int]]:
    """Yield the numbers of the recordings that each fold leaves out.

    Every recording is in one fold. By recording, each object is spread over all folds. There is
    no fold by object if there are fewer than two objects, or an unknown one.

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
        order = shuffled(len(objects), seed)
        # Stable, so that the recordings of one object keep their shuffled order.
        order = order[np.argsort(np.array([str(objects[k]) for k in order]), kind="stable")]
        folds = deal_folds(len(objects), min(n_folds, len(objects)), order)
    for fold in np.unique(folds):
        yield frozenset(np.flatnonzero(folds == fold).tolist())


def _fit_fold(
    job: EvaluationJob, training: MethodTraining, indices: Collection[int], number: int = 0
) -> FittedMethod:
    """Fit the method to some recordings, and choose its thresholds on them."""
    chosen = sorted(indices)
    n_inner = 0 if job.slips else min(job.effort.inner, len(chosen))
    objects = [training.objects[index] for index in chosen]
    ranges: dict[str, list[FalseAlarmRanges]] = {reading: [] for reading in READINGS}
    for fold in held_out_folds(objects, "recording", n_inner, job.seed + 1) if n_inner > 1 else ():
        fitted = training.fit(set(chosen) - {chosen[k] for k in fold})
        for recording in (training.recordings[chosen[k]] for k in sorted(fold)):
            scores = fitted.scores(recording).hand.hold(HOLD_TIME)
            # A fit without the recording: on its own fit a recording has too few false alarms.
            for reading, labels in recording.alarm_labels.items():
                ranges[reading].append(FalseAlarmRanges.of(scores, labels))
    shifts = {
        reading: {
            name: threshold_shift(of_recordings, rate) if of_recordings else 0.0
            for name, rate in BY_RATE.items()
        }
        for reading, of_recordings in ranges.items()
    }
    return replace(training.fit(chosen), shifts=shifts, fold=number)


def summarise_recordings(scored: Sequence[ScoredRecording]) -> MethodEvaluation:
    """Return the results of a method on scored recordings."""
    truths = [recording.truth for recording, *_ in scored]
    decided = [case.decide(case.recording.scored_labels) for case in scored]
    every = [case.decide(case.recording.labels) for case in scored]
    thresholds = (OWN, LASTING, *BY_RATE)
    alarms: dict[str, dict[str, list[AlarmStatistics]]] = {
        reading: {name: [] for name in thresholds} for reading in READINGS
    }
    for case in scored:
        lasting = case.hand.hold(HOLD_TIME)
        for reading, labels in case.recording.alarm_labels.items():
            alarms[reading][OWN].append(AlarmStatistics.of(case.hand, labels))
            for name, shift in {LASTING: 0.0, **case.shifts[reading]}.items():
                alarms[reading][name].append(AlarmStatistics.of(lasting, labels, shift))
    return MethodEvaluation(
        fingers=None if scored[0].whole_hand else summarise(decided),
        hand=summarise(map(_as_hand, decided)),
        without_estimate=[_n_without_estimate(decisions) for decisions in every],
        hand_without_estimate=[_n_without_estimate(_as_hand(decisions)) for decisions in every],
        readings=alarms,
        glitches=[count_glitches(truth) for truth in truths],
        held=list(map(held_errors, truths, decided)),
        calibration=[calibration_sums(list(d.fingers.values())).tolist() for d in decided],
    )


def _as_hand(decisions: Decisions) -> Decisions:
    """Return the hand as the one finger of its recording."""
    hand = {} if decisions.hand is None else {HAND: decisions.hand}
    return Decisions(decisions.name, hand, decisions.hand)


def _n_without_estimate(decisions: Decisions) -> CountPair:
    """Return the number of labelled samples, and of those of them without an estimate."""
    labelled = [unit.states[unit.labels != UNKNOWN] for unit in decisions.fingers.values()]
    return sum(map(len, labelled)), sum(int((states == UNKNOWN).sum()) for states in labelled)


def evaluate_pooled(job: EvaluationJob) -> list[list[int]]:
    """Return [TN, FP, FN, TP] of each recording by random folds of the pooled samples.

    This is the paper's split: neighbours of a test sample are in the training set. Everything
    else is as in the other splits, so that the difference is due to the split alone.

    Args:
        job: gives a method for fingers, the training corpus, effort and seed.
    """
    recordings = job.features(job.train)
    generator = np.random.default_rng(job.seed)
    folds = [
        {f: random_folds(len(rows), RANDOM_FOLDS, generator) for f, rows in r.features.items()}
        for r in recordings
    ]
    counts = np.zeros((len(recordings), 4), dtype=np.int64)
    for fold in range(RANDOM_FOLDS):
        trained = []
        for recording, fold_of in zip(recordings, folds, strict=True):
            labels = recording.labels.items()
            # UNKNOWN trains nothing, so the features of all folds stay in one array.
            kept = {name: np.where(fold_of[name] == fold, UNKNOWN, codes) for name, codes in labels}
            trained.append(replace(recording, labels=kept))
        fitted = job.training(trained).fit()
        for row, recording, fold_of in zip(counts, recordings, folds, strict=True):
            for name, scores in fitted.scores(recording).fingers.items():
                codes = recording.scored_labels[name]
                finger = scores.decide(np.where(fold_of[name] == fold, codes, UNKNOWN))
                samples = score_samples(finger.labels, finger.states, finger.stable_probability)
                row[:] += samples.confusion.ravel()
    return [[int(n) for n in row] for row in counts]
