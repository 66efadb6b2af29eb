"""How long a hand takes from a command to its force: latency, lag and the delay of the sensor."""

import math

WATCH_TIME = 0.2
"""Time for which the force is watched after a command [s]: three times the slowest response that
was seen on the twin's hard plant."""
END_TIME = 0.05
"""Part of it, at its end, whose mean is the force that was reached [s]."""
LEAST_RISE = 0.015
"""Rise of the force, as a share, from which a hand has responded."""


class ResponseTimer:
    """Measure the time from a command to half of the rise of force that follows it.

    It needs no clock and no report of the hand: it compares what the sensors see with what was
    commanded, so it contains every delay between the two.

    Attributes:
        running: whether a response is being watched.
        result: newest response time [s]; NaN where the force did not rise, or before the first.

    Example:
        >>> timer = ResponseTimer()
        >>> timer.begin(0.0, 10.0)
        >>> for k in range(45):
        ...     done = timer.update(k / 200, 10.0 if k < 12 else 11.0)
        >>> timer.result
        0.06
    """

    def __init__(self) -> None:
        self.running, self.result = False, math.nan
        self._samples: list[tuple[float, float]] = []
        self._time = self._press = 0.0

    def begin(self, time: float, press: float) -> None:
        """Start at a command, with the normal force before it."""
        self.running = True
        self._time, self._press = time, press
        self._samples.clear()

    def stop(self) -> None:
        """Give up: something else changes the force."""
        self.running = False

    def update(self, time: float, press: float) -> bool:
        """Add the normal force of a sample; return whether `result` is new."""
        if not self.running:
            return False
        since = time - self._time
        self._samples.append((since, press))
        if since < WATCH_TIME:
            return False
        self.running = False
        end = [force for at, force in self._samples if at >= WATCH_TIME - END_TIME]
        rise = sum(end) / len(end) - self._press
        self.result = math.nan
        if rise >= LEAST_RISE * self._press > 0.0:
            half = self._press + 0.5 * rise
            self.result = next(at for at, force in self._samples if force >= half)
        return True
