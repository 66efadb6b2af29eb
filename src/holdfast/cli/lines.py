"""Estimates as JSON lines, fast."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct
from msgspec.json import Encoder

from holdfast.contact import ContactState, Reason, faults_of, taxels_of

if TYPE_CHECKING:
    from holdfast.detector import Detection

BLOCK = 8192
"""Lines that are made at a time."""

_STATES = [state.value for state in ContactState]
_REASONS = [reason.value for reason in Reason]


class Line(Struct, gc=False):
    """What is printed of one finger at one sample; what is NaN becomes null."""

    time: float
    finger: str
    state: str
    reason: str
    stable_probability: float
    instability: float
    force: list[float]
    faults: tuple[str, ...]
    faulty_taxels: tuple[int, ...]


def json_lines(detection: "Detection") -> Iterator[str]:
    """Blocks of lines, one a finger and sample, in the order of time and then of fingers."""
    names = list(detection.fingers)
    traces = list(detection.fingers.values())
    if not traces:
        return
    which = np.repeat(np.arange(len(names)), [len(trace) for trace in traces])
    times, state, reason, probability, sigma, force, faults, taxels = (
        np.concatenate(column) for column in zip(*traces, strict=True)
    )
    order = np.argsort(times, kind="stable")
    encoder = Encoder()
    for start in range(0, len(order), BLOCK):
        rows = order[start : start + BLOCK]
        lines = map(  # a list, since msgspec 0.22 leaks what an iterator gives it
            Line,
            times[rows].tolist(),
            [names[k] for k in which[rows].tolist()],
            [_STATES[k] for k in state[rows].tolist()],
            [_REASONS[k] for k in reason[rows].tolist()],
            probability[rows].tolist(),
            sigma[rows].tolist(),
            force[rows].tolist(),
            [faults_of(mask) for mask in faults[rows].tolist()],
            [taxels_of(mask) for mask in taxels[rows].tolist()],
        )
        yield encoder.encode_lines(list(lines)).decode()
