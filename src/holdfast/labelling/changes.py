"""Where a force begins or ends to change: the places that edges of labels snap to.

A force that is steady and then grows has a kink where the growth begins, and another where it
ends; so has a push. A kink is told by the slopes before and after an instant.
"""

import numpy as np
from scipy.ndimage import convolve1d, maximum_filter1d

from holdfast.sensors.values import Array

REACH = 0.1
"""How long a slope is looked at, before and after [s]."""
APART = 0.05
"""Two kinks are at least so far apart [s]: of nearer ones the sharper counts."""
NOISE_TIMES = 6.0
"""How often the median difference of slopes a kink has at least: chance gives none in an hour."""
LEAST_CHANGE = 0.01
"""Share of the largest force by which it bends within `REACH` at least: less is not seen."""


def change_points(times: Array, force: Array, period: float) -> Array:
    """When the force on a finger begins or ends to change.

    Args:
        times: (n,) strictly increasing [s].
        force: (n, 3) [any unit]; NaN where it is not known.
        period: of the samples [s].

    Returns:
        In order of time [s].

    Example:
        >>> times = np.arange(300) / 150
        >>> ramp = np.clip((times - 0.5) / 0.5, 0, 1)
        >>> force = np.column_stack([ramp, 0 * ramp, 0 * ramp])
        >>> change_points(times, force, 1 / 150).round(2).tolist()
        [0.5, 1.0]
    """
    known = np.isfinite(force).all(axis=1)
    n = max(round(REACH / period), 2)
    if known.sum() <= 2 * n:
        return np.empty(0)
    own, values = times[known], force[known]
    bend = np.linalg.norm(_bend(values, n), axis=1)
    limit = max(
        NOISE_TIMES * float(np.median(bend)),
        LEAST_CHANGE * float(np.quantile(np.linalg.norm(values, axis=1), 0.99)),
        float(np.finfo(float).tiny),
    )
    width = 2 * max(round(APART / period), 1) + 1
    peaks = (bend >= limit) & (bend == maximum_filter1d(bend, width))
    peaks[1:] &= ~(peaks[:-1] & peaks[1:])  # of a flat top the first
    return np.asarray(own[peaks])


def _bend(force: Array, n: int) -> Array:
    """(n_samples, 3) how far n samples on the force is from where it was going.

    The slope over the n samples after an instant less the slope over those before, by least
    squares, times n.
    """
    steps = np.arange(n + 1) - n / 2
    slope = steps / (steps @ steps)
    weights = np.concatenate([-slope[:-1], [-slope[-1] + slope[0]], slope[1:]]) * n
    bend: Array = convolve1d(force, weights[::-1], axis=0, mode="nearest")
    return bend
