"""Output of `holdfast detect` on a terminal: one line for each change of state that lasted."""

from collections.abc import Iterator, Sequence
from math import isnan, nan

from holdfast.cli.detect_output import EstimateChunk
from holdfast.contact import (
    LASTING_DURATION,
    ContactEstimate,
    ContactEvent,
    ContactState,
    Reason,
    StateChanges,
)
from holdfast.detector import HAND
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


class ChangeLines:
    """Find the changes of each finger and of the hand that lasted, as lines of text.

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
        self._why: dict[str, tuple[ContactState, str]] = {}

    def add(self, chunk: EstimateChunk) -> list[str]:
        """Return the lines for the next chunk of the same source, in the order of time."""
        if isnan(self.origin) and chunk.hand:
            first = chunk.hand[0][0]
            self.origin = first if self._from_first else shown_origin(first)
        found: list[tuple[ContactEvent, str]] = []
        for finger, estimates in chunk.fingers.items():
            found += self._finger_changes(finger, estimates)
        for time, state in chunk.hand:
            found += [(event, "") for event in self._lasting(HAND, state, time)]
        return [self._line(*one) for one in sorted(found, key=lambda one: one[0].time)]

    def _finger_changes(
        self, finger: str, estimates: Sequence[ContactEstimate]
    ) -> Iterator[tuple[ContactEvent, str]]:
        for estimate in estimates:
            if self._why.get(finger, (None,))[0] is not estimate.state:
                self._why[finger] = estimate.state, why(estimate)
            for event in self._lasting(finger, estimate.state, estimate.time):
                yield event, self._why[finger][1]

    def _lasting(self, name: str, state: ContactState, time: float) -> list[ContactEvent]:
        changes = self._changes.setdefault(name, StateChanges([name], LASTING_DURATION))
        return changes.update([state], time)

    def _line(self, event: ContactEvent, reason: str) -> str:
        time = event.time - self.origin
        text = f"{time:9.3f} s  {event.finger:8}  {event.previous:10} -> {event.state:10}  {reason}"
        return text.rstrip()


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
