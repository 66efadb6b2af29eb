"""Repeated readings of a finger: a noisy sensor never repeats itself exactly. No clock."""

import math

from holdfast.contact import ContactEstimate, ContactState
from holdfast_grip.limits import SLACK

FROZEN_TIME = 0.08
"""Time for which a noisy finger repeats its force exactly when it counts as frozen [s]."""
MIN_REPEATS = 6
"""Least number of repeats of a frozen finger; they take 0.1 s at 60 Hz."""
MIN_FREE_SAMPLES = 200
"""Samples without contact from which it is known whether a finger is noisy."""
MAX_FREE_REPEATS = 3
"""Longest run of repeats of a noisy finger without contact; a server may send a sample twice."""
FROZEN_RATIO, REPEATING_RATIO = 10, 3
"""A run of repeats is frozen, or suspicious, from these multiples of the longest one without
contact."""


class RepeatMonitor:
    """Detect that the force of a noisy finger repeats exactly, sample after sample.

    What changes while nothing touches the finger is noise, and noise does not end with a touch.
    So the longest run of repeats without contact shows how long a healthy finger may repeat
    itself. A finger whose readings also rest without contact may rest in a grip: it is never
    frozen by this rule, and the detector finds it later, as `stuck`.

    Attributes:
        n_repeats: number of samples that repeat the one before, up to the newest.
        repeating: whether the run of repeats is longer than noise allows.
        frozen: whether it has also lasted for `FROZEN_TIME`.

    Example:
        >>> from holdfast.contact import Reason
        >>> def finger(time, force, state=ContactState.STABLE):
        ...     return ContactEstimate(time, state, Reason.NONE, 0.9, 1.0, (force, 0.0, 0.0))
        >>> monitor = RepeatMonitor()
        >>> for k in range(300):
        ...     monitor.update(finger(k / 100, k % 7, ContactState.NO_CONTACT))
        >>> for k in range(300, 309):
        ...     monitor.update(finger(k / 100, 50.0))
        >>> monitor.repeating, monitor.frozen
        (True, True)
    """

    __slots__ = ("_changed_at", "_force", "_longest", "_n_free", "_time", "frozen", "n_repeats",
                 "repeating")  # fmt: skip

    def __init__(self) -> None:
        self._force = (math.nan, math.nan, math.nan)
        self._time = self._changed_at = math.nan
        self.n_repeats = self._longest = self._n_free = 0
        self.repeating = self.frozen = False

    def update(self, estimate: ContactEstimate) -> None:
        """Process the newest estimate of the finger; the same one again counts once."""
        if estimate.time == self._time:
            return
        self._time = estimate.time
        if estimate.force != self._force:
            self._force, self._changed_at = estimate.force, estimate.time
            self.n_repeats = 0
            self.repeating = self.frozen = False
            self._n_free += estimate.state is ContactState.NO_CONTACT
            return
        self.n_repeats = n = self.n_repeats + 1
        if estimate.state is ContactState.NO_CONTACT:
            self._n_free += 1
            self._longest = max(self._longest, n)
        # Only a finger that was noisy without contact can freeze in a grip.
        noisy = self._n_free >= MIN_FREE_SAMPLES and self._longest <= MAX_FREE_REPEATS
        self.repeating = noisy and n >= REPEATING_RATIO * (1 + self._longest)
        lasting = estimate.time - self._changed_at >= FROZEN_TIME - SLACK
        enough = n >= max(MIN_REPEATS, FROZEN_RATIO * self._longest)
        self.frozen = noisy and lasting and enough
