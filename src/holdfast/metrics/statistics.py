"""The few statistics that samples, events and intervals share."""

import math

import numpy as np

from holdfast.sensors.types import Array


def percent(part: float, whole: float) -> float | None:
    """100 part / whole [%]; None where the whole is 0."""
    return 100.0 * part / whole if whole else None


def pairs_won(positive: Array, negative: Array) -> float:
    """How many pairs (positive, negative) the positive's score wins; a tie counts half.

    This is the Mann-Whitney statistic U; the area under the ROC curve is U divided by the
    number of pairs.

    Args:
        positive: (p,) scores, no NaN.
        negative: (q,) scores, no NaN.

    Returns:
        U, from 0 to p q.

    Example:
        >>> pairs_won(np.array([0.5, 0.9]), np.array([0.1, 0.5]))
        3.5
    """
    upper, lower = np.sort(positive), np.sort(negative)
    below = np.searchsorted(lower, upper, side="left").sum()
    not_above = np.searchsorted(lower, upper, side="right").sum()
    return float(below + not_above) / 2


def quantile(ordered: Array, q: float) -> float | None:
    """The q-quantile of ordered values that may end in infinities.

    Interpolated linearly as NumPy does: at place h = q (n - 1), between the values on either
    side. It is infinite where a value with any weight is.

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
    place = round(q * (len(ordered) - 1), 9)
    lower = math.floor(place)
    share = place - lower
    value = float(ordered[lower])
    if not share or not math.isfinite(value):
        return value
    return value + share * (float(ordered[lower + 1]) - value)


def finite_or_none(value: float | None) -> float | None:
    """The value; None where it is infinite or NaN, which JSON cannot hold."""
    return value if value is not None and math.isfinite(value) else None
