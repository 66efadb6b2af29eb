"""Changes of contact states that lasted, without flicker: for people, not for control."""

import math
from collections.abc import Sequence

from holdfast.contact import ContactEvent, ContactState
from holdfast.metrics.events import TIME_TOLERANCE

DEFAULT_DURATION = 0.1
"""Minimum time that a new state must last [s]."""


class LastingChanges:
    """Memory of several contact states that reports only changes that lasted.

    A change is reported when the new state has lasted `min_duration`, with the time at which it
    began. A state that returns earlier is no change. All states begin as UNKNOWN.

    Args:
        names: of the fingers, in the order of the states.
        min_duration: minimum time that a new state must last [s].

    Raises:
        ValueError: the duration is negative or not finite.

    Example:
        >>> changes = LastingChanges(["thumb"], min_duration=0.2)
        >>> stable, unstable = [ContactState.STABLE], [ContactState.UNSTABLE]
        >>> changes.update(stable, 0.0), changes.update(unstable, 0.1)
        ([], [])
        >>> changes.update(stable, 0.15), changes.update(stable, 0.25)
        ([], [])
        >>> (change,) = changes.update(stable, 0.35)
        >>> change.state.value, change.previous.value, change.time
        ('STABLE', 'UNKNOWN', 0.15)
    """

    def __init__(self, names: Sequence[str], min_duration: float = DEFAULT_DURATION) -> None:
        if not (math.isfinite(min_duration) and min_duration >= 0):
            raise ValueError(f"a duration of at least 0 s expected, {min_duration} given")
        self._names = tuple(names)
        self._min_duration = min_duration
        self._reported = [ContactState.UNKNOWN] * len(self._names)
        self._latest = [(ContactState.UNKNOWN, -math.inf)] * len(self._names)

    def update(self, states: Sequence[ContactState], time: float) -> list[ContactEvent]:
        """Return the changes that have lasted long enough at one sample.

        Args:
            states: one for each name.
            time: of the sample, not before that of the previous one [s].
        """
        found = []
        for index, state in enumerate(states):
            if state is not self._latest[index][0]:
                self._latest[index] = state, time
            begin, reported = self._latest[index][1], self._reported[index]
            if state is not reported and time - begin >= self._min_duration - TIME_TOLERANCE:
                found.append(ContactEvent(self._names[index], state, reported, begin))
                self._reported[index] = state
        return found
