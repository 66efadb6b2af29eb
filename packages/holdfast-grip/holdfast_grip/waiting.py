"""What a grip controller waits for before the grip begins, in words."""

import math

from holdfast.contact import ContactState, HandEstimate

HUMAN_FINGERS = ("index", "middle", "ring", "little")
"""Fingers whose names need the word finger in a sentence."""
NO_SAMPLES = "no finger has sent a sample"
NO_TOUCH = "no finger touches an object"
MUST_LAST = "the hand is stable, which must last"
"""Conditions of the hand as a whole."""


class GripWait:
    """Conditions that a hand does not meet yet, and for how long.

    Example:
        >>> wait = GripWait(min_fingers=2)
        >>> wait.text
        'no finger has sent a sample'
    """

    def __init__(self, min_fingers: int) -> None:
        self._min_fingers = min_fingers
        self.reset()

    def reset(self) -> None:
        """Forget all conditions."""
        self._begun: dict[str, float] = {}
        self._time = math.nan

    @property
    def text(self) -> str:
        """Conditions with the seconds for which each one lasts, the longest first."""
        begun, time = self._begun, self._time  # both are replaced, in another thread
        longest_first = sorted(begun.items(), key=lambda condition: condition[1])
        parts = [
            f"{words}: {int(time - since)} s" if time - since >= 1.0 else words
            for words, since in longest_first
        ]
        return "; ".join(parts) or NO_SAMPLES

    def update(self, estimate: HandEstimate, time: float) -> None:
        """Follow an estimate of a hand that does not hold yet, at a time [s]."""
        if not math.isfinite(time):
            return
        before = self._begun
        self._begun = {
            # The smaller one, where the clock went back.
            words: min(before.get(words, time), time)
            for words in self._conditions(estimate)
        }
        self._time = time

    def _conditions(self, estimate: HandEstimate) -> list[str]:
        """Return in words what keeps the grip from beginning."""
        if not estimate.fingers:
            return []
        touching = [
            name
            for name, finger in estimate.fingers.items()
            if finger.state in (ContactState.STABLE, ContactState.UNSTABLE)
        ]
        conditions = [
            f"{_named(name)} {_WORDS[finger.state]}"
            for name, finger in estimate.fingers.items()
            if finger.state in _WORDS
        ]
        if len(touching) == 1 < min(self._min_fingers, len(estimate.fingers)):
            conditions.append(f"only {_named(touching[0])} touches an object")
        if not touching and not conditions:
            return [NO_TOUCH]
        return conditions or [MUST_LAST]


_WORDS = {ContactState.UNKNOWN: "has no estimate", ContactState.UNSTABLE: "is not stable"}


def _named(finger: str) -> str:
    """Return the name of a finger as it stands in a sentence."""
    if finger in HUMAN_FINGERS:
        return f"the {finger} finger"
    return "the thumb" if finger == "thumb" else finger
