"""What was said live, as what is said of a recording: one form for all that prints or counts."""

from collections.abc import Sequence

import numpy as np

from holdfast.contact import ContactEstimate, Fault, Reason
from holdfast.detector import Detection, FingerTrace
from holdfast.live.stream_detector import StreamEstimate

REASONS = tuple(Reason)
FAULTS = tuple(Fault)


def detection_of(name: str, decisions: Sequence[StreamEstimate]) -> Detection:
    """What was decided, as a detection.

    Args:
        name: of the source.
        decisions: oldest first.

    Returns:
        One row of a finger for each decision that tells of it.
    """
    rows: dict[str, list[ContactEstimate]] = {}
    for estimate, fingers in decisions:
        for finger in fingers:
            rows.setdefault(finger, []).append(estimate.fingers[finger])
    return Detection(
        name,
        {finger: _trace(estimates) for finger, estimates in rows.items()},
        np.array([decision.estimate.time for decision in decisions]),
        np.array([decision.estimate.state.code for decision in decisions], dtype=np.int8),
    )


def _trace(estimates: list[ContactEstimate]) -> FingerTrace:
    return FingerTrace(
        times=np.array([one.time for one in estimates]),
        state=np.array([one.state.code for one in estimates], dtype=np.int8),
        reason=np.array([REASONS.index(one.reason) for one in estimates], dtype=np.int8),
        stable_probability=np.array([one.stable_probability for one in estimates]),
        instability=np.array([one.instability for one in estimates]),
        force=np.array([one.force for one in estimates]),
        faults=np.array([_mask(one.faults) for one in estimates], dtype=np.int16),
        faulty_taxels=np.array([_bits(one.faulty_taxels) for one in estimates]),
    )


def _mask(faults: tuple[Fault, ...]) -> int:
    return sum(1 << FAULTS.index(fault) for fault in faults)


def _bits(taxels: tuple[int, ...]) -> int:
    return sum(1 << taxel for taxel in taxels)
