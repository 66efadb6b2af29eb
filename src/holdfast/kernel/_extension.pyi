"""Functions in C. They release the GIL, and refuse anything but contiguous arrays of float64."""

import numpy as np
import numpy.typing as npt

SOURCES: str
"""The digest of the C files that this extension was built from."""

def haar_features(
    force: npt.NDArray[np.float64],
    window: int,
    first: int,
    stop: int,
    out: npt.NDArray[np.float64],
    /,
) -> None:
    """Fill rows first to stop of `out` (n, 6) with the features of a force (n, 3)."""

def fingertip_force(
    readings: npt.NDArray[np.float64],
    baseline: npt.NDArray[np.float64],
    rotations: npt.NDArray[np.float64],
    first: int,
    stop: int,
    out: npt.NDArray[np.float64],
    /,
) -> None:
    """Fill rows first to stop of `out` (n, 3) with the force of readings (n, n_taxels, 3)."""
