"""Masks over time: their runs, and operations that join, widen, drop or select runs.

A position is the time [s] or the number of a sample. Gaps and margins have the same unit.
"""

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.sensors.types import Array

Mask = npt.NDArray[np.bool_]
Positions = npt.NDArray[np.integer[Any] | np.floating[Any]]


def runs(mask: Mask) -> npt.NDArray[np.int64]:
    """Return the runs of True in a mask.

    Returns:
        (n_runs, 2) number of the first sample of each run, and of the first sample after it.

    Example:
        >>> runs(np.array([True, True, False, True])).tolist()
        [[0, 2], [3, 4]]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return edges.reshape(-1, 2)


def join_runs(mask: Mask, positions: Positions, gap: float) -> Mask:
    """Fill the gaps between runs that are less than `gap` apart.

    Args:
        mask: (n,) of samples.
        positions: (n,) of the samples, increasing.
        gap: from the last sample of a run to the first of the next, in the unit of `positions`.
    """
    filled = mask.copy()
    for (_, end), (start, _) in pairwise(runs(mask)):
        if positions[start] - positions[end - 1] < gap:
            filled[end:start] = True
    return filled


def fill_short_gaps(mask: Mask, n_samples: int) -> Mask:
    """Fill the gaps between runs that have fewer than `n_samples` samples."""
    return join_runs(mask, np.arange(len(mask)), n_samples + 1)


def drop_short_runs(mask: Mask, n_samples: int) -> Mask:
    """Remove the runs that have fewer than `n_samples` samples."""
    kept = mask.copy()
    for start, end in runs(mask):
        kept[start:end] = end - start >= n_samples
    return kept


def without_short_runs(mask: Mask, positions: Positions, length: float) -> Mask:
    """Fill the gaps that are shorter than `length`, then remove the runs that are."""
    # A run is a gap of the opposite mask.
    return ~join_runs(~join_runs(mask, positions, length), positions, length)


def widen_runs(mask: Mask, positions: Positions, margin: float) -> Mask:
    """Extend every run by `margin` at both ends.

    Args:
        mask: (n,) of samples.
        positions: (n,) of the samples, increasing.
        margin: in the unit of `positions`.
    """
    wide = mask.copy()
    for start, end in runs(mask):
        first = np.searchsorted(positions, positions[start] - margin)
        last = np.searchsorted(positions, positions[end - 1] + margin, side="right")
        wide[first:last] = True
    return wide


def runs_with(mask: Mask, selected: Mask) -> Mask:
    """Keep the runs of a mask that contain at least one selected sample."""
    kept = np.zeros_like(mask)
    for start, end in runs(mask):
        kept[start:end] = selected[start:end].any()
    return kept


def hysteresis(values: Array, low: float, high: float) -> Mask:
    """Return the runs of values above `low` that somewhere exceed `high`; NaN exceeds neither."""
    return runs_with(values > low, values > high)


def covered(grid: Array, times: Array, max_gap: float) -> Mask:
    """Return where neighbouring times around a grid point are at most `max_gap` apart.

    Args:
        grid: (n,) [s].
        times: (m,) of known values, increasing [s].
        max_gap: longest gap that is bridged; half of it before the first and after the last [s].

    Returns:
        (n,) True where the grid point is covered.
    """
    if not len(times):
        return np.zeros(len(grid), dtype=bool)
    after = np.searchsorted(times, grid)
    later = times[np.minimum(after, len(times) - 1)]
    earlier = times[np.maximum(after - 1, 0)]
    inside = (grid >= times[0] - max_gap / 2) & (grid <= times[-1] + max_gap / 2)
    # Times of exactly `max_gap` may differ by rounding.
    return np.asarray(inside & (later - earlier <= max_gap * (1 + 1e-9)))


def n_samples_of(duration: float, period: float) -> int:
    """Return how many samples of a period [s] a duration [s] lasts, at least one."""
    return max(round(duration / period), 1)
