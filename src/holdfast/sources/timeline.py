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
MAX_TIME = 1e11
"""Largest stamp: 3,000 years from 1970 [s]. Doubles still resolve 0.1 ms there."""
UNSTEADY_SHARE = 0.2
"""A clock is unsteady if it has got ahead by more than this share of `MIN_CLOCK_JUMP`."""
CLOCK_RECOVERY = 0.1
"""A clock that is this much too fast is steady, and an unsteady one recovers at this pace [s/s]."""
MIN_EPOCH_TIME = 1e8
"""A stamp above this counts from 1970, and not from the start of a device [s]."""
MAX_CLOCK_DIFFERENCE = 60.0
"""A difference between two clocks that is larger than this is worth a notice [s]."""


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


class ClockSteadiness:
    """Measure of how far a device's clock got ahead of the host's of late.

    It adds up by how much each sample is quicker than the quickest before, and forgets a tenth of
    a second in each second. A clock that runs 1.5 times too fast is unsteady after 0.25 s. Each
    jump counts a tenth of a second, so a clock that jumps twice in a second is unsteady, too.

    Example:
        >>> clock = ClockSteadiness()
        >>> [clock.update(lead, passed=0.05) for lead in (0.03, 0.03, 0.03, 0.03, 0.03)]
        [False, False, False, False, True]
    """

    def __init__(self) -> None:
        self._ahead = 0.0

    def update(self, lead: float, passed: float, *, jumped: bool = False) -> bool:
        """Return whether the clock is unsteady.

        Args:
            lead: by how much a sample is quicker than the quickest before [s].
            passed: time since the last sample, on the host's clock [s].
            jumped: whether the clock jumped before this sample.
        """
        limit = UNSTEADY_SHARE * MIN_CLOCK_JUMP
        gained = limit if jumped else max(lead, 0.0)
        kept = max(self._ahead - CLOCK_RECOVERY * max(passed, 0.0), 0.0)
        self._ahead = min(kept + gained, 2 * limit)
        return self._ahead > limit


class Timeline:
    """Converter of the stamps of a device to strictly increasing times.

    If the device's clock jumps, time continues by as much as passed on the host's clock. A jump
    is a stamp that goes back, or a stamp from the future. A burst of samples after a stall, and
    a gap in the samples, are no jumps. A sample is late if the delay from its stamp to its
    arrival is longer than that of the quickest sample; the clocks may differ, and drift by 1e-4.
    While the device's clock is too fast or jumps again and again, every sample has a fault.

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
        self._steadiness = ClockSteadiness()

    def stamp(self, device_time: float, received: float) -> Stamp:
        """Return the time of a sample.

        Args:
            device_time: stamp of the device [s].
            received: time of arrival, on the host's monotonic clock [s].

        Raises:
            ValueError: the stamp is not finite, or thousands of years away.
        """
        if not is_plausible(device_time):
            raise ValueError(f"a time in seconds expected, {device_time} given")
        time = device_time + self.offset
        lead = self._delay.lead(time, received)
        jumped = self._jumped(time, lead)
        if jumped:
            time = self._last + max(received - self._received, 0.0)
            self.offset = time - device_time
            self._delay.reset()
        if time <= self._last:  # False before the first
            time = math.nextafter(self._last, math.inf)
        late = self._delay.is_late(time, received)
        unsteady = not math.isnan(self._last) and self._steadiness.update(
            lead, received - self._received, jumped=jumped
        )
        self._last, self._received = time, received
        return Stamp(time, (Fault.CLOCK_JUMP,) * (jumped or unsteady) + (Fault.LATE,) * late)

    def _jumped(self, time: float, lead: float) -> bool:
        if math.isnan(self._last):
            return False
        return time <= self._last - MAX_BACKWARD_STEP or lead > MIN_CLOCK_JUMP


def is_plausible(time: float) -> bool:
    """Return whether a stamp is a number, and not thousands of years away."""
    return -MAX_TIME < time < MAX_TIME


def clock_notice(stamp: float, now: float) -> str | None:
    """Return a notice if a device's clock differs much from the host's, or None.

    Such stamps come from a device whose clock is not set, or from a replay of old data.

    Args:
        stamp: newest stamp of the device [s].
        now: time of the host since 1970 [s].

    Example:
        >>> clock_notice(1.7e9, 1.7e9 + 5)
        >>> clock_notice(1.7e9, 1.7e9 + 7200)
        'the stamps of the device are 2 h behind the clock of this machine: old data?'
    """
    behind = now - stamp
    if stamp < MIN_EPOCH_TIME or abs(behind) <= MAX_CLOCK_DIFFERENCE:
        return None
    where = "behind" if behind > 0 else "ahead of"
    advice = "old data?" if behind > 0 else "is its clock set?"
    how_far = _duration(abs(behind))
    return f"the stamps of the device are {how_far} {where} the clock of this machine: {advice}"


def _duration(seconds: float) -> str:
    for unit, size in (("d", 86400.0), ("h", 3600.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds / 60:.0f} min"
