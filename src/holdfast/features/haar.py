"""The Haar window: m and sigma of streams, and of whole arrays (in C, `kernel/haar.c`).

A window is cut into blocks of 1, 2, 4, ... pairs. The sums of a block come from its two halves,
so that overlapping windows share them; each belongs to its own samples only, and no value is
carried on. A window of 7 pairs consists of blocks of 4, 2 and 1 pairs, the newest being last.
The sums of a block are P = sum (x_0 + x_1), D = sum (x_0 - x_1), and the sum of squares
S = sum (x_0 - x_1 - D / n)^2 over its n pairs. Two blocks, of a and b pairs, give

    P = P_a + P_b,    D = D_a + D_b,    S = S_a + S_b + (b D_a - a D_b)^2 / (a b (a + b))

(Chan, Golub and LeVeque 1983), in which nothing cancels.
"""

import math

import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled_step, joined_step
from holdfast.kernel.batch import fill_haar_features
from holdfast.sensors.types import Array

DEFAULT_WINDOW = 14
"""N_w, the number of samples in the window, as in most of the paper."""

FEATURE_NAMES = ("F_a", "F_x", "F_y", "F_z", "m", "sigma")
"""The paper's features, in the order of the columns of `haar_features`."""


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
    fill_haar_features(values, n_window, out)
    return out


def check_window(window: int) -> int:
    """Return the window as an integer, if it can be cut into pairs.

    Raises:
        ValueError: the window is odd or under 2.
    """
    if window != int(window) or window < 2 or window % 2:
        raise ValueError(f"an even window of at least 2 samples expected, {window} given")
    return int(window)


N_SUMS = 3
"""Sums of a block: P, D and S."""


def n_levels(window: int) -> int:
    """Return the number of sizes of blocks in windows up to this one."""
    return (window // 2).bit_length()


@compiled_step
def _join_factor(n_older: int, n_newer: int) -> float:
    # 1 / (a b (a + b)); 0 where there is nothing to join with.
    return 1.0 / (n_older * n_newer * (n_older + n_newer)) if n_newer else 0.0


@compiled_step
def _m_factor(window: int) -> float:
    # m = P / (sqrt(2) N_w).
    return 1.0 / (math.sqrt(2.0) * window)


@compiled_step
def _sigma_factor(window: int) -> float:
    # sigma^2 = S / (2 N_w).
    return 0.5 / window


@compiled_step
def _row_before(row: int, n: int, length: int) -> int:
    """Return the row of a ring n rows before another; faster than a remainder."""
    return row - n if row >= n else row - n + length


@joined_step
def append_pair(older: float, newer: float, blocks: Array, row: int, first: int, n: int) -> None:
    """Append the blocks that end with a pair of a stream, by the sums of `kernel/haar.c`.

    Args:
        older: the value before the newest.
        newer: the newest value.
        blocks: (longest window, columns) a ring; `N_SUMS` columns for each size of blocks.
        row: of the newest value.
        first: first column of the value.
        n: number of sizes.
    """
    # One pair: P = x_0 + x_1, D = x_0 - x_1, S = 0.
    blocks[row, first], blocks[row, first + 1] = older + newer, older - newer
    blocks[row, first + 2] = 0.0
    size = 1
    for column in range(first, first + N_SUMS * (n - 1), N_SUMS):
        # Two equal halves: S = S_a + S_b + (D_a - D_b)^2 / (2 n), P = P_a + P_b, D = D_a + D_b.
        then = _row_before(row, 2 * size, len(blocks))
        apart = blocks[then, column + 1] - blocks[row, column + 1]
        both = blocks[then, column + 2] + blocks[row, column + 2]
        for place in range(column, column + 2):
            blocks[row, place + N_SUMS] = blocks[then, place] + blocks[row, place]
        blocks[row, column + 2 + N_SUMS] = both + apart * apart * (0.5 / size)
        size *= 2


@compiled_step
def newest_moments(blocks: Array, row: int, first: int, window: int) -> tuple[float, float]:
    """Return m and sigma of the newest window of a stream, the same bits as `haar_features`.

    Args:
        blocks: that `append_pair` filled.
        row: of the newest value.
        first: first column of the value.
        window: N_w.
    """
    total, variance = newest_variance(blocks, row, first, window)
    return total * _m_factor(window), math.sqrt(variance)


@compiled_step
def newest_variance(blocks: Array, row: int, first: int, window: int) -> tuple[float, float]:
    """Return P and sigma squared of the newest window; see `newest_moments`."""
    n_pairs = window // 2
    total = drift = spread = 0.0
    taken, size, column = 0, 1, first
    while taken < n_pairs:
        if n_pairs & size:
            # S = S_a + S_b + (b D_a - a D_b)^2 / (a b (a + b)), P = P_a + P_b, D = D_a + D_b.
            then = _row_before(row, 2 * taken, len(blocks))
            older = blocks[then, column + 1]
            apart = taken * older - size * drift
            both = blocks[then, column + 2] + spread
            spread = both + apart * apart * _join_factor(size, taken)
            total, drift = blocks[then, column] + total, older + drift
            taken += size
        size, column = 2 * size, column + N_SUMS
    return total, spread * _sigma_factor(window)
