"""Estimates in chunks, and what people get of them: a summary, and lines of the changes."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from math import isnan, nan
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

from holdfast.contact import (
    LASTING_DURATION,
    ContactEstimate,
    ContactEvent,
    ContactState,
    Fault,
    Reason,
    StateChanges,
)
from holdfast.detection import HAND, Detection
from holdfast.detection.slips import DetectedSlip, SlipWatch
from holdfast.live.fault_notices import FAULT_TEXTS
from holdfast.live.stream_detector import StreamEstimate
from holdfast.recordings import shown_origin

REASON_WORDS = {
    Reason.NONE: "",
    Reason.TARE: "taking the tare",
    Reason.WARM_UP: "too few samples yet",
    Reason.GAP: "gap in the samples",
    Reason.FAULT: "fault",
    Reason.LOAD: "load changes",
    Reason.HOLD: "hold time",
}
"""Words for the reason of UNKNOWN, and of UNSTABLE whatever the probability."""
CHANGES_HEADER = f"{'time':>9}    {'finger':14}  {'state':11}  why"
"""Header of the lines of `ChangeLines`, which fit into 80 columns."""


class EstimateChunk(NamedTuple):
    """Estimates of consecutive samples, oldest first.

    Attributes:
        name: of the recording or source.
        fingers: estimates of each finger.
        hand: time [s] and state of the hand at each instant.
    """

    name: str
    fingers: Mapping[str, Sequence[ContactEstimate]]
    hand: Sequence[tuple[float, ContactState]]


def chunk_from_detection(detection: Detection) -> EstimateChunk:
    """Convert the arrays of a detection."""
    states = tuple(ContactState)
    hand = zip(detection.times.tolist(), detection.hand.tolist(), strict=True)
    return EstimateChunk(
        detection.name,
        {finger: trace.estimates() for finger, trace in detection.fingers.items()},
        [(time, states[code]) for time, code in hand],
    )


def chunk_from_stream(name: str, estimates: Iterable[StreamEstimate]) -> EstimateChunk:
    """Collect the new estimates of a live source."""
    fingers: dict[str, list[ContactEstimate]] = {}
    hand = []
    for estimate, updated_fingers in estimates:
        hand.append((estimate.time, estimate.state))
        for finger in updated_fingers:
            fingers.setdefault(finger, []).append(estimate.fingers[finger])
    return EstimateChunk(name, fingers, hand)


class DetectionSummary:
    """Shares of states, counts of reasons and faults, the contact events, and the slips.

    Its memory grows only with the number of events and slips.

    Attributes:
        start: time of the first instant of the hand [s]; None before it.
    """

    def __init__(self) -> None:
        self._name = ""
        self._counts: dict[str, _StateCounts] = {}  # of each finger and of the hand
        self._changes = StateChanges()
        self._events: dict[str, list[ContactEvent]] = {}
        self.start: float | None = None
        self._watch = SlipWatch()
        self._ended_slips: list[DetectedSlip] = []  # `_watch` keeps only those that have not ended

    def add(self, chunk: EstimateChunk) -> None:
        """Add the next chunk of the same recording or source."""
        self._name = chunk.name
        if self.start is None and chunk.hand:
            self.start = chunk.hand[0][0]
        for finger, estimates in chunk.fingers.items():
            self._add_changes(finger, map(attrgetter("time", "state"), estimates))
            counts = self._counts.setdefault(finger, _StateCounts())
            counts.states.update(estimate.state for estimate in estimates)
            counts.reasons.update(estimate.reason for estimate in estimates if estimate.reason)
            counts.faults.update(chain.from_iterable(estimate.faults for estimate in estimates))
            slips = self._watch.update(finger, estimates)
            self._ended_slips += [slip for slip in slips if slip.end is not None]
        # The hand has instants of its own: those of all fingers, each once.
        self._add_changes(HAND, chunk.hand)
        self._counts.setdefault(HAND, _StateCounts()).states.update(
            state for _, state in chunk.hand
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the summary as JSON values; shares are of samples, or of instants (hand).

        Slips are null without a slip rule. A slip that has not ended has no end.
        """
        slips = [slip._asdict() for slip in self._sorted_slips()]
        shares = {name: counts.to_dict() for name, counts in self._counts.items()}
        hand = shares.pop(HAND)
        return {
            "name": self._name,
            "fingers": shares,
            "hand": {key: hand[key] for key in ("n_samples", "states")},
            "events": [event._asdict() for event in self._sorted_events()],
            "slips": slips if self._watch.has_rule else None,
        }

    def _add_changes(self, name: str, states: Iterable[tuple[float, ContactState]]) -> None:
        events = self._events.setdefault(name, [])
        for time, state in states:
            events += self._changes.update({name: state}, time)

    def _sorted_events(self) -> list[ContactEvent]:
        return sorted(chain.from_iterable(self._events.values()), key=attrgetter("time"))

    def _sorted_slips(self) -> list[DetectedSlip]:
        return sorted([*self._ended_slips, *self._watch.running], key=attrgetter("begin"))


