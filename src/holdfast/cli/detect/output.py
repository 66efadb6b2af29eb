"""Output of `holdfast detect`: JSON lines, a summary, or lines of changes, from estimates."""

import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import chain
from math import isnan, nan
from operator import attrgetter, itemgetter
from typing import Any

from msgspec.json import Encoder

from holdfast.cli.detect.estimates import EstimateChunk
from holdfast.cli.terminal.console import (
    print_json,
    print_line,
    print_message,
    print_table,
    visible_json,
)
from holdfast.contact import (
    LASTING_DURATION,
    ContactEstimate,
    ContactEvent,
    ContactState,
    Fault,
    Reason,
    StateChanges,
)
from holdfast.detector import HAND
from holdfast.detector.slips import DetectedSlip, SlipWatch
from holdfast.live.documents import estimate_line
from holdfast.live.fault_notices import FAULT_TEXTS
from holdfast.recordings import shown_origin

HEADER = f"{'time':>9}    {'finger':8}  {'from':10}    {'to':10}  why"
REASON_WORDS = {
    Reason.NONE: "",
    Reason.TARE: "taking the tare",
    Reason.WARM_UP: "too few samples yet",
    Reason.GAP: "gap in the samples",
    Reason.FAULT: "fault",
}
"""Words for the reason of UNKNOWN."""
LINES_PER_BLOCK = 8192
"""Number of lines that are encoded at a time: some 3 MB of text, of a chunk of all fingers."""
MAX_EVENTS_SHOWN = 40
"""Maximum number of events in the table; JSON has all of them."""


def json_lines(chunk: EstimateChunk) -> Iterator[str]:
    """Yield blocks of JSON lines, sorted by time and then in the order of the fingers."""
    lines = [
        estimate_line(finger, estimate)
        for finger, estimates in chunk.fingers.items()
        for estimate in estimates
    ]
    lines.sort(key=attrgetter("time"))  # each finger has times of its own
    encoder = Encoder()
    for start in range(0, len(lines), LINES_PER_BLOCK):
        # A list, because msgspec 0.22 leaks the items of an iterator.
        yield visible_json(encoder.encode_lines(lines[start : start + LINES_PER_BLOCK]).decode())


class DetectionSummary:
    """Shares of states, counts of reasons and faults, the contact events, and the slips.

    Its memory grows only with the number of events and slips.
    """

    def __init__(self) -> None:
        self._name = ""
        self._counts: dict[str, _StateCounts] = {}  # of each finger and of the hand
        self._changes: dict[str, StateChanges] = {}
        self._events: dict[str, list[ContactEvent]] = {}
        self._start: float | None = None  # time of the first instant of the hand [s]
        self._watch = SlipWatch()
        self._ended_slips: list[DetectedSlip] = []  # `_watch` keeps only those that have not ended

    def add(self, chunk: EstimateChunk) -> None:
        """Add the next chunk of the same recording or source."""
        self._name = chunk.name
        if self._start is None and chunk.hand:
            self._start = chunk.hand[0][0]
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

    def print(self) -> None:
        """Print tables of shares, of reasons and faults, and of the first events and slips."""
        names = [name for name in self._counts if name != HAND] + [HAND]
        states = (f"{state} %" for state in ContactState)
        print_table(
            (self._name, "samples", *states),
            [(name, *self._counts[name].shares()) for name in names],
        )
        print_line()
        print_table(
            ("finger", "reasons for UNKNOWN", "faults"),
            [(name, *self._counts[name].causes()) for name in names if name != HAND],
        )
        origin = shown_origin(self._start or 0.0)
        events = self._sorted_events()
        print_line()
        if origin:
            print_line(f"times since the first sample, at {origin:.3f} s")
        print_table(
            ("time [s]", "finger", "state", "previous"),
            [
                (f"{event.time - origin:.3f}", event.finger, event.state, event.previous)
                for event in events[:MAX_EVENTS_SHOWN]
            ],
        )
        if len(events) > MAX_EVENTS_SHOWN:
            print_line(f"and {len(events) - MAX_EVENTS_SHOWN} more events (--json prints all)")
        if self._watch.has_rule:
            self._print_slips(origin)

    def _print_slips(self, origin: float) -> None:
        slips = self._sorted_slips()
        print_line()
        if not slips:
            print_line("no slips")
            return
        rows = [
            (
                f"{slip.begin - origin:.3f}",
                "-" if slip.end is None else f"{slip.end - origin:.3f}",
                slip.finger,
                f"{100 * slip.max_probability:.0f}",
                "-" if slip.distance is None else f"{slip.distance:.1f}",
            )
            for slip in slips[:MAX_EVENTS_SHOWN]
        ]
        print_table(("slip from [s]", "to [s]", "finger", "largest P(slip) %", "slid [mm]"), rows)
        if len(slips) > MAX_EVENTS_SHOWN:
            print_line(f"and {len(slips) - MAX_EVENTS_SHOWN} more slips (--json prints all)")

    def _add_changes(self, name: str, states: Iterable[tuple[float, ContactState]]) -> None:
        changes = self._changes.setdefault(name, StateChanges((name,)))
        events = self._events.setdefault(name, [])
        for time, state in states:
            events += changes.update([state], time)

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

    def shares(self) -> tuple[object, ...]:
        """Return the number of samples and the share of each state as cells of a table."""
        counts = self.to_dict()
        return counts["n_samples"], *(f"{100 * share:.1f}" for share in counts["states"].values())

    def causes(self) -> tuple[str, str]:
        """Return the counts of reasons and of faults as cells of a table."""
        counts = self.to_dict()
        reasons, faults = (
            ", ".join(f"{name} {n}" for name, n in counts[key].items()) or "-"
            for key in ("reasons", "faults")
        )
        return reasons, faults


