"""The Haar window: one definition of m and sigma for whole arrays and for streams.

A window is cut into blocks of 1, 2, 4, ... pairs. The sums of a block come from its two halves,
so that overlapping windows share them; each belongs to its own samples only, and no value is
carried on. A window of 7 pairs consists of blocks of 4, 2 and 1 pairs, the newest being last.
The sums of a block are P = sum (x_0 + x_1), D = sum (x_0 - x_1), and the sum of squares
S = sum (x_0 - x_1 - D / n)^2 over its n pairs. Two blocks, of a and b pairs, give

    P = P_a + P_b,    D = D_a + D_b,    S = S_a + S_b + (b D_a - a D_b)^2 / (a b (a + b))

(Chan, Golub and LeVeque 1983), in which nothing cancels.
"""

import math

import numba
import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled, compiled_parallel, compiled_step, joined_step
from holdfast.sensors.types import Array

DEFAULT_WINDOW = 14
"""N_w, the number of samples in the window, as in most of the paper."""

FEATURE_NAMES = ("F_a", "F_x", "F_y", "F_z", "m", "sigma")
"""The paper's features, in the order of the columns of `haar_features`."""

SERIAL_SAMPLES = 1 << 17
"""Fewer samples are computed in one thread, in under a millisecond: on a machine with other work,
threads wait for each other for several."""

_BLOCK_SAMPLES = 1024
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
    fill = fill_features if len(values) > SERIAL_SAMPLES else fill_features_alone
    fill(values, n_window, out)
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
_SCRATCH_ROWS = 2 * N_SUMS + 1


