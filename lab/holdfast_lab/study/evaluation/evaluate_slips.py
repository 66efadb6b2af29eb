"""Evaluation of one method as a decision about the slip of each finger.

The score of a sample is the log odds of slip, smoothed and started again at each contact as by
the head of a model. Only its order counts: it is turned into its rank among samples that are
known to be still, so that the same thresholds serve every method. A recording that is evaluated
has no influence on the fit that scores it, nor on its threshold.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from scipy.signal import lfilter

from holdfast.metrics.masks import runs
from holdfast.metrics.slip_thresholds import (
    SLIP_THRESHOLD_LOG_ODDS,
    SlipSummary,
    ThresholdChoice,
    choose_threshold,
    held_out_places,
    slip_curve,
    slip_intervals,
    slip_summary,
)
from holdfast.metrics.slip_truth import STILL, SlipDecisions, SlipTruth
from holdfast.metrics.slips import SlipCurve
from holdfast.sensors.types import Array
from holdfast.training.head_fits import SLIP_HOLD_TIME, SLIP_SMOOTHING
from holdfast_lab.study.evaluation.common_samples import longest_warm_up
from holdfast_lab.study.evaluation.evaluate_method import EvaluationEffort, held_out_folds
from holdfast_lab.study.evaluation.fitted_method import FittedMethod, Training
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures, corpus_features
from holdfast_lab.study.evaluation.scores import probability_of
from holdfast_lab.study.methods.slip_methods import SLIP_METHODS
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

    def features(self, corpus: Corpus) -> list[RecordingFeatures]:
        """Return the features of the recordings in which the slips of a finger are known."""
        history = (SLIP_METHODS[name].history for name in (self.method, *self.compared))
        warm_up = longest_warm_up(history, self.train.rate)
        method = SLIP_METHODS[self.method].method
        recordings = corpus_features(method, corpus, warm_up=warm_up)
        return [recording for recording in recordings if recording.slips]


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
    recordings = job.features(job.train)
    training = Training.of(
        chosen.method, recordings, job.effort.max_samples, job.seed,
        sliding=chosen.target == "sliding",
    )  # fmt: skip
    for split in ("object", "recording"):
        folds = list(held_out_folds(training.objects, split, job.effort.folds, job.seed))
        if folds:
            break
    scores: dict[int, Mapping[str, SlipScores]] = {}
    groups: dict[int, int] = {}
    for group, left_out in enumerate(folds):
        fitted = training.fit(set(range(len(recordings))) - left_out)
        scores |= {index: score_slips(fitted, recordings[index]) for index in sorted(left_out)}
        groups |= dict.fromkeys(left_out, group)
    ranks = still_ranks(scores.values())
    if not len(ranks):
        return {}
    curves = [slip_curves(scores[index], ranks) for index in sorted(scores)]
    by_fold = [groups[index] for index in sorted(scores)]
    results = {
        job.train.name: SlipEvaluation(
            split,
            len(curves),
            *(
                summarise_slips(curves, job.seed, choice, groups=by_fold)
                for choice in (CHOICE, QUIET_CHOICE)
            ),
        )
    }
    fitted = training.fit()
    for corpus in job.tests:
        tested = [slip_curves(score_slips(fitted, one), ranks) for one in job.features(corpus)]
        if tested:
            results[corpus.name] = SlipEvaluation(
                "",
                len(tested),
                *(
                    summarise_slips(tested, job.seed, choice, training=curves)
                    for choice in (CHOICE, QUIET_CHOICE)
                ),
            )
    return {name: result for name, result in results.items() if result.summary.pooled.n}


class SlipScores(NamedTuple):
    """Scores of the slip of one finger in one recording.

    Attributes:
        times: (n,) [s].
        score: (n,) smoothed log odds of slip; NaN without an estimate, minus infinity without
            contact.
        truth: of the same samples.
    """

    times: Array
    score: Array
    truth: SlipTruth


def score_slips(fitted: FittedMethod, recording: RecordingFeatures) -> dict[str, SlipScores]:
    """Return the scores of the fingers of a recording; every finger has those of its hand.

    Args:
        fitted: to other recordings.
        recording: to be scored.
    """
    scores = fitted.scores(recording).fingers
    made = {}
    for finger, truth in recording.slips.items():
        own = scores[finger]
        score = smoothed(own.times, np.where(own.known & own.grasped, -own.margin, np.nan))
        made[finger] = SlipScores(
            own.times, np.where(own.known & ~own.grasped, -np.inf, score), truth
        )
    return made


def smoothed(times: Array, log_odds: Array) -> Array:
    """Return the log odds as the slip head of a model smooths them; NaN starts anew.

    Example:
        >>> smoothed(np.arange(3) / 100, np.array([np.nan, 1.0, 1.0])).tolist()
        [nan, 1.0, 1.0]
    """
    out = np.full(len(log_odds), np.nan)
    if len(times) < 2:
        return log_odds
    rate = 1.0 / float(np.median(np.diff(times)))
    gain = float(-np.expm1(-1.0 / (rate * SLIP_SMOOTHING)))
    for start, end in runs(~np.isnan(log_odds)):
        values = log_odds[start:end]
        before = [(1.0 - gain) * values[0]]
        out[start:end], _ = lfilter([gain], [1.0, gain - 1.0], values, zi=before)
    return out


def still_ranks(scores: Iterable[Mapping[str, SlipScores]]) -> Array:
    """Return the sorted scores of all samples of some recordings that are still, in contact."""
    every = [own for fingers in scores for own in fingers.values()]
    still = [s.score[np.isfinite(s.score) & (s.truth.codes == STILL)] for s in every]
    return np.sort(np.concatenate([np.empty(0), *still]))


def log_odds_of(score: Array, ranks: Array) -> Array:
    """Return the log odds by which the thresholds of slip see a score.

    With t the share of the m still samples that have at least this score,

        z = z_0 + (z_1 - z_0) log(1 / t) / log(m + 1)

    where z_0 and z_1 are the log odds of the lowest and the highest threshold: each step of the
    threshold leaves out the same share of the still samples that are left.

    Args:
        score: (n,); NaN stays NaN.
        ranks: (m,) sorted scores of the still samples.
    """
    lowest, highest = SLIP_THRESHOLD_LOG_ODDS[0], SLIP_THRESHOLD_LOG_ODDS[-1]
    m = len(ranks)
    above = m - np.searchsorted(ranks, score, side="left")
    depth = -np.log((above + 0.5) / (m + 1)) / np.log(m + 1)
    return np.asarray(np.where(np.isnan(score), np.nan, lowest + (highest - lowest) * depth))


def slip_curves(scores: Mapping[str, SlipScores], ranks: Array) -> dict[str, SlipCurve]:
    """Return the counts of slips of each finger at each threshold.

    Args:
        scores: of the fingers of a recording.
        ranks: sorted scores of samples that are still, see `log_odds_of`.
    """
    curves = {}
    for finger, (times, score, truth) in scores.items():
        known = probability_of(log_odds_of(score, ranks))
        probability = np.where(score == -np.inf, 0.0, known)
        never = np.zeros(len(times), dtype=np.bool_)
        decisions = SlipDecisions(times, probability, never, SLIP_HOLD_TIME, truth)
        curves[finger] = slip_curve(decisions)
    return curves


def summarise_slips(
    curves: Curves,
    seed: int,
    choice: ThresholdChoice = CHOICE,
    *,
    groups: Sequence[int] = (),
    training: Curves = (),
) -> SlipSummary:
    """Return the metrics of recordings, each at a threshold that is chosen without it.

    Args:
        curves: of the recordings.
        seed: of the bootstrap, which draws from `training` too.
        choice: of the threshold.
        groups: of each recording; the threshold is that of the other groups.
        training: of other recordings, from which the threshold is chosen instead.
    """
    pooled, others = (
        [SlipCurve.total(list(fingers.values())) for fingers in recordings]
        for recordings in (curves, training)
    )
    if others:
        index = choose_threshold(SlipCurve.total(others), choice.false_alarms, choice.counted_in)
        indices = [len(others[0]) - 1 if index is None else index] * len(curves)
    else:
        indices = held_out_places(pooled, groups, choice).tolist()
    counts = [
        {finger: curve[index] for finger, curve in fingers.items()}
        for fingers, index in zip(curves, indices, strict=True)
    ]
    intervals = slip_intervals(pooled, choice, groups=groups, training=others, seed=seed)
    summary = slip_summary(counts, intervals, threshold_chosen=True)
    if summary is None:
        raise ValueError("recordings with known slips expected")
    return summary
