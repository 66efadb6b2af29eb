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

LANES: int
"""Partial sums of a sum over taxels; arrays of taxels are padded to a multiple of it."""

class Stream:
    """The feature stream of a hand; see `kernel.h`. It cannot be copied or pickled.

    A call while another thread is inside one raises RuntimeError.
    """

    def __new__(
        cls,
        hand: dict[str, object],
        fingers: list[dict[str, object]],
        features: list[dict[str, object]],
        lags: list[dict[str, object]],
        used: npt.NDArray[np.float64],
        rotations: npt.NDArray[np.float64],
        places: npt.NDArray[np.float64],
        baseline: npt.NDArray[np.float64],
        /,
    ) -> Stream: ...
    def advance(
        self,
        readings: npt.NDArray[np.float64],
        present: npt.NDArray[np.bool_],
        times: npt.NDArray[np.float64],
        features: npt.NDArray[np.float64],
        amplitude: npt.NDArray[np.float64],
        /,
    ) -> None:
        """Process n samples, and fill `features` and `amplitude` of each of them."""
