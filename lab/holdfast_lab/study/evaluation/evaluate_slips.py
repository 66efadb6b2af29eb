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
from holdfast.metrics.slip_curves import (
    SLIP_THRESHOLD_LOG_ODDS,
    CountedIn,
    SlipSummary,
    slip_curve,
    summarise_choice,
)
from holdfast.metrics.slip_truth import STILL, SlipDecisions, SlipTruth
from holdfast.metrics.slips import SlipCounts
from holdfast.sensors.types import Array
from holdfast.training.head_fits import SLIP_HOLD_TIME, SLIP_SMOOTHING
from holdfast_lab.study.evaluation.evaluate_method import EvaluationJob, score_splits
from holdfast_lab.study.evaluation.fitted_method import ScoredRecording, probability_of

SLIP_RATE = 1.0
"""False alarms per minute of a finger for which thresholds are chosen [1/min]."""
BUDGETS: list[tuple[float, CountedIn]] = [(SLIP_RATE, "held"), (SLIP_RATE, "quiet")]
"""Budgets of false alarms: of all held time; of quiet hold alone, as pushes may raise a slip."""

Curves = Sequence[Mapping[str, SlipCounts]]
"""Counts of slips of each finger, at each threshold, of each recording."""


class SlipEvaluation(msgspec.Struct, frozen=True):
    """Scores of a method on one split or corpus.

    Attributes:
        split: `object` or `recording`; empty for another corpus.
        n_recordings: in which slips are known.
        summary: of the slips, by fingers and pooled, at the threshold for all held time.
        quiet_budget: the same at the threshold for quiet hold alone.
    """

    split: str
    n_recordings: int
    summary: SlipSummary
    quiet_budget: SlipSummary


def evaluate_slips(job: EvaluationJob) -> dict[str, SlipEvaluation]:
    """Return the results of a method out of fold, and on each other corpus.

    The threshold of a recording of `train` is chosen from the recordings of the other folds; that
    of other corpora from all recordings of `train`, each scored out of fold.

    Args:
        job: about slips.

    Returns:
        By name of each corpus with slips; empty if `train` trains no classifier.
    """
    scored = {name: recordings for name, recordings in score_splits(job) if recordings}
    scores = {name: list(map(score_slips, recordings)) for name, recordings in scored.items()}
    split = next((name for name in job.splits if name in scored), "")
    ranks = still_ranks(scores.get(split, []))
    results: dict[str, SlipEvaluation] = {}
    training: Curves = []
    for name, fingers in scores.items() if len(ranks) else ():
        curves = [slip_curves(of_recording, ranks) for of_recording in fingers]
        if name == split:
            training, folds = curves, [case.fold for case in scored[split]]
            results[job.train.name] = summarise_slips(curves, job.seed, groups=folds, split=split)
        else:
            results[name] = summarise_slips(curves, job.seed, training=training)
    # A corpus without a slip has no shares to report.
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


def score_slips(scored: ScoredRecording) -> dict[str, SlipScores]:
    """Return the scores of slip of the fingers of a recording whose slips are known."""
    made = {}
    for finger, truth in scored.recording.slips.items():
        finger_scores = scored.fingers[finger]
        times, decided, touches = finger_scores.times, finger_scores.known, finger_scores.grasped
        score = smoothed(times, np.where(decided & touches, -finger_scores.margin, np.nan))
        made[finger] = SlipScores(times, np.where(decided & ~touches, -np.inf, score), truth)
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
    # The median, which gaps and lost samples do not move.
    rate = 1.0 / float(np.median(np.diff(times)))
    gain = float(-np.expm1(-1.0 / (rate * SLIP_SMOOTHING)))
    for start, end in runs(~np.isnan(log_odds)):
        values = log_odds[start:end]
        # The filter starts as if the first value had lasted for ever, so a contact has no ramp.
        before = [(1.0 - gain) * values[0]]
        out[start:end], _ = lfilter([gain], [1.0, gain - 1.0], values, zi=before)
    return out


def still_ranks(scores: Iterable[Mapping[str, SlipScores]]) -> Array:
    """Return the sorted scores of all samples of some recordings that are still, in contact."""
    every = [finger for fingers in scores for finger in fingers.values()]
    still = [s.score[np.isfinite(s.score) & (s.truth.codes == STILL)] for s in every]
    # The empty array stands for no recordings at all, which NumPy cannot concatenate.
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
    # Half a sample is added, since a score above all still samples has no finite depth.
    above = m - np.searchsorted(ranks, score, side="left")
    depth = -np.log((above + 0.5) / (m + 1)) / np.log(m + 1)
    return np.asarray(np.where(np.isnan(score), np.nan, lowest + (highest - lowest) * depth))


def slip_curves(scores: Mapping[str, SlipScores], ranks: Array) -> dict[str, SlipCounts]:
    """Return the counts of slips of each finger at each threshold.

    Args:
        scores: of the fingers of a recording.
        ranks: sorted scores of samples that are still, see `log_odds_of`.
    """
    curves = {}
    for finger, (times, score, truth) in scores.items():
        ranked = probability_of(log_odds_of(score, ranks))
        # Without contact nothing slides: no threshold may raise a slip there.
        probability = np.where(score == -np.inf, 0.0, ranked)
        never = np.zeros(len(times), dtype=np.bool_)
        decisions = SlipDecisions(times, probability, never, SLIP_HOLD_TIME, truth)
        curves[finger] = slip_curve(decisions)
    return curves


def summarise_slips(
    curves: Curves,
    seed: int,
    *,
    groups: Sequence[int] = (),
    training: Curves = (),
    split: str = "",
) -> SlipEvaluation:
    """Return the metrics of recordings at the thresholds of both budgets.

    The arguments are those of `summarise_choice`.
    """
    summary, quiet_budget = (
        summarise_choice(curves, *budget, groups=groups, training=training, seed=seed)
        for budget in BUDGETS
    )
    return SlipEvaluation(split, len(curves), summary, quiet_budget)
