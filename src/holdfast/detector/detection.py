"""Estimates of a whole recording, as arrays."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.cause import CAUSES
from holdfast.contact import (
    Cause,
    ContactEstimate,
    ContactState,
    Fault,
    Reason,
    faults_of,
    taxels_of,
)
from holdfast.detector.decision_rule import TraceRows
from holdfast.detector.fast_step import split_code
from holdfast.features.arrays import SIGMA
from holdfast.sensors.types import Array

STATES = tuple(ContactState)
REASONS = tuple(Reason)
CAUSES_BY_CODE: tuple[Cause | None, ...] = (None, *CAUSES)


Decision = tuple[ContactState, Reason, tuple[Fault, ...], Cause | None]


def decision_of(code: float) -> Decision:
    """Return state, reason, faults and cause of a code that the kernel reports."""
    state, reason, faults, cause = split_code(int(code))
    return STATES[state], REASONS[reason], faults_of(faults), CAUSES_BY_CODE[cause]


class FingerTrace(NamedTuple):
    """Estimates of one finger over a recording: one row for each sample of its module.

    Attributes:
        times: (n,) [s].
        state: (n,) codes of `ContactState`.
        reason: (n,) codes of `Reason`.
        stable_probability: (n,); NaN while UNKNOWN.
        instability: (n,) sigma [unit of the readings].
        force: (n, 3) F_tip in the fingertip frame [unit of the readings].
        faults: (n,) bits in the order of `Fault`.
        faulty_taxels: (n,) bit i is set if the taxel at index i is faulty by itself.
        cause: (n,) codes of the causes while UNSTABLE: 1 is the first of `Cause`; 0 for none.
        slip_probability: (n,); NaN while UNKNOWN. None for a model without a slip rule.
    """

    times: Array
    state: npt.NDArray[np.int8]
    reason: npt.NDArray[np.int8]
    stable_probability: Array
    instability: Array
    force: Array
    faults: npt.NDArray[np.int16]
    faulty_taxels: npt.NDArray[np.int64]
    cause: npt.NDArray[np.int8]
    slip_probability: Array | None = None

    def __len__(self) -> int:
        return len(self.times)

    def estimate(self, k: int) -> ContactEstimate:
        """Return the estimate of sample k."""
        return self.estimates(slice(k, k + 1 or None))[0]

    def estimates(self, rows: slice = slice(None)) -> list[ContactEstimate]:
        """Return the estimates of these samples."""
        return list(
            map(
                ContactEstimate,
                self.times[rows].tolist(),
                [STATES[code] for code in self.state[rows].tolist()],
                [REASONS[code] for code in self.reason[rows].tolist()],
                self.stable_probability[rows].tolist(),
                self.instability[rows].tolist(),
                map(tuple, self.force[rows].tolist()),
                map(faults_of, self.faults[rows].tolist()),
                map(taxels_of, self.faulty_taxels[rows].tolist()),
                [CAUSES_BY_CODE[code] for code in self.cause[rows].tolist()],
                self._slips(rows),
            )
        )

    def _slips(self, rows: slice) -> Iterable[float | None]:
        if self.slip_probability is None:
            return repeat(None)
        slips: list[float] = self.slip_probability[rows].tolist()
        return slips


@dataclass(frozen=True)
class Detection:
    """Estimates of a whole recording.

    Attributes:
        name: of the recording.
        fingers: trace of each finger that the recording has.
        times: (n,) instants at which any finger had a sample [s].
        hand: (n,) codes of the hand's state at those instants.
    """

    name: str
    fingers: Mapping[str, FingerTrace]
    times: Array
    hand: npt.NDArray[np.int8]


def detection_of(
    name: str,
    fingers: Sequence[str],
    chunks: Sequence[tuple[Array, npt.NDArray[np.bool_], TraceRows]],
    *,
    has_slips: bool = False,
) -> Detection:
    """Join the chunks that the compiled rule filled.

    Args:
        name: of the recording.
        fingers: in the order of the columns.
        chunks: times, present fingers and rows of each chunk.
        has_slips: whether the model has a slip rule.
    """
    if not chunks:
        return Detection(name, {}, np.empty(0), np.empty(0, dtype=np.int8))
    rows = TraceRows(*(np.concatenate(x) for x in zip(*(c[2] for c in chunks), strict=True)))
    times = np.concatenate([chunk[0] for chunk in chunks])
    present = np.concatenate([chunk[1] for chunk in chunks])
    found = {}
    for place, finger in enumerate(fingers):
        own = present[:, place]
        if own.any():
            found[finger] = FingerTrace(
                times[own],
                rows.state[own, place],
                rows.reason[own, place],
                rows.probability[own, place],
                rows.values[own, place, SIGMA],
                rows.values[own, place, :3],
                rows.faults[own, place],
                rows.taxels[own, place],
                rows.cause[own, place],
                rows.slip[own, place] if has_slips else None,
            )
    return Detection(name, found, times, rows.hand)
