"""How far two clocks are apart, told from what both saw move."""

from typing import NamedTuple

import numpy as np

from holdfast.metrics.masks import Mask
from holdfast.sensors.types import Array

FARTHEST = 0.5
"""Offsets that are tried, to both sides [s]."""
ALIKE = 0.3
"""Correlation from which on the two are believed to show the same motion."""


class Offset(NamedTuple):
    """What is added to the times of one to have them on the clock of the other.

    Attributes:
        seconds: the offset [s]; 0 where the two are not alike at any.
        alike: their correlation there, from -1 to 1.
    """

    seconds: float
    alike: float

    @property
    def believed(self) -> bool:
        """Whether the two are alike enough to believe it."""
        return self.alike >= ALIKE


def offset_of(seen: Array, felt: Array, known: Mask, period: float) -> Offset:
    """By how much what was seen is behind what was felt, on one grid.

    The logarithms of both are compared, by the correlation of ranks in all but name: one huge
    knock must not outvote all else.

    Args:
        seen: (n,) how much moved, at least 0.
        felt: (n,) how much was felt, at least 0.
        known: (n,) where something was seen.
        period: of the grid [s].
    """
    reach = min(round(FARTHEST / period), len(seen) // 2)
    a, b = _level(seen, known), _level(felt, np.ones_like(known))
    found = [(_alike(a, b, known, shift), -abs(shift), shift) for shift in range(-reach, reach + 1)]
    alike, _, shift = max(found)
    return Offset(shift * period if alike >= ALIKE else 0.0, alike)


def _level(values: Array, known: Mask) -> Array:
    """Ranks between 0 and 1 where values are known; 0 elsewhere."""
    level = np.zeros(len(values))
    inside = values[known]
    order = np.argsort(np.argsort(inside, kind="stable"), kind="stable")
    level[known] = order / max(len(inside) - 1, 1)
    return level


def _alike(a: Array, b: Array, known: Mask, shift: int) -> float:
    """The correlation of a, later by `shift` samples, with b."""
    n = len(a)
    first, last = max(0, -shift), min(n, n - shift)
    mask = known[first:last]
    x, y = a[first:last][mask], b[first + shift : last + shift][mask]
    if len(x) < 3 or x.std() == 0 or y.std() == 0:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])
