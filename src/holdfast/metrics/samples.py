"""Metrics by sample, of scores or of histograms: class 1 is a stable label, class 0 any other."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics.decisions import FingerDecisions, check_lengths
from holdfast.metrics.statistics import finite_or_none, mann_whitney_u, percent
from holdfast.sensors.types import Array, Integers

N_CALIBRATION_BINS = 10
"""Number of bins of probabilities from 0 to 1."""
MAX_LOG_ODDS = 40.0
"""Log odds at the first and the last bin; log odds of float64 end at 37."""
BINS_PER_UNIT = 50
"""Number of bins for each unit of the log odds."""
N_BINS = int(2 * MAX_LOG_ODDS * BINS_PER_UNIT) + 1


class SampleMetrics(msgspec.Struct, frozen=True):
    """Metrics of a binary classification, of the samples of one or more fingers.

    Attributes:
        n: number of samples with a label and a decision; only they count below.
        accuracy: (TP + TN) / n [%].
        fdr: FP / (TP + FP), false discovery rate: not stable, of the samples decided stable [%].
        fpr: FP / (FP + TN), false positive rate: decided stable, of those not stable [%].
        fnr: FN / (FN + TP), false negative rate: decided not stable, of those stable [%].
        auc: probability that a stable sample has a higher score than one that is not stable;
            ties count half.
        auc_contact: the same without the samples labelled NO_CONTACT.
        confusion: [[TN, FP], [FN, TP]].
        brier: mean of (stable_probability - class)^2; None if a score is no probability.
        n_undecided: number of samples with a label whose decided state is UNKNOWN.
        without_estimate: the same as a share of all samples with a label [%].
    """

    n: int
    accuracy: float | None
    fdr: float | None
    fpr: float | None
    fnr: float | None
    auc: float | None
    auc_contact: float | None
    confusion: list[list[int]]
    brier: float | None
    n_undecided: int
    without_estimate: float | None = None


@dataclass(frozen=True, eq=False)
class ScoredSamples:
    """Scores and counts of labelled samples, from which the metrics are computed.

    Attributes:
        stable: scores of the samples labelled STABLE.
        unstable: scores of those labelled UNSTABLE.
        no_contact: scores of those labelled NO_CONTACT.
        confusion: (2, 2) counts [[TN, FP], [FN, TP]].
        squared_error: sum of (score - class)^2; NaN where a score lies outside [0, 1].
        n_undecided: number of samples with a label whose decided state is UNKNOWN.
    """

    stable: Array
    unstable: Array
    no_contact: Array
    confusion: npt.NDArray[np.int64]
    squared_error: float
    n_undecided: int

    @property
    def not_stable(self) -> Array:
        """Scores of the samples of class 0 (not stable)."""
        return np.concatenate([self.unstable, self.no_contact])

    @property
    def n_scores(self) -> tuple[int, int, int]:
        """Number of samples labelled STABLE, UNSTABLE and NO_CONTACT."""
        return len(self.stable), len(self.unstable), len(self.no_contact)

    def ordered_pairs(self) -> tuple[float, float]:
        """Return the Mann-Whitney statistics of STABLE against UNSTABLE and NO_CONTACT."""
        u_unstable = mann_whitney_u(self.stable, self.unstable)
        return u_unstable, mann_whitney_u(self.stable, self.no_contact)


@dataclass(frozen=True, eq=False)
class BinnedSamples:
    """Number of samples by label and score: of more samples than memory holds.

    A bin is 0.02 wide in log odds, so bins are narrow where probabilities are near 0 or 1. Two
    scores in the same bin count as a tie. The area under the ROC curve then changes by less than
    half of the share of pairs that have the same bin.

    Attributes:
        counts: (3, N_BINS) samples labelled STABLE, UNSTABLE and NO_CONTACT in each bin.
        confusion: as in `ScoredSamples`.
        squared_error: as in `ScoredSamples`.
        n_undecided: as in `ScoredSamples`.
    """

    counts: Integers
    confusion: Integers
    squared_error: float
    n_undecided: int

    @classmethod
    def of(cls, samples: ScoredSamples) -> Self:
        """Return the histogram of samples; scores outside [0, 1] count as 0 and 1."""
        kinds = (samples.stable, samples.unstable, samples.no_contact)
        counts = np.array([np.bincount(bins_of(kind), minlength=N_BINS) for kind in kinds])
        return cls(counts, samples.confusion, samples.squared_error, samples.n_undecided)

    def __add__(self, other: Self) -> "BinnedSamples":
        return BinnedSamples(
            self.counts + other.counts,
            self.confusion + other.confusion,
            self.squared_error + other.squared_error,
            self.n_undecided + other.n_undecided,
        )

    @property
    def n_scores(self) -> tuple[int, int, int]:
        """Number of samples labelled STABLE, UNSTABLE and NO_CONTACT."""
        stable, unstable, no_contact = self.counts.sum(axis=1).tolist()
        return stable, unstable, no_contact

    def ordered_pairs(self) -> tuple[float, float]:
        """Return the Mann-Whitney statistics of STABLE against UNSTABLE and NO_CONTACT."""
        stable, unstable, no_contact = self.counts

        def pairs(lower: Integers) -> float:
            # Pairs in which the stable sample has the higher bin; the same bin counts half.
            below = np.cumsum(lower) - lower
            return float((stable.astype(np.float64) * (below + 0.5 * lower)).sum())

        return pairs(unstable), pairs(no_contact)


class SampleTotal:
    """Sum of scored samples: exact as long as the scores are few, then a histogram.

    Example:
        >>> total = SampleTotal()
        >>> total.add(score_samples([3, 2], [3, 2], [0.9, 0.2]))
        >>> total.bin().n_scores, total.samples.ordered_pairs()
        ((1, 1, 0), (1.0, 0.0))
    """

    def __init__(self) -> None:
        self._parts: list[ScoredSamples] = []
        self._binned: BinnedSamples | None = None

    def add(self, samples: ScoredSamples | BinnedSamples) -> None:
        """Add the samples of a finger of a recording; a histogram turns all into histograms."""
        if isinstance(samples, BinnedSamples):
            self._binned = self.bin() + samples
        elif self._binned is not None:
            self._binned += BinnedSamples.of(samples)
        else:
            self._parts.append(samples)

    def bin(self) -> BinnedSamples:
        """Replace all scores by their histogram, now and for samples that are added later."""
        if self._binned is None:
            self._binned = BinnedSamples.of(pool_samples(self._parts))
            self._parts = []
        return self._binned

    @property
    def samples(self) -> ScoredSamples | BinnedSamples:
        """All samples together."""
        return pool_samples(self._parts) if self._binned is None else self._binned


def sample_metrics(
    labels: npt.ArrayLike, states: npt.ArrayLike, stable_probability: npt.ArrayLike
) -> SampleMetrics:
    """Compute the metrics of the classification stable (positive) against all other states.

    Samples without a label, or whose decided state is UNKNOWN, are left out. The decision is
    class 1 if the state is STABLE. A metric whose denominator is 0 is None.

    Args:
        labels: (n,) codes of the labelled states.
        states: (n,) codes of the decided states.
        stable_probability: (n,) probability that the contact is stable; ignored for samples that
            are left out.

    Raises:
        ValueError: the shapes differ, or the probability of a decided sample is NaN.

    Example:
        >>> labels = [STABLE, STABLE, UNSTABLE, NO_CONTACT, UNKNOWN]
        >>> states = [STABLE, UNSTABLE, STABLE, NO_CONTACT, STABLE]
        >>> metrics = sample_metrics(labels, states, [0.9, 0.4, 0.6, 0.1, 0.8])
        >>> metrics.n, metrics.confusion, metrics.fdr
        (4, [[1, 1], [1, 1]], 50.0)
        >>> metrics.auc, metrics.auc_contact
        (0.75, 0.5)
    """
    return metrics_of_samples(score_samples(labels, states, stable_probability))


def score_samples(
    labels: npt.ArrayLike, states: npt.ArrayLike, stable_probability: npt.ArrayLike
) -> ScoredSamples:
    """Return the scores and counts of the samples of one finger; see `sample_metrics`."""
    label, state = np.asarray(labels, dtype=np.int8), np.asarray(states, dtype=np.int8)
    score = np.asarray(stable_probability, dtype=np.float64)
    check_lengths(labels=label, states=state, stable_probability=score)
    # What is left out of a numerator is left out of the denominator: undecided samples are counted
    # beside all ratios, never as wrong or right.
    is_decided = (label != UNKNOWN) & (state != UNKNOWN)
    n_undecided = int(((label != UNKNOWN) & (state == UNKNOWN)).sum())
    label, state, score = label[is_decided], state[is_decided], score[is_decided]
    if n_missing := int(np.isnan(score).sum()):
        raise ValueError(f"{n_missing} decided samples have NaN for stable_probability")
    truth, decision = label == STABLE, state == STABLE
    confusion = np.bincount(2 * truth + decision, minlength=4).reshape(2, 2)
    return ScoredSamples(
        stable=score[truth],
        unstable=score[label == UNSTABLE],
        no_contact=score[label == NO_CONTACT],
        confusion=confusion,
        # The score of a method that is no probability has no Brier score.
        squared_error=(
            math.nan if ((score < 0) | (score > 1)).any() else float(np.square(score - truth).sum())
        ),
        n_undecided=n_undecided,
    )


def pool_samples(parts: Sequence[ScoredSamples]) -> ScoredSamples:
    """Return the scores and counts of all samples together."""
    return ScoredSamples(
        stable=np.concatenate([np.empty(0), *(part.stable for part in parts)]),
        unstable=np.concatenate([np.empty(0), *(part.unstable for part in parts)]),
        no_contact=np.concatenate([np.empty(0), *(part.no_contact for part in parts)]),
        confusion=sum((part.confusion for part in parts), np.zeros((2, 2), dtype=np.int64)),
        squared_error=float(sum(part.squared_error for part in parts)),
        n_undecided=sum(part.n_undecided for part in parts),
    )


def metrics_of_samples(samples: ScoredSamples | BinnedSamples) -> SampleMetrics:
    """Compute the metrics of scored samples."""
    ratios = confusion_ratios(samples.confusion.tolist())
    n = ratios["accuracy"][1]
    u_unstable, u_no_contact = samples.ordered_pairs()
    u = u_unstable + u_no_contact
    n_stable, n_unstable, n_no_contact = samples.n_scores
    contact_pairs = n_stable * n_unstable
    pairs = contact_pairs + n_stable * n_no_contact
    return SampleMetrics(
        n=n,
        **{name: percent(part, whole) for name, (part, whole) in ratios.items()},
        auc=u / pairs if pairs else None,
        auc_contact=u_unstable / contact_pairs if contact_pairs else None,
        confusion=samples.confusion.tolist(),
        brier=finite_or_none(samples.squared_error / n) if n else None,
        n_undecided=samples.n_undecided,
        without_estimate=percent(samples.n_undecided, n + samples.n_undecided),
    )


def confusion_ratios(confusion: Any) -> dict[str, tuple[Any, Any]]:  # noqa: ANN401 (numbers, or arrays)
    """Return numerator and denominator of the ratios of `SampleMetrics` that count samples.

    Args:
        confusion: [[TN, FP], [FN, TP]]; each is a number, or an array of numbers.
    """
    (tn, fp), (fn, tp) = confusion
    return {
        "accuracy": (tp + tn, tn + fp + fn + tp),
        "fdr": (fp, tp + fp),
        "fpr": (fp, fp + tn),
        "fnr": (fn, fn + tp),
    }


def calibration_sums(decisions: Sequence[FingerDecisions]) -> Array:
    """Return sums for the calibration of probabilities.

    Args:
        decisions: of any fingers; samples without a label or a decision are left out.

    Returns:
        (10, 3) for each bin of probabilities: their sum, the number of samples labelled stable, and
        the number of all samples. The sums of several recordings can be added.
    """
    is_decided = [(finger.labels != UNKNOWN) & (finger.states != UNKNOWN) for finger in decisions]
    pairs = list(zip(decisions, is_decided, strict=True))
    score = np.concatenate([np.empty(0), *(f.stable_probability[rows] for f, rows in pairs)])
    stable = np.concatenate([np.empty(0), *(f.labels[rows] == STABLE for f, rows in pairs)])
    bins = np.clip((score * N_CALIBRATION_BINS).astype(int), 0, N_CALIBRATION_BINS - 1)
    columns = (score, stable, np.ones(len(bins)))
    sums = [np.bincount(bins, weights=column, minlength=N_CALIBRATION_BINS) for column in columns]
    return np.column_stack(sums).astype(np.float64)  # without samples, bincount returns integers


def bins_of(scores: Array) -> npt.NDArray[np.intp]:
    """Return (n,) the bin of each score.

    Example:
        >>> bins_of(np.array([0.0, 0.5, 1.0])).tolist()
        [0, 2000, 4000]
    """
    # 0 and 1 have infinite log odds, and go into the first and the last bin.
    inside = np.clip(scores, 0.0, 1.0)
    with np.errstate(divide="ignore"):
        log_odds = np.log(inside) - np.log1p(-inside)
    bounded = np.clip(log_odds, -MAX_LOG_ODDS, MAX_LOG_ODDS)
    bins: npt.NDArray[np.intp] = np.rint((bounded + MAX_LOG_ODDS) * BINS_PER_UNIT).astype(np.intp)
    return bins
