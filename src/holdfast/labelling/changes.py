"""Where a force begins or ends to change: the places that edges of labels snap to.

A force that is steady and then grows, jumps or trembles moves far from where it is within the
next instants, and did not in the instants before; where it comes to rest it is the other way
round.
"""

import math

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from holdfast.sensors.types import Array

SMOOTHING = 0.03
"""Over which the force is averaged first [s]: its noise goes, an edge stays where it is."""
REACH = 0.2
"""How far is looked ahead and back [s]."""
STEPS = 16
"""Instants that are looked at in either direction, at most."""
APART = 0.1
"""Two places are at least so far apart [s]: of nearer ones the clearer counts."""
TIMES = 2.5
"""How many times more the force moves on one side than on the other."""
NOISE_TIMES = 2.0
"""How often the median movement counts as none."""
LEAST = 0.01
"""Share of the largest force that counts as no movement: less is not seen on a plot."""


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
        [0.49, 1.01]
    """
    known = np.isfinite(force).all(axis=1)
    own, values = times[known], force[known]
    n = max(round(REACH / period), 1)
    if len(own) <= 2 * n:
        return np.empty(0)
    values = uniform_filter1d(values, 2 * round(SMOOTHING / period / 2) + 1, axis=0)
    ahead, back = _movements(values, n)
    largest = float(np.quantile(np.linalg.norm(values, axis=1), 0.99))
    calm = max(NOISE_TIMES * float(np.median(ahead)), LEAST * largest, float(np.finfo(float).tiny))
    contrast = np.abs(np.log((ahead + calm) / (back + calm)))
    width = 2 * max(round(APART / period), 1) + 1
    peaks = (contrast >= math.log(TIMES)) & (contrast == maximum_filter1d(contrast, width))
    return np.asarray(own[peaks])


def _movements(force: Array, n: int) -> tuple[Array, Array]:
    """(n_samples,) mean distance of the force from its next n samples, and from its last n.

    Beyond both ends the force stays what it is there.
    """
    steps = np.unique(np.linspace(1, n, min(n, STEPS)).round().astype(int))
    ahead, back = np.zeros(len(force)), np.zeros(len(force))
    for step in steps.tolist():
        moved = np.linalg.norm(force[step:] - force[:-step], axis=1)
        ahead[:-step] += moved
        back[step:] += moved
        ahead[-step:] += np.linalg.norm(force[-1] - force[-step:], axis=1)
        back[:step] += np.linalg.norm(force[0] - force[:step], axis=1)
    return ahead / len(steps), back / len(steps)
