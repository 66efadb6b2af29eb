"""Metrics by sample: class 1 is a stable label, class 0 any other."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics.decisions import check_lengths
from holdfast.metrics.statistics import finite_or_none, pairs_won, percent
from holdfast.sensors.types import Array


class SampleMetrics(msgspec.Struct, frozen=True):
    """How well the samples of a finger, or of many, were told apart.

    Attributes:
        n: samples with a label and a decision; only they count below.
        accuracy: (TP + TN) / n [%].
        fdr: FP / (TP + FP), of what was called stable the share that was not [%].
        fpr: FP / (FP + TN), of what was not stable the share called stable [%].
        fnr: FN / (FN + TP), of what was stable the share not called so [%].
        auc: probability that a stable sample scores above one that is not; ties count half.
        auc_contact: the same, with the samples labelled NO_CONTACT left out.
        confusion: [[TN, FP], [FN, TP]].
        brier: mean of (stable_probability - class)^2; None where a score is no probability.
        n_undecided: samples with a label whose decided state is UNKNOWN.
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


@dataclass(frozen=True, eq=False)
class Tally:
    """What the metrics need of some samples; tallies pool without the samples.

    Attributes:
        stable: scores of the samples labelled STABLE.
        unstable: scores of those labelled UNSTABLE.
        no_contact: scores of those labelled NO_CONTACT.
        confusion: (2, 2) counts [[TN, FP], [FN, TP]].
        squared_error: sum of (score - class)^2; NaN where a score lies outside [0, 1].
        n_undecided: samples with a label whose decided state is UNKNOWN.
    """

    stable: Array
    unstable: Array
    no_contact: Array
    confusion: npt.NDArray[np.int64]
    squared_error: float
    n_undecided: int

    @property
    def not_stable(self) -> Array:
        """Scores of the samples of class 0."""
        return np.concatenate([self.unstable, self.no_contact])


def sample_metrics(
    labels: npt.ArrayLike, states: npt.ArrayLike, stable_probability: npt.ArrayLike
) -> SampleMetrics:
    """How well the samples were told apart, stable (positive) from everything else.

    Samples without a label, or whose decided state is UNKNOWN, are left out. The decision is
    class 1 where the state is STABLE. A figure whose denominator is 0 is None.

    Args:
        labels: (n,) codes of the labels' states.
        states: (n,) codes of the decided states.
        stable_probability: (n,) that the contact is stable; ignored where left out.

    Raises:
        ValueError: the shapes differ, or a decided sample's probability is NaN.

    Example:
        >>> labels = [STABLE, STABLE, UNSTABLE, NO_CONTACT, UNKNOWN]
        >>> states = [STABLE, UNSTABLE, STABLE, NO_CONTACT, STABLE]
        >>> metrics = sample_metrics(labels, states, [0.9, 0.4, 0.6, 0.1, 0.8])
        >>> metrics.n, metrics.confusion, metrics.fdr
        (4, [[1, 1], [1, 1]], 50.0)
        >>> metrics.auc, metrics.auc_contact
        (0.75, 0.5)
    """
    return measure(tally_samples(labels, states, stable_probability))


def tally_samples(
    labels: npt.ArrayLike, states: npt.ArrayLike, stable_probability: npt.ArrayLike
) -> Tally:
    """Counts the samples of one finger; see `sample_metrics`."""
    label, state = np.asarray(labels, dtype=np.int8), np.asarray(states, dtype=np.int8)
    score = np.asarray(stable_probability, dtype=np.float64)
    check_lengths(labels=label, states=state, stable_probability=score)
    known = (label != UNKNOWN) & (state != UNKNOWN)
    n_undecided = int(((label != UNKNOWN) & (state == UNKNOWN)).sum())
    label, state, score = label[known], state[known], score[known]
    if n_missing := int(np.isnan(score).sum()):
        raise ValueError(f"{n_missing} decided samples have NaN for stable_probability")
    truth, decision = label == STABLE, state == STABLE
    confusion = np.bincount(2 * truth + decision, minlength=4).reshape(2, 2)
    return Tally(
        stable=score[truth],
        unstable=score[label == UNSTABLE],
        no_contact=score[label == NO_CONTACT],
        confusion=confusion,
        squared_error=_squared_error(score, truth),
        n_undecided=n_undecided,
    )


def pool_tallies(tallies: Sequence[Tally]) -> Tally:
    """One tally of all samples, as if they had been one finger's."""
    return Tally(
        stable=np.concatenate([np.empty(0), *(each.stable for each in tallies)]),
        unstable=np.concatenate([np.empty(0), *(each.unstable for each in tallies)]),
        no_contact=np.concatenate([np.empty(0), *(each.no_contact for each in tallies)]),
        confusion=sum((each.confusion for each in tallies), np.zeros((2, 2), dtype=np.int64)),
        squared_error=float(sum(each.squared_error for each in tallies)),
        n_undecided=sum(each.n_undecided for each in tallies),
    )


def measure(tally: Tally) -> SampleMetrics:
    """The metrics of a tally."""
    (tn, fp), (fn, tp) = tally.confusion.tolist()
    n = tn + fp + fn + tp
    won_unstable = pairs_won(tally.stable, tally.unstable)
    won = won_unstable + pairs_won(tally.stable, tally.no_contact)
    contact_pairs = len(tally.stable) * len(tally.unstable)
    pairs = contact_pairs + len(tally.stable) * len(tally.no_contact)
    return SampleMetrics(
        n=n,
        accuracy=percent(tp + tn, n),
        fdr=percent(fp, tp + fp),
        fpr=percent(fp, fp + tn),
        fnr=percent(fn, fn + tp),
        auc=won / pairs if pairs else None,
        auc_contact=won_unstable / contact_pairs if contact_pairs else None,
        confusion=[[tn, fp], [fn, tp]],
        brier=finite_or_none(tally.squared_error / n) if n else None,
        n_undecided=tally.n_undecided,
    )


def _squared_error(score: Array, truth: npt.NDArray[np.bool_]) -> float:
    if ((score < 0) | (score > 1)).any():
        return math.nan
    return float(np.square(score - truth).sum())
