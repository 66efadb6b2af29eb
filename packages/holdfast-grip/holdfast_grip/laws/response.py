"""How long a hand takes from a command to its force: latency, lag and the delay of the sensor."""

import math
from collections.abc import Sequence

from holdfast_grip.laws.base import Touch

WATCH_TIME = 0.2
"""Time for which the force is watched after a command [s]: three times the slowest response that
was seen on the twin's hard plant."""
END_TIME = 0.05
"""Part of it, at its end, whose mean is the force that was reached [s]."""
LEAST_RISE = 0.015
"""Rise of the force, as a share, from which a hand has responded."""
PROBE_DELAY, PROBE_TIME, PROBE_RISE = 0.15, 0.36, 0.06
"""When the law presses more, how long, and by what share, to measure the response of the hand."""
LONGEST_RESPONSE = 0.12
"""Longest response time that counts [s]: the rate at which a load changes is known no further."""
CHANGED_RESPONSE = 0.03, 0.5
"""Change of the response time that is reported to the user, in seconds and as a share."""


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


class HandResponse:
    """Response time of the hand: measured by a small rise at the start, then by each step.

    Args:
        measures: whether it is measured at all.

    Attributes:
        time: response time [s]; 0 until it is measured, and where it cannot be.
        probes: whether the rise at the start is still to be measured.
        notice: a message for the user; empty without one.
    """

    def __init__(self, *, measures: bool) -> None:
        self.time, self.probes, self.notice = 0.0, measures, ""
        self._timer = ResponseTimer()
        self._started_at = math.nan
        self._first_press, self._n_first = 0.0, 0
        self._n_changed = 0  # steps in a row with another response

    def presses(self, time: float) -> bool:
        """Return whether the hand presses more now, to be measured."""
        return self.probes and PROBE_DELAY <= time - self._started_at < PROBE_TIME

    def begin_step(self, time: float, press: float) -> None:
        """Measure a step, if there is a first response to compare it with."""
        if self.time > 0:
            self._timer.begin(time, press)

    def update(self, touches: Sequence[Touch], time: float, *, slides: bool) -> bool:
        """Add a sample; return whether the rise at the start begins with it."""
        if not (self.probes or self._timer.running):
            return False
        press, begins = sum(touch.normal for touch in touches), False
        if self.probes:
            if math.isnan(self._started_at):
                self._started_at = time
            if time - self._started_at < PROBE_DELAY:
                if time - self._started_at >= PROBE_DELAY - END_TIME:
                    self._first_press += press
                    self._n_first += 1
            elif not self._timer.running:
                self._timer.begin(time, self._first_press / max(self._n_first, 1))
                begins = True
            if slides:  # a slide changes the force too
                self._timer.stop()
                self.probes = False
                self.notice = "no response time of the hand: something slid at the start"
        if self._timer.update(time, press):
            self.take(self._timer.result)
        return begins

    def take(self, response: float) -> None:
        """Take the first response time; compare later ones with it."""
        if self.probes:
            self.probes = False
            if math.isnan(response):
                self.notice = "no response time of the hand: its force did not follow the command"
            else:
                self.time = min(response, LONGEST_RESPONSE)
            return
        least, share = CHANGED_RESPONSE
        # A step in a slide measures roughly: two in a row must agree.
        is_changed = self.time > 0 and abs(response - self.time) > max(least, share * self.time)
        self._n_changed = self._n_changed + 1 if is_changed else 0
        if self._n_changed == 2:
            self.notice = (
                f"the response time of the hand changed from {1e3 * self.time:.0f} to "
                f"{1e3 * response:.0f} ms: start again with the new one"
            )
