"""Evaluation of one method as a decision about the slip of each finger.

A recording that is evaluated has no influence on the fit that scores it, nor on its threshold.
"""

from collections.abc import Iterator, Mapping, Sequence

import msgspec

from holdfast.metrics.slip_thresholds import (
    SlipIntervals,
    SlipSummary,
    ThresholdChoice,
    choose_threshold,
    held_out_places,
    slip_intervals,
    slip_summary,
)
from holdfast.metrics.slips import SlipCurve
from holdfast.sensors.types import Array
from holdfast_lab.study.evaluation.common_samples import longest_warm_up
from holdfast_lab.study.evaluation.evaluate_method import EvaluationEffort, held_out_folds
from holdfast_lab.study.evaluation.fitted_method import (
    FittedMethod,
    TrainingSamples,
    gather_training_samples,
)
from holdfast_lab.study.evaluation.slip_scores import (
    SlipRecording,
    SlipScores,
    gather_sliding_samples,
    score_slips,
    slip_recordings,
    still_ranks,
)
from holdfast_lab.study.methods.slip_methods import SLIP_METHODS, SlipMethod
from holdfast_lab.study.plan import Corpus

SLIP_RATE = 1.0
"""False alarms per minute of a finger for which thresholds are chosen [1/min]."""
CHOICE = ThresholdChoice(SLIP_RATE)
"""Choice by the false alarms of all held time."""
QUIET_CHOICE = ThresholdChoice(SLIP_RATE, "quiet")
"""Choice by the false alarms of quiet hold alone: pushes and glitches may raise a slip."""

Curves = Sequence[Mapping[str, SlipCurve]]
"""Counts of slips of each finger, at each threshold, of each recording."""


class SlipJob(msgspec.Struct, frozen=True):
    """A method for the slip of fingers, and the recordings that it is evaluated on.

    Attributes:
        method: its name, of `SLIP_METHODS`.
        train: corpus that the method is fitted to, evaluated out of fold, by object where there
            are objects.
        tests: other corpora, evaluated with a fit to all of `train`.
        effort: number of folds by recording, and of training samples.
        seed: of all random numbers.
        compared: names of the methods that must have an estimate too where this one is scored.
    """

    method: str
    train: Corpus
    tests: tuple[Corpus, ...] = ()
    effort: EvaluationEffort = EvaluationEffort()
    seed: int = 0
    compared: tuple[str, ...] = ()


class SlipEvaluation(msgspec.Struct, frozen=True):
    """Scores of a method on one split or corpus.

    Attributes:
        split: `object` or `recording`; empty for another corpus.
        n_recordings: in which slips are known.
        summary: of the slips, by fingers and pooled, at the threshold for all held time.
        quiet_budget: the same at the threshold for quiet hold alone; None where only the first
            is chosen.
    """

    split: str
    n_recordings: int
    summary: SlipSummary
    quiet_budget: SlipSummary | None = None


def evaluate_slips(job: SlipJob) -> dict[str, SlipEvaluation]:
    """Return the results of a method out of fold, and on each other corpus.

    The threshold of a recording of `train` is chosen from the recordings of the other folds; that
    of other corpora from all recordings of `train`, each scored out of fold.

    Returns:
        By name of each corpus with slips; empty if `train` trains no classifier.
    """
    chosen = SLIP_METHODS[job.method]
    warm_up = longest_warm_up(_compared(job), job.train.rate)
    recordings = slip_recordings(chosen.method, job.train, warm_up)
    training = _training_samples(chosen, recordings, job)
    split, folds = _folds(training, job)
    scores: dict[int, Mapping[str, SlipScores]] = {}
    for held in folds:
        others = frozenset(range(len(recordings))) - held
        fitted = FittedMethod.fit(chosen.method, training, others, job.seed)
        scores |= {place: score_slips(fitted, recordings[place]) for place in sorted(held)}
    ranks = still_ranks(scores.values())
    if not len(ranks):
        return {}
    curves = [_curves(scores[place], ranks) for place in range(len(recordings))]
    groups = [next(k for k, held in enumerate(folds) if p in held) for p in range(len(recordings))]
    of_budgets = [
        _out_of_fold(curves, groups, split, job.seed, choice) for choice in (CHOICE, QUIET_CHOICE)
    ]
    results = {job.train.name: _of_both_budgets(*of_budgets)}
    fitted = FittedMethod.fit(chosen.method, training, range(len(recordings)), job.seed)
    for corpus in job.tests:
        tested = slip_recordings(chosen.method, corpus, warm_up)
        fresh = [_curves(score_slips(fitted, recording), ranks) for recording in tested]
        if fresh:
            results[corpus.name] = _of_both_budgets(
                summarise_fresh(fresh, curves, job.seed),
                summarise_fresh(fresh, curves, job.seed, QUIET_CHOICE),
            )
    return {name: result for name, result in results.items() if result.summary.pooled.n}


