"""Statistics that samples, events and intervals share."""

import math

import numpy as np

from holdfast.sensors.types import Array


def percent(part: float, whole: float) -> float | None:
    """Return 100 part / whole [%]; None if the whole is 0."""
    return 100.0 * part / whole if whole else None


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