class _StateCounts:
    """Number of samples with each state, reason and fault."""

    def __init__(self) -> None:
        self.states: Counter[ContactState] = Counter()
        self.reasons: Counter[Reason] = Counter()
        self.faults: Counter[Fault] = Counter()

    def to_dict(self) -> dict[str, Any]:
        n = self.states.total()
        return {
            "n_samples": n,
            "states": {state.value: self.states[state] / n if n else 0.0 for state in ContactState},
            "reasons": {x.value: self.reasons[x] for x in Reason if self.reasons[x]},
            "faults": {x.value: self.faults[x] for x in Fault if self.faults[x]},
        }


class ChangeLines:
    """Find the changes of each finger and of the hand that lasted, and slips, as lines of text.

    A change of the hand to the state that a finger gets at the same instant is in its line.

    Args:
        from_first: give times relative to the first sample. Without it, only times since 1970
            are given like that.
        hand_only: leave out slips, and changes that leave the hand as it is.

    Attributes:
        origin: time that is printed as 0 [s]; NaN before the first chunk.
    """

    def __init__(self, *, from_first: bool, hand_only: bool = False) -> None:
        self.origin = nan
        self._from_first = from_first
        self._hand_only = hand_only
        self._changes = StateChanges(LASTING_DURATION)
        # State of each finger, and why it began.
        self._why: dict[str, tuple[ContactState, str]] = {}
        self._watch = SlipWatch()

    def add(self, chunk: EstimateChunk) -> list[str]:
        """Return the lines for the next chunk of the same source, in the order of time."""
        if isnan(self.origin) and chunk.hand:
            first = chunk.hand[0][0]
            self.origin = first if self._from_first else shown_origin(first)
        # Names and reasons of each change: the hand last, beside the fingers that changed it.
        changes: dict[tuple[float, ContactState], list[tuple[str, str]]] = {}
        lines: list[tuple[float, str]] = []
        for finger, estimates in chunk.fingers.items():
            for estimate in estimates:
                # The reason at the change itself; later the state has lasted, and has another one.
                if self._why.get(finger, (None,))[0] is not estimate.state:
                    self._why[finger] = estimate.state, why(estimate)
                for event in self._changes.update({finger: estimate.state}, estimate.time):
                    named = finger, self._why[finger][1]
                    changes.setdefault((event.time, event.state), []).append(named)
            slips = self._watch.update(finger, estimates)
            lines += map(self._slip_line, () if self._hand_only else slips)
        for time, state in chunk.hand:
            for event in self._changes.update({HAND: state}, time):
                fingers = changes.setdefault((event.time, event.state), [])
                first_finger, reason = fingers[0] if fingers else ("", "")
                name = f"{first_finger}, {HAND}" if fingers else HAND
                fingers[:1] = [(name, reason)]
        for (time, state), named_changes in changes.items():
            for name, reason in named_changes:
                if not self._hand_only or name.endswith(HAND):
                    lines.append((time, self._text(time, name, state, reason)))
        lines.sort(key=itemgetter(0))
        return [line for _, line in lines]

    def _slip_line(self, slip: DetectedSlip) -> tuple[float, str]:
        """Return the time and the line of a slip that has just begun or ended."""
        percent = 100 * slip.max_probability
        if slip.end is None:
            text = self._text(slip.begin, slip.finger, "slip begins", f"P(slip) {percent:.0f} %")
            return slip.begin, text
        lasted = f"{slip.end - slip.begin:.3f} s, "
        lasted += "largest " if slip.distance is None else f"{slip.distance:.1f} mm, "
        text = f"{lasted}P(slip) {percent:.0f} %"
        return slip.end, self._text(slip.end, slip.finger, "slip ends", text)

    def _text(self, time: float, finger: str, change: str, reason: str) -> str:
        return f"{time - self.origin:9.3f} s  {finger:14}  {change:11}  {reason}".rstrip()


def why(estimate: ContactEstimate) -> str:
    """Return why a finger has its state, in a few words.

    Example:
        >>> why(ContactEstimate(1.0, ContactState.UNSTABLE, Reason.LOAD, 0.78, 178.0, (1, 0, 0)))
        'stable 78 %, load changes'
    """
    faults = ", ".join(FAULT_TEXTS[fault].words for fault in estimate.faults)
    if estimate.state is ContactState.UNKNOWN:
        return faults or REASON_WORDS[estimate.reason]
    if estimate.state is ContactState.NO_CONTACT:
        return faults
    stable = f"stable {100 * estimate.stable_probability:.0f} %"
    parts = (estimate.cause or "", stable, REASON_WORDS[estimate.reason], faults)
    return ", ".join(filter(None, parts))
