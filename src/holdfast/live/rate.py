"""Rate of a live source: its measurement at the start, and its changes. No clock."""

from collections.abc import Iterable, Mapping

import numpy as np

from holdfast.devices.sources import Arrival
from holdfast.recordings import GAP_PERIODS

MAX_RATE_CHANGE = 0.2
"""A rate that differs by more than this from that at the start has changed."""
RATE_CHECK_INTERVAL = 0.3
"""Time over which the rate is measured again [s]; longer for rates below 33 Hz."""
MIN_STEPS = 10
"""Number of steps that this time has at the rate of the start."""
PAUSE_PERIODS = 10.0
"""A longer step between samples is a pause, and not part of the rate [sample periods]."""


def measure_rate(arrivals: list[Arrival], fingers: Iterable[str]) -> float | None:
    """Return the median rate of the fingers, from steps without gaps [Hz]; None without steps."""
    rates = []
    for name in fingers:
        steps = np.diff([arrival.time for arrival in arrivals if name in arrival.samples])
        if len(steps):
            rates.append(1 / steps[steps <= GAP_PERIODS * np.median(steps)].mean())
    return float(np.median(rates)) if rates else None


class RateMonitor:
    """Comparison of the rates of the fingers with the rate at the start.

    The detector counts samples, and takes them to be a period of the first rate apart.

    Args:
        rate: rate at the start [Hz].
        fingers: names of the fingers.

    Attributes:
        changed: fingers whose rate has changed.
    """

    def __init__(self, rate: float, fingers: Iterable[str]) -> None:
        self._rate = rate
        self._interval = max(RATE_CHECK_INTERVAL, MIN_STEPS / rate)
        self._longest_step = PAUSE_PERIODS / rate
        self._windows = {name: _Window() for name in fingers}
        self.changed: set[str] = set()

    def update(self, samples: Mapping[str, object], time: float) -> list[str]:
        """Update the rates of the fingers with a sample at a time [s]; return new notices."""
        notices: list[str] = []
        for name in samples:
            rate = self._windows[name].update(time, self._interval, self._longest_step)
            if rate is not None:
                notices += self._compare(name, rate)
        return notices

    def _compare(self, name: str, rate: float) -> list[str]:
        if abs(rate / self._rate - 1) <= MAX_RATE_CHANGE:
            self.changed.discard(name)
            return []
        before = bool(self.changed)
        self.changed.add(name)
        text = (
            f"{name} sends {rate:.3g} samples per second, {self._rate:.3g} at the start: "
            "open the source again"
        )
        return [] if before else [text]


class _Window:
    """Number and length of the steps between the samples of a finger."""

    __slots__ = ("_last", "_length", "_n")

    def __init__(self) -> None:
        self._last = np.nan
        self._length, self._n = 0.0, 0

    def update(self, time: float, interval: float, longest: float) -> float | None:
        """Return the rate if the window is as long as `interval` [s], and begin a new one."""
        step, self._last = time - self._last, time
        if not step <= longest:  # a pause, or the first sample
            return None
        self._length += step
        self._n += 1
        if self._length < interval:
            return None
        rate = self._n / self._length
        self._length, self._n = 0.0, 0
        return rate
