"""From a device's clock, which may jump, to times that go forward. No clock of its own."""

import math
from typing import NamedTuple

from holdfast.contact import Fault

JITTER = 0.05
"""A stamp that goes back by no more than this is taken as just after the last [s]."""
JUMP = 0.5
"""A stamp so far ahead of the host's clock, by the quickest sample so far, is a jump [s]."""
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


class Delay:
    """How much later samples arrive than the quickest did; clocks may drift by 1e-4.

    Example:
        >>> delay = Delay()
        >>> [round(delay.of(t, at), 2) for t, at in ((0.0, 5.0), (1.0, 6.25), (2.0, 7.0))]
        [0.0, 0.25, 0.0]
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begins anew: the clock is another now."""
        self._least = math.inf
        self._received = math.nan

    def of(self, time: float, received: float) -> float:
        """How much later than the quickest this sample is [s]; it may be the quickest now."""
        age = received - time
        self._least = min(self._least + self._drift(received), age)
        self._received = received
        return age - self._least

    def lead(self, time: float, received: float) -> float:
        """How much quicker than the quickest this sample is, drift aside; mostly below 0 [s]."""
        return self._least - (received - time) - self._drift(received)

    def _drift(self, received: float) -> float:
        """By how much the clocks may have drifted apart since the last sample [s]."""
        return DRIFT * max(received - self._received, 0.0) if math.isfinite(self._least) else 0.0


class Timeline:
    """Turns the stamps of a device into strictly increasing times.

    Where the device's clock jumps, time goes on by as much as passed on the host's. A jump is
    a stamp that goes back, or one that would be from the future: a burst after a stall, or a
    stretch that is missing, is neither. A sample is late where it came later after its stamp
    than the quickest did; clocks may differ, and drift by 1e-4.

    Attributes:
        offset: what is added to the device's stamps, since its clock jumped [s].

    Example:
        >>> timeline = Timeline()
        >>> [timeline.stamp(t, 50.0 + 0.01 * k).time for k, t in enumerate((7.0, 7.01, 7.01))]
        [7.0, 7.01, 7.010000000000001]
    """

    def __init__(self) -> None:
        self.offset = 0.0
        self._last = self._received = math.nan
        self._delay = Delay()

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
        time = device_time + self.offset
        jumped = self._jumped(time, received)
        if jumped:
            time = self._last + max(received - self._received, 0.0)
            self.offset = time - device_time
            self._delay.forget()
        if time <= self._last:  # False before the first
            time = math.nextafter(self._last, math.inf)
        late = self._delay.of(time, received) > LATE
        self._last, self._received = time, received
        faults = (Fault.CLOCK_JUMP,) * jumped + (Fault.LATE,) * late
        return Stamp(time, faults)

    def _jumped(self, time: float, received: float) -> bool:
        if math.isnan(self._last):
            return False
        from_future = self._delay.lead(time, received) > JUMP
        return time <= self._last - JITTER or from_future
