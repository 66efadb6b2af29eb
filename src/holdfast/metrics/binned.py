"""Histograms of scores: metrics of more samples than memory holds.

A bin is 0.02 wide in log odds, so bins are narrow where probabilities are near 0 or 1. Two scores
in the same bin count as a tie. The area under the ROC curve then changes by less than half of the
share of pairs that have the same bin.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from holdfast.metrics.samples import ScoredSamples, pool_samples
from holdfast.sensors.types import Array, Integers

MAX_LOG_ODDS = 40.0
"""Log odds at the first and the last bin; those of float64 end at 37."""
BINS_PER_UNIT = 50
"""Number of bins for each unit of the log odds."""
N_BINS = int(2 * MAX_LOG_ODDS * BINS_PER_UNIT) + 1


@dataclass(frozen=True, eq=False)
class BinnedSamples:
    """Number of samples by label and score, which can be added.

    Attributes:
        counts: (3, N_BINS) samples labelled STABLE, UNSTABLE and NO_CONTACT in each bin.
        confusion: (2, 2) counts [[TN, FP], [FN, TP]].
        squared_error: sum of (score - class)^2; NaN where a score lies outside [0, 1].
        n_undecided: number of samples with a label whose decided state is UNKNOWN.
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
        return _ordered_pairs(stable, unstable), _ordered_pairs(stable, no_contact)


class SampleTotal:
    """Sum of scored samples: exact as long as the scores are few, then a histogram.

    Example:
        >>> from holdfast.metrics.samples import score_samples
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


def bins_of(scores: Array) -> npt.NDArray[np.intp]:
    """Return (n,) the bin of each score.

    Example:
        >>> bins_of(np.array([0.0, 0.5, 1.0])).tolist()
        [0, 2000, 4000]
    """
    inside = np.clip(scores, 0.0, 1.0)
    with np.errstate(divide="ignore"):
        log_odds = np.log(inside) - np.log1p(-inside)
    bounded = np.clip(log_odds, -MAX_LOG_ODDS, MAX_LOG_ODDS)
    bins: npt.NDArray[np.intp] = np.rint((bounded + MAX_LOG_ODDS) * BINS_PER_UNIT).astype(np.intp)
    return bins


def _ordered_pairs(upper: Integers, lower: Integers) -> float:
    """Return the number of pairs in which the upper has the higher score; a tie counts half."""
    below = np.cumsum(lower) - lower
    return float((upper.astype(np.float64) * (below + 0.5 * lower)).sum())