def _compared(job: SlipJob) -> Iterator[str]:
    """Yield the names of the methods whose history has to be complete."""
    for name in (job.method, *job.compared):
        yield SLIP_METHODS[name].history


def _training_samples(
    chosen: SlipMethod, recordings: Sequence[SlipRecording], job: SlipJob
) -> TrainingSamples:
    if chosen.target == "sliding":
        return gather_sliding_samples(recordings, job.effort.max_samples)
    features = [recording.features for recording in recordings]
    return gather_training_samples(features, job.effort.max_samples)


def _folds(training: TrainingSamples, job: SlipJob) -> tuple[str, list[frozenset[int]]]:
    """Return the folds by object, or by recording if there are no objects."""
    objects = training.objects
    if by_object := list(held_out_folds(objects, "object", job.effort.folds, job.seed)):
        return "object", by_object
    return "recording", list(held_out_folds(objects, "recording", job.effort.folds, job.seed))


def _curves(scores: Mapping[str, SlipScores], ranks: Array) -> dict[str, SlipCurve]:
    return {finger: own.curve(ranks) for finger, own in scores.items()}


def _pooled(curves: Curves) -> list[SlipCurve]:
    return [SlipCurve.total(list(fingers.values())) for fingers in curves]


def _of_both_budgets(held: SlipEvaluation, quiet: SlipEvaluation) -> SlipEvaluation:
    """Return one evaluation with the thresholds for all held time and for quiet hold."""
    return msgspec.structs.replace(held, quiet_budget=quiet.summary)


def _out_of_fold(
    curves: Curves, groups: Sequence[int], split: str, seed: int, choice: ThresholdChoice
) -> SlipEvaluation:
    """Return the scores of recordings, each at the threshold of the other folds."""
    pooled = _pooled(curves)
    places = held_out_places(pooled, groups, choice).tolist()
    intervals = slip_intervals(pooled, choice, groups=groups, seed=seed)
    return _evaluation(split, curves, places, intervals)


def summarise_fresh(
    curves: Curves, training: Curves, seed: int, choice: ThresholdChoice = CHOICE
) -> SlipEvaluation:
    """Return the scores of other recordings, at the threshold of the training recordings.

    Args:
        curves: of the tested recordings.
        training: of the recordings from which the threshold is chosen.
        seed: of the bootstrap, which draws from both.
        choice: of the threshold.
    """
    chosen_from = _pooled(training)
    total = SlipCurve.total(chosen_from)
    place = choose_threshold(total, choice.false_alarms, choice.counted_in)
    places = [len(chosen_from[0]) - 1 if place is None else place] * len(curves)
    intervals = slip_intervals(_pooled(curves), choice, training=chosen_from, seed=seed)
    return _evaluation("", curves, places, intervals)


def _evaluation(
    split: str, curves: Curves, places: Sequence[int], intervals: SlipIntervals | None
) -> SlipEvaluation:
    counts = [
        {finger: curve[place] for finger, curve in fingers.items()}
        for fingers, place in zip(curves, places, strict=True)
    ]
    summary = slip_summary(counts, intervals, threshold_chosen=True)
    if summary is None:
        raise ValueError("recordings with known slips expected")
    return SlipEvaluation(split, len(curves), summary)
