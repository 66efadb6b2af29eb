"""Shares of states, reasons and faults, and the events, over a stream of detections."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from msgspec.json import Encoder

from holdfast.cli.terminal.console import print_table, show
from holdfast.contact import (
    ContactEvent,
    ContactState,
    Fault,
    Reason,
    StateChanges,
    faults_of,
    taxels_of,
)
from holdfast.detector import HAND

if TYPE_CHECKING:
    from holdfast.detector import Detection
    from holdfast.sensors.types import Array

STATES, REASONS, FAULTS = tuple(ContactState), tuple(Reason), tuple(Fault)
MOST_EVENTS = 40
"""Events that are shown to a person."""

_Codes = npt.NDArray[np.int8 | np.int16]
_Numbers = npt.NDArray[np.int64]


class Tally:
    """What a model says of a recording, in short; it grows by the events only."""

    def __init__(self) -> None:
        self._name = ""
        self._counts: dict[str, _Counts] = {}
        self._changes: dict[str, StateChanges] = {}
        self._found: dict[str, list[ContactEvent]] = {}

    def add(self, detection: "Detection") -> None:
        """Takes the next piece."""
        self._name = detection.name
        for name, trace in detection.fingers.items():
            self._count(name, trace.state, trace.reason, trace.faults)
            self._change(name, trace.times, trace.state)
        self._count(HAND, detection.hand)
        self._change(HAND, detection.times, detection.hand)

    def document(self) -> dict[str, Any]:
        """All of it, as JSON has it: shares are of samples, or of instants for the hand."""
        shares = {name: counts.document() for name, counts in self._counts.items()}
        hand = shares.pop(HAND)
        return {
            "name": self._name,
            "fingers": shares,
            "hand": {key: hand[key] for key in ("n_samples", "states")},
            "events": [event._asdict() for event in self._events()],
        }

    def print(self) -> None:
        """All of it for a person; of many events the first."""
        names = [name for name in self._counts if name != HAND] + [HAND]
        print_table(
            (self._name, "samples", *(f"{state} %" for state in STATES), "unknown for", "faults"),
            [(name, *self._counts[name].row()) for name in names],
        )
        events = self._events()
        show()
        print_table(
            ("time [s]", "finger", "state", "before"),
            [(f"{e.time:.3f}", e.finger, e.state, e.previous) for e in events[:MOST_EVENTS]],
        )
        if len(events) > MOST_EVENTS:
            show(f"and {len(events) - MOST_EVENTS} more events (--json has them all)")

    def _count(self, name: str, states: _Codes, *causes: _Codes) -> None:
        counts = self._counts.setdefault(name, _Counts.none())
        counts.states += np.bincount(states, minlength=len(STATES))
        if causes:
            reasons, faults = causes
            counts.reasons += np.bincount(reasons, minlength=len(REASONS))
            counts.faults += (faults[:, None] >> np.arange(len(FAULTS)) & 1).sum(axis=0)

    def _change(self, name: str, times: "Array", states: _Codes) -> None:
        changes = self._changes.setdefault(name, StateChanges((name,)))
        self._found.setdefault(name, []).extend(changes.update_chunk(times, states[:, None]))

    def _events(self) -> list[ContactEvent]:
        events = [event for found in self._found.values() for event in found]
        return sorted(events, key=lambda event: event.time)


@dataclass
class _Counts:
    """How many samples had which state, reason and fault."""

    states: _Numbers
    reasons: _Numbers
    faults: _Numbers

    @classmethod
    def none(cls) -> "_Counts":
        return cls(*(np.zeros(len(all_), dtype=np.int64) for all_ in (STATES, REASONS, FAULTS)))

    def document(self) -> dict[str, Any]:
        n = int(self.states.sum())
        return {
            "n_samples": n,
            "states": {s.value: k / n for s, k in zip(STATES, self.states.tolist(), strict=True)},
            "reasons": _some(REASONS[1:], self.reasons[1:]),
            "faults": _some(FAULTS, self.faults),
        }

    def row(self) -> tuple[object, ...]:
        n = int(self.states.sum())
        shares = (f"{100 * k / n:.1f}" for k in self.states.tolist())
        return n, *shares, _text(REASONS[1:], self.reasons[1:]), _text(FAULTS, self.faults)


def _some(names: "tuple[Reason, ...] | tuple[Fault, ...]", counts: _Numbers) -> dict[str, int]:
    return {name.value: k for name, k in zip(names, counts.tolist(), strict=True) if k}


def _text(names: "tuple[Reason, ...] | tuple[Fault, ...]", counts: _Numbers) -> str:
    return ", ".join(f"{name} {k}" for name, k in _some(names, counts).items()) or "-"


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
