"""Jerks of a hand, detected in the joint angles that its driver reports. No clock and no units."""

import math

import numpy as np

from holdfast.sensors.types import Array

SPREAD_REPORTS = 75
"""Number of reports over which the running spread forgets: 0.2 to 0.8 s of the known drivers."""
MIN_SPREAD_REPORTS = 30
"""Number of reports after which the spread is known."""
JERK_RATIO = 16.0
"""Ratio of a change of speed to its running spread from which it is a jerk. In the holds of tuning
seed 100 it was 25 to 410 in 16 of 17 jerks of the controller, and 3 to 14 when a load came."""


class JerkMonitor:
    """Detect that a joint moves suddenly, from the angles that a driver reports.

    The change of the speed of a joint between reports is q_k - 2 q_(k-1) + q_(k-2). A jerk is one
    that is far larger than the running spread of all joints: the hand's own controller moves a
    finger within a few milliseconds, while an object that is pushed moves the joints smoothly,
    through the skin. The ratio has no unit. Efforts are not used: drivers of Allegro hands report
    the torque that was commanded, which every command of a loop changes.

    Attributes:
        jerked: whether the newest report has a jerk.

    Example:
        >>> monitor = JerkMonitor()
        >>> for k in range(100):
        ...     monitor.update(np.array([1.0 + 1e-4 * (k % 2), 0.5]))
        >>> monitor.jerked
        False
        >>> monitor.update(np.array([1.02, 0.5]))
        >>> monitor.jerked
        True
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all reports."""
        self.jerked = False
        # Angles and speeds of the newest report, with which the next one is compared.
        self._last: Array | None = None
        self._speed: Array | None = None
        self._n_changes = 0
        # Running mean square of the changes of speed.
        self._square = 0.0

    def update(self, angles: Array) -> None:
        """Process a report.

        Args:
            angles: (n_joints,) angle of each joint [rad]. If their number changes or an angle is
                not finite, earlier reports are forgotten.
        """
        last, before = self._last, self._speed
        self.jerked = False
        if last is None or before is None or last.shape != angles.shape:
            self._begin(angles)
            return
        self._last, self._speed = angles, angles - last
        change = self._speed - before
        total = float(change @ change)
        # A sum that is not finite is the cheapest check of all angles.
        if not math.isfinite(total):
            self.reset()
            return
        square = total / len(change)
        # Compare before the spread follows, so that a jerk is not part of its own measure.
        limit = JERK_RATIO * math.sqrt(self._square)
        # A hand whose joints rest exactly has no spread to compare with. No change exceeds the
        # root of the sum, so the largest one is only looked for where it can matter.
        if self._n_changes >= MIN_SPREAD_REPORTS and 0.0 < limit < math.sqrt(total):
            self.jerked = float(np.abs(change).max()) > limit
        self._n_changes += 1
        if self.jerked:  # the spread is that of the hold
            square = min(square, JERK_RATIO * self._square)
        self._square += (square - self._square) / min(self._n_changes, SPREAD_REPORTS)

    def _begin(self, angles: Array) -> None:
        """Take one of the first two reports."""
        last = self._last
        if not np.isfinite(angles).all():
            self.reset()
        elif last is None or last.shape != angles.shape:
            self.reset()
            self._last = angles
        else:
            self._last, self._speed = angles, angles - last
