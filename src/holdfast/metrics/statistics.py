"""Statistics that samples and events share, and their confidence intervals.

The intervals are made by bootstrap over recordings, because neighbouring samples are nearly equal.
A resample draws as many recordings as there are, with replacement. It is an array of the number
of times that each recording was drawn. A statistic is computed for all resamples at once.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from holdfast.sensors.types import Array

Interval = tuple[float | None, float | None]
"""Lower and upper end; None for an infinite end."""

Statistic = Callable[[Array], Array]
"""Function of draws (n, n_recordings) to values (n,); NaN if a resample does not define it."""

MAX_SCORE_BINS = 4096
"""Maximum number of bins of scores, of about equal count; far finer than an interval is wide."""


def percent(part: float, whole: float) -> float | None:
    """Return 100 part / whole [%]; None if the whole is 0."""
    return 100.0 * part / whole if whole else None


def poisson_limit(n: int, confidence: float = 0.95) -> float:
    """Return the exact upper limit of the mean of a Poisson number that was n.

    It is the mean m with P(at most n | m) = 1 - confidence.

    Example:
        >>> [round(poisson_limit(n), 3) for n in (0, 1, 10)]
        [2.996, 4.744, 16.962]
    """
    low, high = 0.0, 10.0 + 2.0 * n
    for _ in range(64):  # by bisection: the bits of a float64
        mean = (low + high) / 2
        logs = [k * math.log(mean) - mean - math.lgamma(k + 1) for k in range(n + 1)]
        low, high = (mean, high) if sum(map(math.exp, logs)) > 1 - confidence else (low, mean)
    return high


def mann_whitney_u(positive: Array, negative: Array) -> float:
    """Return the Mann-Whitney statistic U.

    U is the number of pairs (positive, negative) in which the positive has the higher score; a
    tie counts half. The area under the ROC curve is U divided by the number of pairs.

    Args:
        positive: (p,) scores, no NaN.
        negative: (q,) scores, no NaN.

    Returns:
        U, from 0 to p q.

    Example:
        >>> mann_whitney_u(np.array([0.5, 0.9]), np.array([0.1, 0.5]))
        3.5
    """
    # By ranks in sorted scores: the pairs themselves would be billions.
    upper, lower = np.sort(positive), np.sort(negative)
    below = np.searchsorted(lower, upper, side="left").sum()
    not_above = np.searchsorted(lower, upper, side="right").sum()
    return float(below + not_above) / 2


def quantile(ordered: Array, q: float) -> float | None:
    """Return the q-quantile of ordered values, of which the last may be infinite.

    It is interpolated linearly as by NumPy, at the position h = q (n - 1) between two values. It
    is infinite if one of them has a weight and is infinite.

    Args:
        ordered: (n,) ascending.
        q: from 0 to 1.

    Returns:
        The quantile; None without values.

    Example:
        >>> quantile(np.array([1.0, 2.0, np.inf]), 0.5)
        2.0
        >>> quantile(np.array([1.0, 2.0, np.inf]), 0.75)
        inf
    """
    if not len(ordered):
        return None
    # Rounded: a product a little above a whole number would give an infinite neighbour a weight.
    position = round(q * (len(ordered) - 1), 9)
    lower = math.floor(position)
    fraction = position - lower
    value = float(ordered[lower])
    if not fraction or not math.isfinite(value):
        return value
    return value + fraction * (float(ordered[lower + 1]) - value)


def finite_or_none(value: float | None) -> float | None:
    """Return the value; None if it is infinite or NaN, which JSON cannot represent."""
    return value if value is not None and math.isfinite(value) else None


def bootstrap_interval(
    statistic: Statistic,
    n_recordings: int,
    *,
    n: int = 1000,
    seed: int = 0,
    level: float = 0.95,
) -> Interval | None:
    """Compute the percentile interval of a statistic over resampled recordings.

    Its ends are the (1 - level)/2 and (1 + level)/2 quantiles of the statistic over n
    resamples. Resamples that do not define the statistic are left out.

    Args:
        statistic: see `ratio_of_sums`, `auc_of` and `quantile_of`.
        n_recordings: number of recordings.
        n: number of resamples.
        seed: of the resamples; the same seed draws the same recordings for every statistic.
        level: fraction of the resamples within the interval.

    Returns:
        The interval; None with fewer than two recordings, or if no resample defines it.

    Example:
        >>> right, samples = np.array([90, 80, 99]), np.array([100, 100, 100])
        >>> bootstrap_interval(ratio_of_sums(right, samples), n_recordings=3)
        (0.8, 0.99)
    """
    if n_recordings < 2:
        return None
    values = statistic(draw_recordings(n_recordings, n, seed))
    ordered = np.sort(values[~np.isnan(values)])
    if not len(ordered):
        return None
    low, high = quantile(ordered, (1 - level) / 2), quantile(ordered, (1 + level) / 2)
    return finite_or_none(low), finite_or_none(high)


def ratio_of_sums(parts: npt.ArrayLike, wholes: npt.ArrayLike) -> Statistic:
    """Return the statistic sum(parts) / sum(wholes); with wholes of 1, the mean of the parts.

    Args:
        parts: (n_recordings,); or (n, n_recordings), others in each resample.
        wholes: (n_recordings,).
    """
    part, whole = np.asarray(parts, dtype=np.float64), np.asarray(wholes, dtype=np.float64)
    if part.ndim == 2:
        return lambda draws: _divide((draws * part).sum(axis=1), draws @ whole)
    return lambda draws: _divide(draws @ part, draws @ whole)


def auc_of(positives: Sequence[Array], negatives: Sequence[Array]) -> Statistic:
    """Return the statistic AUC over the pooled samples.

    U[r, s] is the number of pairs in which a positive of recording r has a higher score than a
    negative of recording s; w[r] is the number of times that r was drawn:

        AUC = sum(w[r] w[s] U[r, s]) / (sum(w[r] p[r]) sum(w[s] q[s]))

    No resample needs sorting. Up to 4096 samples U is exact; with more samples, scores in the
    same bin count as ties.

    Args:
        positives: scores of class 1 for each recording.
        negatives: scores of class 0 for each recording.
    """
    ordered = np.sort(np.concatenate([*positives, *negatives]))
    edges = np.unique(ordered[:: max(1, -(-len(ordered) // MAX_SCORE_BINS))])

    def histograms(scores: Sequence[Array]) -> Array:
        # Sorted scores are found faster, as neighbours end in the same bins.
        bins = [np.searchsorted(edges, np.sort(score), side="right") for score in scores]
        rows = [np.bincount(bins_of_row, minlength=len(edges) + 1) for bins_of_row in bins]
        return np.array(rows, dtype=np.float64)

    return auc_of_counts(histograms(positives), histograms(negatives))


def auc_of_counts(positive: Array, negative: Array) -> Statistic:
    """Return the statistic AUC of `auc_of` from histograms of the scores.

    Args:
        positive: (n_recordings, n_bins) number of scores of class 1 in each bin, in order.
        negative: the same of class 0.
    """
    ordered_pairs = positive @ (np.cumsum(negative, axis=1) - negative / 2).T
    p, q = positive.sum(axis=1), negative.sum(axis=1)
    return lambda w: _divide(((w @ ordered_pairs) * w).sum(axis=1), (w @ p) * (w @ q))


def quantile_of(values: Sequence[Array], q: float) -> Statistic:
    """Return the statistic q-quantile over the pooled values, which may be infinite.

    Args:
        values: for each recording.
        q: from 0 to 1.
    """
    recordings = np.repeat(np.arange(len(values)), [len(part) for part in values])
    pooled = np.concatenate([np.empty(0), *values])
    order = np.argsort(pooled, kind="stable")
    ordered, recordings = pooled[order], recordings[order]

    def statistic(draws: Array) -> Array:
        counts = draws.astype(np.intp)
        quantiles = (quantile(np.repeat(ordered, row[recordings]), q) for row in counts)
        return np.array([np.nan if value is None else value for value in quantiles])

    return statistic


@lru_cache(maxsize=1)
def draw_recordings(n_recordings: int, n: int, seed: int) -> Array:
    """Return (n, n_recordings) number of times that each resample drew each recording."""
    shares = np.full(n_recordings, 1 / n_recordings)
    draws = np.random.default_rng(seed).multinomial(n_recordings, shares, size=n).astype(float)
    draws.flags.writeable = False  # every statistic of a study gets the same array
    return draws


def _divide(part: Array, whole: Array) -> Array:
    """Return part / whole; NaN where the whole is 0."""
    out = np.full(len(part), np.nan)
    np.divide(part, whole, out=out, where=whole > 0)
    return out
