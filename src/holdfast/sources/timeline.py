"""From a device's clock, which may jump, to times that go forward. No clock of its own."""

import math
from typing import NamedTuple

from holdfast.contact import Fault

JITTER = 0.05
"""A stamp that goes back by no more than this is taken as just after the last [s]."""
JUMP = 0.5
"""A clock that runs so far ahead of the host's between two packets has jumped [s]."""
LATE = 0.1
"""A sample that arrives so much later than others did is late [s]."""
DRIFT = 1e-4
"""How fast two clocks may drift apart [s/s]."""


class Stamp(NamedTuple):
    """When a sample was taken.

    Attributes:
        time: on the clock of the source, without its jumps [s].
        faults: CLOCK_JUMP where the device's clock jumped, LATE where the sample is old.
    """

    time: float
    faults: tuple[Fault, ...] = ()


class Timeline:
    """Turns the stamps of a device into strictly increasing times.

    Where the device's clock jumps, time goes on by as much as passed on the host's. A sample
    is late where it came later after its stamp than the quickest did; clocks may differ, and
    drift by 1e-4.

    Example:
        >>> timeline = Timeline()
        >>> [timeline.stamp(t, 50.0 + 0.01 * k).time for k, t in enumerate((7.0, 7.01, 7.01))]
        [7.0, 7.01, 7.010000000000001]
    """

    def __init__(self) -> None:
        self._offset = 0.0
        self._last = self._received = math.nan
        self._least = math.inf

    def stamp(self, device_time: float, received: float) -> Stamp:
        """The time of a sample.

        Args:
            device_time: as the device stamped it [s].
            received: when it arrived, by the host's monotonic clock [s].

        Raises:
            ValueError: a stamp that is not finite.
        """
        if not math.isfinite(device_time):
            raise ValueError(f"a time in seconds expected, {device_time} given")
        time = device_time + self._offset
        jumped = not math.isnan(self._last) and self._jumped(time, received)
        if jumped:
            time = self._last + max(received - self._received, 0.0)
            self._offset = time - device_time
            self._least = math.inf
        if time <= self._last:  # False before the first
            time = math.nextafter(self._last, math.inf)
        late = self._is_late(time, received)
        self._last, self._received = time, received
        faults = (Fault.CLOCK_JUMP,) * jumped + (Fault.LATE,) * late
        return Stamp(time, faults)

    def _jumped(self, time: float, received: float) -> bool:
        """Back, or ahead of the host's clock; a burst after a stall is neither."""
        ahead = time - self._last - (received - self._received)
        return time <= self._last - JITTER or ahead > JUMP

    def _is_late(self, time: float, received: float) -> bool:
        elapsed = 0.0 if math.isnan(self._received) else received - self._received
        age = received - time
        self._least = min(self._least + DRIFT * elapsed, age)
        return age - self._least > LATE
