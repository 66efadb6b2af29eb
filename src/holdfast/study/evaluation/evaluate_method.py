"""One method: fitted on some recordings, judged on others, and counted.

No recording that is judged has a say in what judges it: not in its classifiers, not in its
contact thresholds, not in the threshold for a rate of false alarms, which is chosen on the
training recordings, each judged by a fit without it.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.metrics import Decisions, Metrics, summarise
from holdfast.study.evaluation.alarm_statistics import (
    AlarmStatistics,
    alarm_statistics,
    find_slips,
    follows_jump,
)
from holdfast.study.evaluation.error_breakdown import (
    ErrorBreakdown,
    break_down_errors,
    calibration_counts,
)
from holdfast.study.evaluation.fitted_method import (
    FittedMethod,
    TrainingSamples,
    gather_training_samples,
)
from holdfast.study.evaluation.recording_features import RecordingFeatures, corpus_features
from holdfast.study.evaluation.scores import RecordingScores
from holdfast.study.evaluation.thresholds import FalseAlarmRanges, threshold_shift
from holdfast.study.evaluation.variation import Variation
from holdfast.study.methods import HAND, METHODS, Method
from holdfast.study.methods.cuts import CUTS
from holdfast.study.plan import Corpus

FALSE_ALARM_RATES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""False alarms per minute of stable label that thresholds are chosen for, in training."""
COMPARED_RATE = 1.0
"""The rate that methods are compared at."""
HOLD_TIME = 0.1
"""For how long a hand goes on not to be stable at those thresholds, so that one disturbance is
one alarm, whatever the method [s]."""

Split = Literal["recording", "object"]


class EvaluationEffort(msgspec.Struct, frozen=True):
    """How thoroughly a method is judged.

    Attributes:
        folds: of whole recordings, each object spread over all of them.
        inner: folds of the training recordings of each, on which thresholds are chosen.
        stride: only every so many-th decision is looked at.
        max_rows: samples of a finger that a classifier is fitted to, evenly spread.
    """

    folds: int = 5
    inner: int = 3
    stride: int = 1
    max_rows: int = 20_000


class EvaluationJob(msgspec.Struct, frozen=True):
    """What is judged.

    Attributes:
        method: name of it.
        train: corpus that it is fitted to.
        splits: of that corpus: a fold holds out recordings, or one object.
        tests: other corpora that it is judged on, after a fit to all of `train`.
        change: of the recordings of all corpora.
        effort: how thoroughly.
        seed: of everything random.
    """

    method: str
    train: Corpus
    splits: tuple[Split, ...] = ("recording",)
    tests: tuple[Corpus, ...] = ()
    change: Variation = Variation()
    effort: EvaluationEffort = EvaluationEffort()
    seed: int = 0


class MethodEvaluation(msgspec.Struct, frozen=True):
    """What was counted.

    Attributes:
        names: of the recordings judged, in order.
        fingers: by sample, at the method's own threshold; None of a method for whole hands.
        hand: the same of the hand.
        own: its alarms, by exact labels, at the same threshold, of each recording.
        held: the same, held for `HOLD_TIME`.
        curve: the same, held, at thresholds for each of `FALSE_ALARM_RATES`.
        spared: the same, held, at thresholds for one false alarm per minute, where those right
            after a jump of the controller's set point are not counted.
        breakdown: of errors at the method's own threshold, of each recording.
        calibration: of each recording, (10, 3) sum of probabilities, stable samples and samples
            of each bin.
    """

    names: list[str]
    fingers: Metrics | None
    hand: Metrics
    own: list[AlarmStatistics]
    held: list[AlarmStatistics]
    curve: list[list[AlarmStatistics]]
    spared: list[AlarmStatistics]
    breakdown: list[ErrorBreakdown]
    calibration: list[list[list[float]]]

    @property
    def metrics(self) -> Metrics:
        """Of what the method judges: the fingers, or the hand."""
        return self.fingers or self.hand

    @property
    def calm(self) -> list[AlarmStatistics]:
        """At the threshold that methods are compared at."""
        return self.curve[FALSE_ALARM_RATES.index(COMPARED_RATE)]


class FittedFold(NamedTuple):
    """A fit and its thresholds.

    Attributes:
        fitted: fitted to all training recordings.
        shifts: of its threshold, for each of `FALSE_ALARM_RATES`, and for the one that is compared
            with alarms spared.
    """

    fitted: FittedMethod
    shifts: Sequence[float]


class ScoredRecording(NamedTuple):
    """A recording that was judged: what was seen, what was thought of it, and the thresholds."""

    seen: RecordingFeatures
    scores: RecordingScores
    shifts: Sequence[float]


def evaluate_method(job: EvaluationJob) -> dict[str, MethodEvaluation]:
    """What the method is worth by each split, and on each other corpus.

    A split by object is left out where there are fewer than two, or not all are known.

    Returns:
        By the split, or the name of the corpus.

    Raises:
        TrainingError: a whole-hand method gets too few fingers.
    """
    return {key: summarise_recordings(cases) for key, cases in scored_recordings(job) if cases}


