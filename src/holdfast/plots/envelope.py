"""Long curves with few points: what a figure can show, and no peak lost."""

import numpy as np

from holdfast.sensors.types import Array


def envelope(times: Array, values: Array, n_bins: int = 2000) -> tuple[Array, Array]:
    """The smallest and the largest value of each of `n_bins` stretches of samples.

    Drawn as a curve it looks as all samples would. Short curves stay as they are.

    Args:
        times: (n,) [s].
        values: (n,) of any unit; NaN where there is none.
        n_bins: stretches, each of which gives two points.

    Returns:
        Times and values, (2 n_bins,); NaN where a stretch has no value.

    Example:
        >>> times, values = envelope(np.arange(6.0), np.array([0, 1, 2, 9, -9, 0.0]), n_bins=2)
        >>> times.tolist(), values.tolist()
        ([0.0, 2.0, 3.0, 5.0], [0.0, 2.0, -9.0, 9.0])
    """
    n = len(values)
    if n <= 2 * n_bins:
        return times, values
    edges = np.linspace(0, n, n_bins + 1).astype(int)
    low = np.fmin.reduceat(values, edges[:-1])
    high = np.fmax.reduceat(values, edges[:-1])
    ends = times[np.stack([edges[:-1], edges[1:] - 1], axis=1)]
    return ends.ravel(), np.stack([low, high], axis=1).ravel()
