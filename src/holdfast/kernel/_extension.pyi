"""Functions in C. Those of arrays release the GIL, and refuse all but contiguous float64."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from holdfast.contact import ContactEstimate, HandEstimate

SOURCES: str
"""The digest of the C files that this extension was built from."""

def haar_features(
    force: npt.NDArray[np.float64],
    out: npt.NDArray[np.float64],
    first: int,
    stop: int,
    window: int,
    /,
) -> None:
    """Fill rows first to stop of `out` (n, 6) with the features of a force (n, 3)."""

def fingertip_force(
    readings: npt.NDArray[np.float64],
    baseline: npt.NDArray[np.float64],
    rotations: npt.NDArray[np.float64],
    out: npt.NDArray[np.float64],
    first: int,
    stop: int,
    /,
) -> None:
    """Fill rows first to stop of `out` (n, 3) with the force of readings (n, n_taxels, 3)."""

LANES: int
"""Partial sums of a sum over taxels; arrays of taxels are padded to a multiple of it."""
N_COMPONENTS: int
"""Values with a Haar window: F_a, and the components of F_tip."""
ALWAYS_CONTACT: int
CONTACT_BY_FORCE: int
CONTACT_BY_NOISE: int
CONTACT_BY_LOAD: int
GAP_LIMIT_PERIODS: float
"""A step in time of more sample periods is a gap."""
MAX_BRIDGED_SECONDS: float
"""Longest gap that windows in seconds bridge [s]."""
MAX_DEVIATION: float
"""Squares are of values of at most this many standard deviations."""

def logistic(values: npt.NDArray[np.float64], /) -> None:
    """Replace log odds (n,) by probabilities, with the bits of the detector."""

def replay(
    times: npt.NDArray[np.float64],
    probability: npt.NDArray[np.float64],
    raw: npt.NDArray[np.int8],
    limits: npt.NDArray[np.float64],
    out: npt.NDArray[np.int8],
    /,
) -> None:
    """Fill (n,) states of a finger from its probability of stability; see `training.thresholds`."""

class Stream:
    """The feature stream of a hand; see `holdfast.h`. It cannot be copied or pickled.

    A call while another thread is inside one raises RuntimeError.
    """

    def __new__(cls, *arguments: bytes) -> Stream:
        """Return the stream of the bytes of a `StreamConfig`, and of a baseline (n_taxels, 3)."""

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

class Estimates:
    """Estimates of the fingers of a hand, by name; a `Detector` makes them."""

    def __getitem__(self, name: str, /) -> ContactEstimate: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[str]: ...

class Detector:
    """The detector of a hand; see `holdfast.h`. It cannot be copied or pickled.

    A call while another thread is inside one raises RuntimeError.
    """

    def __new__(cls, *arguments: object) -> Detector:
        """Return the detector of the eight arguments of a `Stream`, and of four others.

        They are the bytes of a `ModelConfig`, and an object with the names of `EstimateTypes`.
        """

    def update(self, samples: object, time: float, /) -> HandEstimate | None:
        """Return the estimate; None for samples or a time that Python converts or refuses."""

    def step(
        self, readings: npt.NDArray[np.float64], present: npt.NDArray[np.bool_], time: float, /
    ) -> HandEstimate:
        """Return the estimate of a sample (n_taxels, 3) of the fingers that are present."""

    def run(
        self,
        readings: npt.NDArray[np.float64],
        present: npt.NDArray[np.bool_],
        times: npt.NDArray[np.float64],
        estimates: npt.NDArray[np.float64],
        hand: npt.NDArray[np.float64],
        /,
    ) -> None:
        """Process n samples; fill (n, n_fingers) structs, as float64, and (n,) hand states."""

    def set_rules(self, rules: bytes, weights: bytes, /) -> None:
        """Change rules and heads from the next sample on."""

    def baselines(self, out: npt.NDArray[np.float64], /) -> tuple[bool, ...]:
        """Fill (n_taxels, 3) with the tare, and return whether that of each finger is complete."""

    def last_time(self) -> float:
        """Return the time of the newest sample [s]; -infinity before the first."""
