"""Functions in C. Those of arrays release the GIL, and refuse all but contiguous float64."""

from collections.abc import Callable, Iterator

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import ContactEstimate, HandEstimate

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

def parse_counts(text: bytes | msgspec.Raw, integers: bytes | msgspec.Raw, /) -> bytearray | None:
    """Return the counts (uint16) of the two forms of a sensor; None for unusual or other ones."""

LANES: int
"""Partial sums of a sum over taxels; arrays of taxels are padded to a multiple of it."""

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

class Estimates:
    """Estimates of the fingers of a hand, by name; a `Detector` makes them."""

    def __getitem__(self, name: str, /) -> ContactEstimate: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[str]: ...

class Detector:
    """The detector of a hand; see `detector.h`. It cannot be copied or pickled.

    A call while another thread is inside one raises RuntimeError.
    """

    def __new__(
        cls,
        stream: tuple[object, ...],
        model: dict[str, object],
        rules: list[dict[str, object]],
        heads: list[dict[str, object]],
        weights: npt.NDArray[np.float64],
        makers: tuple[object, ...],
        array_type: type,
        note: Callable[[tuple[float, bytes, bytes]], None],
        /,
    ) -> Detector: ...
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
        """Process n samples. Fill (n, n_fingers, 12) C structs and (n,) states of the hand."""

    def set_rules(
        self,
        rules: list[dict[str, object]],
        heads: list[dict[str, object]],
        weights: npt.NDArray[np.float64],
        /,
    ) -> None:
        """Change rules and heads from the next sample on."""

    def baselines(self, out: npt.NDArray[np.float64], /) -> list[bool]:
        """Fill (n_taxels, 3) with the tare, and return whether that of each finger is complete."""

    def last_time(self) -> float:
        """Return the time of the newest sample [s]; -infinity before the first."""
