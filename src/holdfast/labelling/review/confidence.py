"""Labels of low confidence, for a person to check."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from holdfast.contact import ContactState
from holdfast.recordings import Label

State = Literal["no_contact", "unstable", "stable"]
"""State of a label as files and JSON write it."""


def state_name(state: ContactState) -> State:
    """Return a state as files and JSON write it."""
    name: Any = state.value.lower()
    spelled: State = name
    return spelled


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
    unsure = [
        (finger, label)
        for finger, intervals in labels.items()
        for label in intervals
        if label.confidence < below
    ]
    return sorted(
        unsure, key=lambda at: (at[1].confidence, at[1].start - at[1].end, at[1].start, at[0])
    )
