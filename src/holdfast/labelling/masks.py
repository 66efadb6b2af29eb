"""Masks over time: what is joined, left out or grown before it becomes an interval."""

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from holdfast.metrics.masks import joined, runs, runs_with, widened
from holdfast.sensors.values import Array
from holdfast.twin.labels import LabelRule

Mask = npt.NDArray[np.bool_]

MERGE = LabelRule.merge
"""Two stretches of trouble with a shorter rest between them are drawn as one [s]."""
MARGIN = LabelRule.margin
"""By which trouble is drawn longer at both ends [s]."""
BLIP = LabelRule.blip
"""Contact or its loss for a shorter time is not told [s]."""


def n_samples(duration: float, period: float) -> int:
    """How many samples of a grid a duration lasts; one at least."""
    return max(round(duration / period), 1)


def closed(mask: Mask, gap: int) -> Mask:
    """The mask with rests of fewer than `gap` samples filled in between its runs."""
    return joined(mask, np.arange(len(mask)), gap + 1)


def lasting(mask: Mask, least: int) -> Mask:
    """The mask without runs of fewer than `least` samples."""
    kept = mask.copy()
    for start, end in runs(mask):
        kept[start:end] = end - start >= least
    return kept


def steady(mask: Mask, blip: int) -> Mask:
    """The mask without rests and then without runs of fewer than `blip` samples."""
    return lasting(closed(mask, blip), blip)


def grown(mask: Mask, margin: int) -> Mask:
    """The mask with every run longer by `margin` samples at both ends."""
    return widened(mask, np.arange(len(mask)), margin)


def with_hysteresis(values: Array, low: float, high: float) -> Mask:
    """Runs above `low` that reach `high` somewhere; NaN is below both."""
    return runs_with(values > low, values > high)


def smoothed(values: Array, n: int) -> Array:
    """The mean over n samples about each one, along the first axis."""
    return np.asarray(uniform_filter1d(values, n, axis=0, mode="nearest"))


def known_between(grid: Array, times: Array, longest: float) -> Mask:
    """Where on a grid there are times around that are not further apart than `longest` [s].

    Args:
        grid: (n,) [s].
        times: (m,) of what is known, in order [s].
        longest: gap that is bridged [s].
    """
    if not len(times):
        return np.zeros(len(grid), dtype=bool)
    after = np.searchsorted(times, grid)
    later = times[np.minimum(after, len(times) - 1)]
    earlier = times[np.maximum(after - 1, 0)]
    inside = (grid >= times[0] - longest / 2) & (grid <= times[-1] + longest / 2)
    return np.asarray(inside & (later - earlier <= longest * (1 + 1e-9)))
