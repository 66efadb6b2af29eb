"""Conversion of a device's stamps to increasing times. No clock: times are arguments."""

import math
from typing import NamedTuple

from holdfast.contact import Fault

MAX_BACKWARD_STEP = 0.05
"""A stamp that goes back by less than this is moved just after the last one [s]."""
MIN_CLOCK_JUMP = 0.5
"""A stamp that is ahead of the host's clock by more than this is a jump [s]."""
MIN_LATE_DELAY = 0.1
"""A sample is late if it arrives later than the quickest one by more than this [s]."""
MAX_CLOCK_DRIFT = 1e-4
"""Largest drift between two clocks [s/s]."""


class Stamp(NamedTuple):
    """Time of a sample.

    Attributes:
        time: time on the clock of the source, without its jumps [s].
        faults: CLOCK_JUMP if the device's clock jumped, LATE if the sample is old.
    """

    time: float
    faults: tuple[Fault, ...] = ()


class TransportDelay:
    """Delay of samples relative to the quickest one, for clocks that drift by at most 1e-4.

    Example:
        >>> delay = TransportDelay()
        >>> [round(delay.update(t, at), 2) for t, at in ((0.0, 5.0), (1.0, 6.25), (2.0, 7.0))]
        [0.0, 0.25, 0.0]
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start again, because the device's clock changed."""
        self._least = math.inf
        self._received = math.nan

    def update(self, time: float, received: float) -> float:
        """Return the delay of a sample relative to the quickest, this one included [s]."""
        age = received - time
        self._least = min(self._least + self._drift(received), age)
        self._received = received
        return age - self._least

    def is_late(self, time: float, received: float) -> bool:
        """Update the delay, and return whether the sample is late."""
        return self.update(time, received) > MIN_LATE_DELAY

    def lead(self, time: float, received: float) -> float:
        """Return by how much a sample is quicker than the quickest; mostly below 0 [s]."""
        return self._least - (received - time) - self._drift(received)

    def _drift(self, received: float) -> float:
        """Return the largest drift of the clocks since the last sample [s]."""
        if not math.isfinite(self._least):
            return 0.0
        return MAX_CLOCK_DRIFT * max(received - self._received, 0.0)


class Timeline:
    """Converter of the stamps of a device to strictly increasing times.

    If the device's clock jumps, time continues by as much as passed on the host's clock. A jump
    is a stamp that goes back, or a stamp from the future. A burst of samples after a stall, and
    a gap in the samples, are no jumps. A sample is late if the delay from its stamp to its
    arrival is longer than that of the quickest sample; the clocks may differ, and drift by 1e-4.

    Attributes:
        offset: sum of the device's clock jumps, added to its stamps [s].

    Example:
        >>> timeline = Timeline()
        >>> [timeline.stamp(t, 50.0 + 0.01 * k).time for k, t in enumerate((7.0, 7.01, 7.01))]
        [7.0, 7.01, 7.010000000000001]
    """

    def __init__(self) -> None:
        self.offset = 0.0
        self._last = self._received = math.nan
        self._delay = TransportDelay()

    def stamp(self, device_time: float, received: float) -> Stamp:
        """Return the time of a sample.

        Args:
            device_time: stamp of the device [s].
            received: time of arrival, on the host's monotonic clock [s].

        Raises:
            ValueError: the stamp is not finite.
        """
        if not math.isfinite(device_time):
            raise ValueError(f"a time in seconds expected, {device_time} given")
        time = device_time + self.offset
        jumped = self._jumped(time, received)
        if jumped:
            time = self._last + max(received - self._received, 0.0)
            self.offset = time - device_time
            self._delay.reset()
        if time <= self._last:  # False before the first
            time = math.nextafter(self._last, math.inf)
        late = self._delay.is_late(time, received)
        self._last, self._received = time, received
        return Stamp(time, (Fault.CLOCK_JUMP,) * jumped + (Fault.LATE,) * late)

    def _jumped(self, time: float, received: float) -> bool:
        if math.isnan(self._last):
            return False
        from_future = self._delay.lead(time, received) > MIN_CLOCK_JUMP
        return time <= self._last - MAX_BACKWARD_STEP or from_future
