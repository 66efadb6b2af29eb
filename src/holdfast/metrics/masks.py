"""Masks over time: their runs, and what is joined, widened or kept of them.

A place is a time [s] or the number of a sample: whatever a gap and a margin are measured in.
"""

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

Mask = npt.NDArray[np.bool_]
Places = npt.NDArray[np.integer[Any] | np.floating[Any]]


def runs(mask: Mask) -> npt.NDArray[np.int64]:
    """(n_runs, 2) first sample of each run of True, and the first after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return edges.reshape(-1, 2)


def joined(mask: Mask, places: Places, gap: float) -> Mask:
    """The mask with its runs joined that are less than `gap` apart.

    Args:
        mask: (n,) of samples.
        places: (n,) of the samples, in order.
        gap: from the last sample of a run to the first of the next, in the unit of the places.
    """
    filled = mask.copy()
    for (_, end), (start, _) in pairwise(runs(mask)):
        if places[start] - places[end - 1] < gap:
            filled[end:start] = True
    return filled


def widened(mask: Mask, places: Places, margin: float) -> Mask:
    """The mask with every run longer by `margin` at both ends.

    Args:
        mask: (n,) of samples.
        places: (n,) of the samples, in order.
        margin: in the unit of the places.
    """
    wide = mask.copy()
    for start, end in runs(mask):
        first = np.searchsorted(places, places[start] - margin)
        last = np.searchsorted(places, places[end - 1] + margin, side="right")
        wide[first:last] = True
    return wide


def runs_with(mask: Mask, wanted: Mask) -> Mask:
    """The runs of the mask in which something wanted happens."""
    found = np.zeros_like(mask)
    for start, end in runs(mask):
        found[start:end] = wanted[start:end].any()
    return found