class ChangeLines:
    """Find the changes of each finger and of the hand that lasted, and slips, as lines of text.

    Args:
        from_first: give times relative to the first sample. Without it, only times since 1970
            are given like that.

    Attributes:
        origin: time that is printed as 0 [s]; NaN before the first chunk.
    """

    def __init__(self, *, from_first: bool) -> None:
        self.origin = nan
        self._from_first = from_first
        self._changes: dict[str, StateChanges] = {}
        # State of each finger, and why it began.
        self._why: dict[str, tuple[ContactState, str]] = {}
        self._watch = SlipWatch()

    def add(self, chunk: EstimateChunk) -> list[str]:
        """Return the lines for the next chunk of the same source, in the order of time."""
        if isnan(self.origin) and chunk.hand:
            first = chunk.hand[0][0]
            self.origin = first if self._from_first else shown_origin(first)
        lines: list[tuple[float, str]] = []
        for finger, estimates in chunk.fingers.items():
            for estimate in estimates:
                # The reason at the change, not that of the sample at which it has lasted.
                if self._why.get(finger, (None,))[0] is not estimate.state:
                    self._why[finger] = estimate.state, why(estimate)
                events = self._lasting(finger, estimate.state, estimate.time)
                lines += [self._line(event, self._why[finger][1]) for event in events]
            lines += map(self._slip_line, self._watch.update(finger, estimates))
        for time, state in chunk.hand:
            lines += [self._line(event, "") for event in self._lasting(HAND, state, time)]
        lines.sort(key=itemgetter(0))
        return [line for _, line in lines]

    def _lasting(self, name: str, state: ContactState, time: float) -> list[ContactEvent]:
        changes = self._changes.setdefault(name, StateChanges([name], LASTING_DURATION))
        return changes.update([state], time)

    def _line(self, event: ContactEvent, reason: str) -> tuple[float, str]:
        change = f"{event.previous:10} -> {event.state:10}"
        return event.time, self._text(event.time, event.finger, change, reason)

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
        return f"{time - self.origin:9.3f} s  {finger:8}  {change:24}  {reason}".rstrip()


def why(estimate: ContactEstimate) -> str:
    """Return why a finger has its state, in a few words.

    Example:
        >>> why(ContactEstimate(1.0, ContactState.UNSTABLE, Reason.NONE, 0.08, 178.0, (1, 0, 0)))
        'P(stable) 8 %, sigma 178'
    """
    if estimate.state is ContactState.UNKNOWN:
        faults = ", ".join(FAULT_TEXTS[fault].words for fault in estimate.faults)
        return faults or REASON_WORDS[estimate.reason]
    if estimate.state is ContactState.NO_CONTACT:
        return ""
    percent = 100 * estimate.stable_probability
    cause = f"{estimate.cause}, " if estimate.cause else ""
    return f"{cause}P(stable) {percent:.0f} %, sigma {estimate.instability:.4g}"


def print_estimates(chunks: Iterator[EstimateChunk], *, live: bool) -> None:
    """Print JSON lines: of a live source each chunk at once."""
    for chunk in chunks:
        for text in json_lines(chunk):
            sys.stdout.write(text)
        if live:
            sys.stdout.flush()  # a program that reads the pipe acts on each estimate


def print_changes(chunks: Iterator[EstimateChunk], *, live: bool) -> None:
    """Print the changes that lasted: of a live source at once, else below the progress bar."""
    changes = ChangeLines(from_first=live)
    if live:
        print_message("times since the first sample; --json prints every estimate; Ctrl-C stops")
        print_line(HEADER)
        for chunk in chunks:
            for line in changes.add(chunk):
                print_line(line)
                sys.stdout.flush()
        return
    lines = [line for chunk in chunks for line in changes.add(chunk)]
    if changes.origin:
        print_message(f"times since the first sample, at {changes.origin:.3f} s")
    for line in (HEADER, *lines):
        print_line(line)


def print_summary(chunks: Iterator[EstimateChunk], model: str, *, as_json: bool) -> None:
    """Print the summary of all chunks."""
    summary = DetectionSummary()
    for chunk in chunks:
        summary.add(chunk)
    if as_json:
        print_json({"model": model, **summary.to_dict()})
    else:
        summary.print()