def n_levels(window: int) -> int:
    """Return the number of sizes of blocks in windows up to this one."""
    return (window // 2).bit_length()


@compiled_step
def haar_windows(x: Array, window: int, m: Array, sigma: Array, scratch: Array) -> None:
    """Compute m and sigma of every window in x (equations 1 and 2).

    The first window ends at x[window - 1]. Any chunking gives the same bits, and a value that
    is not finite makes exactly the windows with it so. The inner loops run over windows and
    fill one array each, so that the compiler can vectorise them.

    Args:
        x: (n + window - 1,) values, contiguous.
        window: N_w.
        m: (n,) is filled.
        sigma: (n,) is filled.
        scratch: (_SCRATCH_ROWS, n + window - 1 or more) is overwritten.
    """
    n, n_pairs, length = len(m), window // 2, len(x) - 1
    # P, D and S of the blocks that begin at each sample, of one size and of the next.
    p, d, s = scratch[0], scratch[1], scratch[2]
    next_p, next_d, next_s = scratch[3], scratch[4], scratch[5]
    own_d = scratch[6, :n]
    # One pair: P = x_0 + x_1, D = x_0 - x_1, S = 0.
    _pair(x, p[:length], d)
    s[:] = 0.0
    taken, size = 0, 1
    while True:
        # N_w / 2 in binary: each of its ones is a block of so many pairs, the newest first.
        if n_pairs & size:
            start = 2 * (n_pairs - taken - size)
            if taken + size == n_pairs:
                _fill_window(p[start:], d[start:], s[start:], size, m, own_d, sigma, taken)
                break
            if taken == 0:
                _copy(s[start:], sigma)
                _copy(d[start:], own_d)
                _copy(p[start:], m)
            else:
                _join(d[start:], s[start:], size, own_d, sigma, taken)
                _add(p[start:], m, m)
            taken += size
        step = 2 * size
        length -= step
        # Two equal halves: P = P_a + P_b, D = D_a + D_b, S = S_a + S_b + (D_a - D_b)^2 / (2 n).
        if size == 1:
            _join_pairs(d, d[step:], next_d[:length], next_s)
        else:
            _join_equal(d, d[step:], s, s[step:], size, next_s[:length])
            _add(d, d[step:], next_d[:length])
        _add(p, p[step:], next_p[:length])
        p, d, s, next_p, next_d, next_s = next_p, next_d, next_s, p, d, s
        size = step


@compiled_step
def _fill_window(
    older_p: Array,
    older_d: Array,
    older_s: Array,
    n_older: int,
    m: Array,
    newer_d: Array,
    sigma: Array,
    n_newer: int,
) -> None:
    """Compute m and sigma from the oldest block of each window and the sums of its newer pairs.

    Args:
        older_p: P of the oldest blocks.
        older_d: D of the oldest blocks.
        older_s: S of the oldest blocks.
        n_older: pairs of the oldest block.
        m: P of the newer pairs; becomes m.
        newer_d: D of the newer pairs.
        sigma: S of the newer pairs; becomes sigma.
        n_newer: newer pairs; with 0, their sums are not used.
    """
    # m = sum(a) / N_w = P / (sqrt(2) N_w) (equation 1).
    # sigma = sqrt(sum (d - mean d)^2 / N_w) = sqrt(S / (2 N_w)) (equation 2).
    window = 2 * (n_older + n_newer)
    m_factor, sigma_factor = _m_factor(window), _sigma_factor(window)
    if n_newer == 0:
        for k in range(len(m)):
            m[k] = older_p[k] * m_factor
        for k in range(len(m)):
            sigma[k] = math.sqrt(older_s[k] * sigma_factor)
        return
    factor = _join_factor(n_older, n_newer)
    for k in range(len(m)):
        m[k] = (older_p[k] + m[k]) * m_factor
    for k in range(len(m)):
        apart = n_newer * older_d[k] - n_older * newer_d[k]
        spread = older_s[k] + sigma[k] + apart * apart * factor
        sigma[k] = math.sqrt(spread * sigma_factor)


@compiled_step
def _copy(values: Array, copied: Array) -> None:
    for k in range(len(copied)):
        copied[k] = values[k]


@compiled_step
def _add(older: Array, newer: Array, total: Array) -> None:
    for k in range(len(total)):
        total[k] = older[k] + newer[k]


@compiled_step
def _pair(x: Array, p: Array, d: Array) -> None:
    """Compute P and D of the pair that begins at each sample."""
    for k in range(len(p)):
        p[k], d[k] = x[k] + x[k + 1], x[k] - x[k + 1]


@compiled_step
def _join(
    older_d: Array, older_s: Array, n_older: int, newer_d: Array, newer_s: Array, n_newer: int
) -> None:
    """Add D and S of older blocks to those of the newer pairs of each window."""
    # S = S_a + S_b + (b D_a - a D_b)^2 / (a b (a + b)), D = D_a + D_b.
    factor = _join_factor(n_older, n_newer)
    for k in range(len(newer_s)):
        apart = n_newer * older_d[k] - n_older * newer_d[k]
        newer_s[k] = older_s[k] + newer_s[k] + apart * apart * factor
        newer_d[k] = older_d[k] + newer_d[k]


@compiled_step
def _join_equal(
    older_d: Array, newer_d: Array, older_s: Array, newer_s: Array, size: int, joined: Array
) -> None:
    """Compute S of blocks of two equal halves."""
    # The same with a = b = n: (n D_a - n D_b)^2 / (2 n^3) = (D_a - D_b)^2 / (2 n).
    factor = 0.5 / size
    for k in range(len(joined)):
        apart = older_d[k] - newer_d[k]
        joined[k] = older_s[k] + newer_s[k] + apart * apart * factor


@compiled_step
def _join_pairs(older_d: Array, newer_d: Array, joined_d: Array, joined_s: Array) -> None:
    """Compute D and S of blocks of two pairs, whose own S are 0."""
    for k in range(len(joined_d)):
        older, newer = older_d[k], newer_d[k]
        joined_d[k] = older + newer
        joined_s[k] = (older - newer) * (older - newer) * 0.5


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
    """Append the blocks that end with a pair of a stream, by the sums of `haar_windows`.

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
    """Return m and sigma of the newest window of a stream, the same bits as `haar_windows`.

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


@compiled_parallel
def fill_features(force: Array, window: int, out: Array) -> None:
    """Fill (n, 6) `out` with the result of `haar_features`. The arguments are not checked."""
    out[: min(window - 1, len(out))] = math.nan
    for block in numba.prange(_n_blocks(len(out), window)):
        _fill_block(force, window, block, out)


@compiled
def fill_features_alone(force: Array, window: int, out: Array) -> None:
    """Do the same as `fill_features` in one thread."""
    out[: min(window - 1, len(out))] = math.nan
    for block in range(_n_blocks(len(out), window)):
        _fill_block(force, window, block, out)


@compiled_step
def _n_blocks(n: int, window: int) -> int:
    """Return the number of blocks that n samples have."""
    return max(n - window + _BLOCK_SAMPLES, 0) // _BLOCK_SAMPLES


@compiled
def _fill_block(force: Array, window: int, block: int, out: Array) -> None:
    """Fill the rows of a block of samples."""
    start = window - 1 + block * _BLOCK_SAMPLES
    stop = min(start + _BLOCK_SAMPLES, len(force))
    amplitude = np.empty(stop - start + window - 1)
    m, sigma = np.empty(stop - start), np.empty(stop - start)
    # Rows of whole cache lines, so that vectors are not written across two of them.
    scratch = np.empty((_SCRATCH_ROWS, (len(amplitude) + 7) // 8 * 8))
    # F_a of the window before the block, and of the block; then equations 1 and 2.
    _fill_amplitude(force, start - window + 1, window - 1, amplitude)
    _fill_force(force[start:stop], amplitude[window - 1 :], out[start:stop])
    haar_windows(amplitude, window, m, sigma, scratch)
    _fill_moments(m, sigma, out[start:stop])


@compiled_step
def _fill_amplitude(force: Array, first: int, n: int, amplitude: Array) -> None:
    """Fill F_a of n samples from `first` on."""
    for k in range(n):
        # F_a = |F_tip|.
        x, y, z = force[first + k, 0], force[first + k, 1], force[first + k, 2]
        amplitude[k] = math.sqrt(x * x + y * y + z * z)


@compiled_step
def _fill_force(force: Array, amplitude: Array, out: Array) -> None:
    """Fill F_a and the force of the rows of a block.

    The rows are written while the square roots are computed: the processor waits for both.
    """
    for k in range(len(out)):
        # F_a = |F_tip|.
        x, y, z = force[k, 0], force[k, 1], force[k, 2]
        amplitude[k] = math.sqrt(x * x + y * y + z * z)
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = amplitude[k], x, y, z


@compiled_step
def _fill_moments(m: Array, sigma: Array, out: Array) -> None:
    """Fill m and sigma of the rows of a block; NaN where a window is not finite."""
    all_finite = True
    for k in range(len(out)):
        out[k, 4], out[k, 5] = m[k], sigma[k]
        all_finite &= math.isfinite(m[k] + sigma[k])
    if not all_finite:
        for k in range(len(out)):
            if not math.isfinite(m[k] + sigma[k]):
                out[k, :] = math.nan
