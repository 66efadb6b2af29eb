"""Conversion of a device's stamps to increasing times. No clock: times are arguments."""

import math
from typing import NamedTuple

from holdfast.contact import Fault

MAX_BACKWARD_STEP = 0.05
"""A stamp that goes back by less than this is moved just after the last one [s]."""
MIN_CLOCK_JUMP = 0.5
"""A stamp that is ahead of the host's clock by more than this is a jump [s]."""
MIN_LATE_DELAY = 0.1
"""A sample is late if its delay is longer than the usual one by more than this [s]."""
DELAY_INTERVAL = 1.5
"""A delay is constant if it is the same in two intervals of this length, one after the other [s].
The first begins at most one interval after the delay did, so that it is usual after 4.5 s."""
MAX_CONSTANT_CHANGE = 0.01
"""Change of the shortest delay from interval to interval up to which it is constant [s]: the
minimum on a busy machine varies by a few ms, a queue that grows by 1 % changes by 15 ms."""
MAX_CLOCK_DRIFT = 1e-4
"""Largest drift between two clocks [s/s]."""
CLOCK_GAIN = 0.1
"""Share of the delay of its arrival by which a sample is later than its period says."""
COUNTING_TIME = 0.3
"""Time over which samples are counted to measure their period [s]."""
MAX_COUNTED_PAUSE = 0.2
"""After a longer pause, counting begins again [s]."""
MAX_TIME = 1e11
"""Largest stamp: 3,000 years from 1970 [s]. Doubles still resolve 0.1 ms there."""
PACE_INTERVAL = 0.25
"""Time over which the pace of a clock is measured [s]."""
N_FAST_INTERVALS = 3
"""A clock is too fast if it is in as many intervals in a row as this."""
FAST_SHARE = 0.05
"""A clock is too fast if it gets ahead by more than this share of `MIN_CLOCK_JUMP` in each
interval: by a tenth of the time."""
MAX_FAULTY_PACE = 4.0
"""A clock that runs faster than this is no faulty one: a recording is played fast [s/s]."""
MAX_PACE_CHANGE = 0.1
"""A clock that is too fast has a constant pace: from one interval to the next it changes by less
than this share. A recording that is played fast by a busy machine does not."""
MIN_REPEATED_JUMPS = 2
"""A clock that jumps as often as this in two intervals is unsteady."""
MIN_EPOCH_TIME = 1e8
"""A stamp above this counts from 1970, and not from the start of a device [s]."""
NOTICED_CLOCK_DIFFERENCE = 60.0
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

    A sample is late relative to the usual delay. This is that of the quickest sample, until a
    longer delay stays constant: then it is a property of the link, and no sample is late by it. A
    queue that grows, and a link that stalls and catches up, have no constant delay.

    Attributes:
        delay: delay of the newest sample relative to the quickest [s].

    Example:
        >>> delay = TransportDelay()
        >>> [round(delay.update(t, at), 2) for t, at in ((0.0, 5.0), (1.0, 6.25), (2.0, 7.0))]
        [0.0, 0.25, 0.0]
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start again, because the device's clock changed."""
        # The shortest age of a sample ever, and the age that is usual: the shortest, or one that
        # was constant for long. Both grow by the drift of the clocks; `update` changes them.
        self._least = self._usual = math.inf
        # When the last sample came, and when the interval began over which an age is constant.
        self._received = self._begun = math.nan
        self.delay = 0.0
        # The shortest age in this interval and in the one before.
        self._shortest = self._shortest_before = math.inf

    def update(self, time: float, received: float) -> float:
        """Return the delay of a sample relative to the quickest, this one included [s]."""
        age, drift = received - time, self._drift(received)
        self._least = min(self._least + drift, age)
        self._usual = min(self._usual + drift, age)
        self._received = received
        self.delay = age - self._least
        # A delay is usual as well if it was constant over the last two intervals.
        self._shortest = min(self._shortest, age)
        if math.isnan(self._begun):
            self._begun = received
        if received - self._begun >= DELAY_INTERVAL:
            # A delay that falls is not constant either: a link that stalled catches up.
            if abs(self._shortest - self._shortest_before) <= MAX_CONSTANT_CHANGE:
                self._usual = max(self._usual, min(self._shortest, self._shortest_before))
            self._shortest_before, self._shortest = self._shortest, math.inf
            self._begun = received
        return self.delay

    def is_late(self, time: float, received: float) -> bool:
        """Update the delay, and return whether the sample is late."""
        self.update(time, received)
        return received - time - self._usual > MIN_LATE_DELAY

    def lead(self, time: float, received: float) -> float:
        """Return by how much a sample is quicker than the quickest; mostly below 0 [s]."""
        return self._least - (received - time) - self._drift(received)

    def _drift(self, received: float) -> float:
        """Return the largest drift of the clocks since the last sample [s]."""
        if not math.isfinite(self._least):
            return 0.0
        return MAX_CLOCK_DRIFT * max(received - self._received, 0.0)


