"""What a detector said of a recording, as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import (
    SIGNAL_FAULTS,
    ContactEstimate,
    ContactState,
    Fault,
    Reason,
    faults_of,
    taxels_of,
)
from holdfast.detector.rule import Traces, verdict_code
from holdfast.features.arrays import SIGMA, Array

STATES = tuple(ContactState)
REASONS = tuple(Reason)
VERDICTS: dict[float, tuple[ContactState, Reason, tuple[Fault, ...]]] = {
    verdict_code(state.code, reason, mask): (state, REASONS[reason], faults_of(mask))
    for state in STATES
    for reason in range(len(REASONS))
    for mask in range(1 << len(SIGNAL_FAULTS))
}
"""State, reason and faults by their common code."""


class FingerTrace(NamedTuple):
    """What was decided of one finger over a recording: one row a sample of its module.

    Attributes:
        times: (n,) [s].
        state: (n,) codes of `ContactState`.
        reason: (n,) codes of `Reason`.
        stable_probability: (n,); NaN while UNKNOWN.
        instability: (n,) sigma, in the unit of the readings.
        force: (n, 3) in the fingertip frame, in the unit of the readings.
        faults: (n,) bits in the order of `Fault`.
        faulty_taxels: (n,) bit i is taxel i, of those at fault by themselves.
    """

    times: Array
    state: npt.NDArray[np.int8]
    reason: npt.NDArray[np.int8]
    stable_probability: Array
    instability: Array
    force: Array
    faults: npt.NDArray[np.int16]
    faulty_taxels: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.times)

    def estimate(self, k: int) -> ContactEstimate:
        """The estimate of sample k."""
        return ContactEstimate(
            float(self.times[k]),
            STATES[self.state[k]],
            REASONS[self.reason[k]],
            float(self.stable_probability[k]),
            float(self.instability[k]),
            tuple(self.force[k].tolist()),
            faults_of(int(self.faults[k])),
            taxels_of(int(self.faulty_taxels[k])),
        )


@dataclass(frozen=True)
class Detection:
    """What a model says of a whole recording.

    Attributes:
        name: of the recording.
        fingers: of each finger that the recording has.
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
    pieces: Sequence[tuple[Array, npt.NDArray[np.bool_], Traces]],
) -> Detection:
    """Puts together what the kernel filled: (times, present, traces) a piece, or no piece."""
    if not pieces:
        return Detection(name, {}, np.empty(0), np.empty(0, dtype=np.int8))
    traces = Traces(*(np.concatenate(parts) for parts in zip(*(p[2] for p in pieces), strict=True)))
    times = np.concatenate([piece[0] for piece in pieces])
    present = np.concatenate([piece[1] for piece in pieces])
    found = {}
    for place, finger in enumerate(fingers):
        rows = present[:, place]
        if rows.any():
            found[finger] = FingerTrace(
                times[rows],
                traces.state[rows, place],
                traces.reason[rows, place],
                traces.probability[rows, place],
                traces.values[rows, place, SIGMA],
                traces.values[rows, place, :3],
                traces.faults[rows, place],
                traces.taxels[rows, place],
            )
    return Detection(name, found, times, traces.hand)