def scored_recordings(job: EvaluationJob) -> Iterator[tuple[str, list[ScoredRecording]]]:
    """By split, or corpus, the recordings and what was thought of them, in order."""
    method = find_method(job.method)
    recordings = corpus_features(method, job.train, job.change, job.effort.stride)
    material = gather_training_samples(recordings, job.effort.max_rows)
    everyone = frozenset(range(len(recordings)))
    for split in job.splits:
        cases: dict[int, ScoredRecording] = {}
        for held in held_out(material.objects, split, job.effort.folds, job.seed):
            fold = _fold(job, method, material, recordings, everyone - held)
            cases |= {place: _case(fold, recordings[place]) for place in held}
        yield split, [cases[place] for place in sorted(cases)]
    if job.tests:
        fold = _fold(job, method, material, recordings, everyone)
        for corpus in job.tests:
            tested = corpus_features(method, corpus, job.change, job.effort.stride)
            yield corpus.name, [_case(fold, seen) for seen in tested]


def find_method(name: str) -> Method:
    """The method of that name, also of those that the study has for one question alone."""
    return METHODS[name] if name in METHODS else CUTS[name]


def held_out(
    objects: Sequence[str | None], split: Split, n_folds: int, seed: int
) -> Iterator[frozenset[int]]:
    """Places of the recordings that each fold holds out; every recording is in one fold.

    Args:
        objects: of the recordings; None where it is not known.
        split: `recording` or `object`.
        n_folds: by recording, at most.
        seed: of the same.
    """
    if split == "object":
        names = list(dict.fromkeys(objects))
        if len(names) < 2 or None in names:
            return
        units = np.array([names.index(name) for name in objects])
    else:
        units = groups_of(objects, min(n_folds, len(objects)), seed)
    for unit in np.unique(units):
        yield frozenset(np.flatnonzero(units == unit).tolist())


def groups_of(objects: Sequence[str | None], n_groups: int, seed: int) -> npt.NDArray[np.int64]:
    """(n_recordings,) groups of about equal size, the recordings of each object spread evenly."""
    order = np.random.default_rng(seed).permutation(len(objects))
    order = order[np.argsort(np.array([str(objects[k]) for k in order]), kind="stable")]
    groups = np.empty(len(objects), dtype=np.int64)
    groups[order] = np.arange(len(objects)) % n_groups
    return groups


def _fold(
    job: EvaluationJob,
    method: Method,
    material: TrainingSamples,
    recordings: Sequence[RecordingFeatures],
    training: frozenset[int],
) -> FittedFold:
    """The fit to the training recordings; nothing else is looked at."""
    places = sorted(training)
    objects = [material.objects[place] for place in places]
    n_inner = min(job.effort.inner, len(places))
    calms: list[tuple[FalseAlarmRanges, FalseAlarmRanges]] = []
    for held in held_out(objects, "recording", n_inner, job.seed + 1) if n_inner > 1 else ():
        left_out = {places[k] for k in held}
        inner = FittedMethod.fit(method, material, training - left_out, job.seed)
        calms += [_calm(inner, recordings[place]) for place in sorted(left_out)]
    return FittedFold(FittedMethod.fit(method, material, training, job.seed), _shifts(calms))


def _calm(
    fitted: FittedMethod, seen: RecordingFeatures
) -> tuple[FalseAlarmRanges, FalseAlarmRanges]:
    """What tells its false alarms: of all, and of those that no jump of the set point caused."""
    score, labels = fitted.scores(seen).hand(seen).held(HOLD_TIME), seen.hand(seen.exact).labels
    spared = follows_jump(score.times, seen.truth)
    return FalseAlarmRanges.of(score, labels), FalseAlarmRanges.of(score, labels, spared)


def _shifts(calms: Sequence[tuple[FalseAlarmRanges, FalseAlarmRanges]]) -> list[float]:
    if not calms:
        return [0.0] * (1 + len(FALSE_ALARM_RATES))
    every, spared = zip(*calms, strict=True)
    return [
        *(threshold_shift(every, rate) for rate in FALSE_ALARM_RATES),
        threshold_shift(spared, COMPARED_RATE),
    ]


def _case(fold: FittedFold, seen: RecordingFeatures) -> ScoredRecording:
    return ScoredRecording(replace(seen, features={}), fold.fitted.scores(seen), fold.shifts)


def summarise_recordings(cases: Sequence[ScoredRecording]) -> MethodEvaluation:
    """What is counted of the recordings that were judged."""
    own = [case.scores.decide(case.seen, case.seen.labels) for case in cases]
    heard = [list(_heard(case)) for case in cases]
    return MethodEvaluation(
        names=[case.seen.name for case in cases],
        fingers=summarise(own) if any(each.fingers for each in own) else None,
        hand=summarise(_hands(own)),
        own=[each[0] for each in heard],
        held=[each[1] for each in heard],
        curve=[[each[2 + k] for each in heard] for k in range(len(FALSE_ALARM_RATES))],
        spared=[each[-1] for each in heard],
        breakdown=[
            break_down_errors(case.seen, each) for case, each in zip(cases, own, strict=True)
        ],
        calibration=[calibration_counts(each) for each in own],
    )


def _heard(case: ScoredRecording) -> Iterator[AlarmStatistics]:
    """Its alarms at its own threshold, then held: at its own, and at each that was chosen."""
    seen, scores, shifts = case
    score, labels = scores.hand(seen), seen.hand(seen.exact).labels
    slips = find_slips(seen.truth)
    yield alarm_statistics(score.decide(labels), seen.truth, slips)
    held = score.held(HOLD_TIME)
    for shift in (0.0, *shifts):
        yield alarm_statistics(held.decide(labels, shift), seen.truth, slips)


def _hands(decided: Iterable[Decisions]) -> Iterator[Decisions]:
    """The hands alone, each as the one finger of its recording."""
    for each in decided:
        if each.hand is not None:
            yield Decisions(each.name, {HAND: each.hand}, each.hand)