class ArrivalClock:
    """Clock of a device that has none and sends evenly, while its samples arrive in bursts.

    The period is measured by counting. A sample is a period later than the one before it, and the
    clock follows the arrivals slowly. No sample is later than its arrival.

    Args:
        period: nominal period [s]; None if it must be measured before the first sample.

    Example:
        >>> clock = ArrivalClock(0.01)
        >>> [round(t, 3) for n, at in ((1, 5.0), (1, 5.03), (2, 5.031)) for t in clock.times(n, at)]
        [5.0, 5.012, 5.021, 5.031]
    """

    def __init__(self, period: float | None) -> None:
        self._period = period
        self._time = -math.inf  # of the newest sample
        # When the samples before the newest ones came; and since when, and how many, are counted.
        self._received, self._since, self._n = -math.inf, math.nan, 0

    def times(self, n: int, received: float) -> list[float]:
        """Return the times of `n` samples that arrive together [s]; none before the period."""
        if not n:
            return []
        self._measure(n, received)
        if self._period is None:
            return []
        end = self._time + n * self._period
        if 0.0 <= received - end <= MIN_LATE_DELAY:
            end += CLOCK_GAIN * (received - end)
            step = (end - self._time) / n
        else:  # the first ones, after a pause, or sooner than the period says
            end, step = received, min(self._period, (received - self._time) / n)
        self._time = end
        return [end - (n - 1 - k) * step for k in range(n)]

    def _measure(self, n: int, received: float) -> None:
        self._n += n
        passed, pause = received - self._since, received - self._received
        if pause <= MAX_COUNTED_PAUSE and passed >= COUNTING_TIME:
            self._period = passed / self._n
        if pause > MAX_COUNTED_PAUSE or passed >= COUNTING_TIME:
            self._since, self._n = received, 0
        self._received = received


