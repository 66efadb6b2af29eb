"""Labels as spans of one state, and labels of low confidence."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import msgspec

from holdfast.contact import TIME_TOLERANCE, ContactState
from holdfast.recordings import Label

State = Literal["no_contact", "unstable", "stable"]
"""State of a label as files and JSON write it."""


class Span(msgspec.Struct, frozen=True):
    """Interval of one state, [start, end) [s]."""

    start: float
    end: float
    state: State

    @property
    def code(self) -> int:
        """Code of the state."""
        return ContactState(self.state.upper()).code

    def overlap(self, other: "Span") -> float:
        """Return the duration that both have in common [s]; below 0 if they are apart."""
        return min(self.end, other.end) - max(self.start, other.start)


def state_name(state: ContactState) -> State:
    """Return a state as files and JSON write it."""
    name: Any = state.value.lower()
    spelled: State = name
    return spelled


def spans_of(labels: Iterable[Label]) -> list[Span]:
    """Return labels as spans in order of time; adjacent labels of one state become one span.

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
        if spans and spans[-1].state == state and label.start - spans[-1].end <= TIME_TOLERANCE:
            spans[-1] = Span(spans[-1].start, label.end, state)
        else:
            spans.append(Span(label.start, label.end, state))
    return spans


def doubtful(labels: Mapping[str, Sequence[Label]], below: float = 0.8) -> list[tuple[str, Label]]:
    """Return the labels of low confidence, lowest first, for a person to check.

    Among labels of equal confidence the longest comes first, because its error would cost most.

    Args:
        labels: by finger.
        below: labels with a confidence below this are returned, from 0 to 1.

    Returns:
        Pairs of finger and label.

    Raises:
        ValueError: `below` is not from 0 to 1.

    Example:
        >>> sure, unsure = (Label(0, 1, "STABLE", confidence=c) for c in (0.9, 0.4))
        >>> [(finger, label.confidence) for finger, label in doubtful({"thumb": (sure, unsure)})]
        [('thumb', 0.4)]
    """
    if not 0 <= below <= 1:
        raise ValueError(f"a confidence from 0 to 1 expected, {below} given")
    found = [
        (finger, label)
        for finger, intervals in labels.items()
        for label in intervals
        if label.confidence < below
    ]
    return sorted(
        found, key=lambda at: (at[1].confidence, at[1].start - at[1].end, at[1].start, at[0])
    )
