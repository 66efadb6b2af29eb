"""Labels as spans of one state: labels of the same state that touch are one span."""

from collections.abc import Iterable
from typing import Any, Literal

import msgspec

from holdfast.contact import ContactState
from holdfast.recordings import Label

State = Literal["no_contact", "unstable", "stable"]
"""A label's state as files and JSON spell it."""

ROUNDING = 1e-6
"""Times that differ by less [s] are equal."""


class Span(msgspec.Struct, frozen=True):
    """An interval of one state, [start, end) [s]."""

    start: float
    end: float
    state: State

    @property
    def code(self) -> int:
        """The code of its state."""
        return ContactState(self.state.upper()).code

    def overlap(self, other: "Span") -> float:
        """How long both last [s]; under 0 where they are apart."""
        return min(self.end, other.end) - max(self.start, other.start)


def state_name(state: ContactState) -> State:
    """The state as files and JSON spell it."""
    name: Any = state.value.lower()
    spelled: State = name
    return spelled


def spans_of(labels: Iterable[Label]) -> list[Span]:
    """Labels as spans, in order of time.

    Args:
        labels: without overlap.

    Example:
        >>> one, two = Label(1.0, 2.0, ContactState.STABLE), Label(0.0, 1.0, ContactState.STABLE)
        >>> spans_of([one, two])
        [Span(start=0.0, end=2.0, state='stable')]
    """
    spans: list[Span] = []
    for label in sorted(labels, key=lambda each: each.start):
        state = state_name(label.state)
        if spans and spans[-1].state == state and label.start - spans[-1].end <= ROUNDING:
            spans[-1] = Span(spans[-1].start, label.end, state)
        else:
            spans.append(Span(label.start, label.end, state))
    return spans