class ClockPace:
    """Pace of a device's clock, and how often it jumps, over the newest quarters of a second.

    A clock gets ahead by as much as each sample is quicker than the quickest before. A burst of
    samples after a stall makes no clock fast: it must be fast in three intervals in a row.

    Attributes:
        pace: of the clock, if it is too fast; 1 otherwise [s/s].
        unsteady: whether samples must not be trusted: the clock is up to four times too fast, or
            jumps again and again.

    Example:
        >>> clock = ClockPace()
        >>> for _ in range(20):
        ...     clock.update(lead=0.05, passed=0.1)
        >>> round(clock.pace, 2), clock.unsteady
        (1.5, True)
    """

    def __init__(self) -> None:
        self.pace, self.unsteady = 1.0, False
        # Of this interval: how far the clock got ahead, how long it is, how often the clock jumped.
        self._lead = self._passed = 0.0
        self._n_jumps = self._n_jumps_before = 0
        self._paces = [1.0] * N_FAST_INTERVALS

    def update(self, lead: float, passed: float, *, jumped: bool = False) -> None:
        """Update the pace with a sample.

        Args:
            lead: by how much the sample is quicker than the quickest before [s].
            passed: time since the last sample, on the host's clock [s].
            jumped: whether the clock jumped before this sample.
        """
        # A jump is counted apart: as a lead it would look like a fast clock.
        self._lead += 0.0 if jumped else max(lead, 0.0)
        self._passed += passed
        self._n_jumps += jumped
        if self._passed < PACE_INTERVAL:
            return
        fast = self._lead > FAST_SHARE * MIN_CLOCK_JUMP * self._passed / PACE_INTERVAL
        self._paces = [*self._paces[1:], 1 + self._lead / self._passed if fast else 1.0]
        slowest, fastest = min(self._paces), max(self._paces)
        self.pace = self._paces[-1] if slowest > 1.0 else 1.0
        # A wrong clock is fast at a constant pace. A recording that is played fast is not on a busy
        # machine, or it is more than four times as fast: its samples are right.
        constant = fastest - slowest < MAX_PACE_CHANGE * slowest
        jumpy = self._n_jumps + self._n_jumps_before >= MIN_REPEATED_JUMPS
        self.unsteady = jumpy or (constant and 1.0 < self.pace <= MAX_FAULTY_PACE)
        self._n_jumps_before = self._n_jumps
        self._lead, self._passed, self._n_jumps = 0.0, 0.0, 0


class Timeline:
    """Converter of the stamps of a device to strictly increasing times.

    If the device's clock jumps, time continues by as much as passed on the host's clock. A jump
    is a stamp that goes back, or a stamp from the future. A burst of samples after a stall, and
    a gap in the samples, are no jumps. A sample is late if the delay from its stamp to its
    arrival is longer than the usual one; the clocks may differ, and drift by 1e-4.
    While the device's clock is too fast or jumps again and again, every sample has a fault.

    Attributes:
        offset: sum of the device's clock jumps, added to its stamps [s].
        delay: delay of the newest sample relative to the quickest [s].
        clock: pace of the device's clock.

    Example:
        >>> timeline = Timeline()
        >>> [timeline.stamp(t, 50.0 + 0.01 * k).time for k, t in enumerate((7.0, 7.01, 7.01))]
        [7.0, 7.01, 7.010000000000001]
    """

    def __init__(self) -> None:
        self.offset = self.delay = 0.0
        self._last = self._received = math.nan  # times of the last sample, here and at the host
        self._delay = TransportDelay()
        self.clock = ClockPace()

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
        # Before the delay is updated: the lead is against the samples before this one.
        lead = self._delay.lead(time, received)
        is_first = math.isnan(self._last)
        back = time <= self._last - MAX_BACKWARD_STEP  # False for the first
        jumped = back or (not is_first and lead > MIN_CLOCK_JUMP)
        if jumped:
            # The host's clock shows how long it was; what follows keeps this offset.
            time = self._last + max(received - self._received, 0.0)
            self.offset = time - device_time
            self._delay.reset()
        if time <= self._last:  # False before the first
            time = math.nextafter(self._last, math.inf)
        late = self._delay.is_late(time, received)
        self.delay = self._delay.delay
        if not is_first:
            self.clock.update(lead, received - self._received, jumped=jumped)
        self._last, self._received = time, received
        return Stamp(
            time, (Fault.CLOCK_JUMP,) * (jumped or self.clock.unsteady) + (Fault.LATE,) * late
        )


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
    # A stamp that counts from the start of the device has no date to be compared.
    if stamp < MIN_EPOCH_TIME or abs(behind) <= NOTICED_CLOCK_DIFFERENCE:
        return None
    where = "behind" if behind > 0 else "ahead of"
    advice = "old data?" if behind > 0 else "is its clock set?"
    how_far = f"{abs(behind) / 60:.0f} min"
    for unit, size in (("h", 3600.0), ("d", 86400.0)):
        if abs(behind) >= 2 * size:
            how_far = f"{abs(behind) / size:.0f} {unit}"
    return f"the stamps of the device are {how_far} {where} the clock of this machine: {advice}"
