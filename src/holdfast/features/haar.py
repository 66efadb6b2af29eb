"""The Haar window: one definition of m and sigma for whole arrays and for streams."""

import math

import numba
import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled_parallel, compiled_step

Array = npt.NDArray[np.float64]

DEFAULT_WINDOW = 14
"""N_w, the number of samples in the window, as in most of the paper."""

FEATURE_NAMES = ("F_a", "F_x", "F_y", "F_z", "m", "sigma")
"""The paper's features, in the order of the columns of `haar_features`."""

_BLOCK_SAMPLES = 512
"""Samples that one thread computes at a time: they fit into the cache."""


def haar_features(force: npt.ArrayLike, window: int = DEFAULT_WINDOW) -> npt.NDArray[np.float64]:
    r"""Return the paper's six features of a fingertip force, at every sample.

    They are the amplitude F_a = |F_tip|, the three components, and two values from the Haar
    transform of F_a over the window that ends at the sample: the moving average m of the
    approximations (equation 1) and the standard deviation sigma of the details (equation 2).

        a = (x_0 + x_1) / sqrt(2),        d = (x_0 - x_1) / sqrt(2)
        m = sum(a) / N_w,                 sigma = sqrt(sum((d - mean(d))^2) / N_w)

    Args:
        force: (n, 3) fingertip force [count or N]. Windows with a row that is not finite have
            no features.
        window: N_w, number of samples in the window; even, at least 2.

    Returns:
        (n, 6) float64 in the order of `FEATURE_NAMES`; rows without a full window are NaN.

    Raises:
        ValueError: the window is odd or under 2, or the force has another shape.

    Example:
        >>> force = np.array([[3.0, 4.0, 0.0], [6.0, 8.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 0.0]])
        >>> haar_features(force, window=4)[-1].round(3).tolist()
        [5.0, 3.0, 4.0, 0.0, 4.419, 1.25]
    """
    n_window = check_window(window)
    values = np.ascontiguousarray(force, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != 3:
        raise ValueError(f"a force of shape (n, 3) expected, {values.shape} given")
    out = np.empty((len(values), len(FEATURE_NAMES)))
    fill_features(values, n_window, out)
    return out


def check_window(window: int) -> int:
    """Return the window as an integer, if it can be cut into pairs.

    Raises:
        ValueError: the window is odd or under 2.
    """
    if window != int(window) or window < 2 or window % 2:
        raise ValueError(f"an even window of at least 2 samples expected, {window} given")
    return int(window)


@compiled_step
def haar_windows(x: Array, window: int, m: Array, sigma: Array, scratch: Array) -> None:
    """Compute m and sigma of every window in x (equations 1 and 2).

    The first window ends at x[window - 1]. Each window takes two passes. No value is carried
    from one sample to the next: so there is no drift, any chunking gives the same bits, and a
    value that is not finite makes exactly the windows with it NaN. The inner loops run over
    windows, so that the compiler can vectorise them.

    Args:
        x: (n + window - 1,) values, contiguous.
        window: N_w.
        m: (n,) is filled.
        sigma: (n,) is filled.
        scratch: (n,) is overwritten.
    """
    n = len(m)
    m[:] = 0.0
    sigma[:] = 0.0
    scratch[:] = 0.0
    for j in range(0, window, 2):
        older, newer = x[j : j + n], x[j + 1 : j + 1 + n]
        for k in range(n):
            m[k] += older[k] + newer[k]
            scratch[k] += older[k] - newer[k]
    for k in range(n):
        m[k] /= math.sqrt(2.0) * window
        scratch[k] /= window // 2
    for j in range(0, window, 2):
        older, newer = x[j : j + n], x[j + 1 : j + 1 + n]
        for k in range(n):
            deviation = older[k] - newer[k] - scratch[k]
            sigma[k] += deviation * deviation
    for k in range(n):
        sigma[k] = math.sqrt(sigma[k] / (2.0 * window))


@compiled_step
def haar_window(x: Array, window: int) -> tuple[float, float]:
    """Return m and sigma of one window, by the same sums in the same order as `haar_windows`.

    Args:
        x: (window,) values.
        window: N_w.
    """
    total = drift = spread = 0.0
    for j in range(0, window, 2):
        total += x[j] + x[j + 1]
        drift += x[j] - x[j + 1]
    drift /= window // 2
    for j in range(0, window, 2):
        deviation = x[j] - x[j + 1] - drift
        spread += deviation * deviation
    return total / (math.sqrt(2.0) * window), math.sqrt(spread / (2.0 * window))


@compiled_parallel
def fill_features(force: Array, window: int, out: Array) -> None:
    """Fill (n, 6) `out` with the result of `haar_features`. The arguments are not checked."""
    n = len(force)
    out[: min(window - 1, n)] = math.nan
    for block in numba.prange(max(n - window + _BLOCK_SAMPLES, 0) // _BLOCK_SAMPLES):
        start = window - 1 + block * _BLOCK_SAMPLES
        stop = min(start + _BLOCK_SAMPLES, n)
        origin = start - window + 1
        amplitude = np.empty(stop - origin)
        for k in range(origin, stop):
            x, y, z = force[k, 0], force[k, 1], force[k, 2]
            amplitude[k - origin] = math.sqrt(x * x + y * y + z * z)
        m = np.empty(stop - start)
        sigma = np.empty(stop - start)
        scratch = np.empty(stop - start)
        haar_windows(amplitude, window, m, sigma, scratch)
        for k in range(start, stop):
            row = out[k]
            if math.isfinite(sigma[k - start]):
                row[0] = amplitude[k - origin]
                row[1], row[2], row[3] = force[k, 0], force[k, 1], force[k, 2]
                row[4], row[5] = m[k - start], sigma[k - start]
            else:
                row[:] = math.nan
