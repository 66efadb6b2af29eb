"""The Haar window: the paper's features of whole arrays (in C, `kernel/haar.c`)."""

import numpy as np
import numpy.typing as npt

from holdfast.kernel.batch import fill_haar_features

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


def n_levels(window: int) -> int:
    """Return the number of sizes of blocks in windows up to this one."""
    return (window // 2).bit_length()
