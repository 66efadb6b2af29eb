"""Filter between a source and the detector: buffering, rate, resampling, faults of the stream.

No clock, no thread, no I/O: the times are those of the arrivals.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from statistics import median
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import Fault, Reason
from holdfast.detection import EXACT_RATE, Model
from holdfast.devices.sources.base import Arrival, ModuleSamples
from holdfast.errors import ModelError
from holdfast.live.readings_monitor import ReadingsMonitor
from holdfast.recordings import GAP_PERIODS
from holdfast.resampling import (
    CHANGED_SHARE,
    MIN_COMPARED_TAXELS,
    MIN_UPDATE_RATE,
    Resampler,
    UpdateFilter,
    differing_taxels,
    held_rows,
)
from holdfast.sensors import Sensor

MAX_RATE_CHANGE = 0.2
"""A rate that differs by more than this share from that at the start has changed. That of a model
may differ by as much (`RATE_TOLERANCE`)."""
RATE_CHECK_INTERVAL = 0.3
"""Time over which the rate is measured again [s]; longer for rates below 33 Hz."""
MIN_STEPS = 10
"""Number of steps that this time has at the rate of the start."""
PAUSE_PERIODS = 10.0
"""A longer step between samples is a pause, and not part of the rate [sample periods]."""
RATE_MEASUREMENT_TIME = 0.5
"""Length of the first part of a stream, from which its rate is measured [s]."""
MAX_BUFFERED_ARRIVALS = 4096
"""Maximum number of arrivals in the buffer while the rate is measured.

The clock of a device may stand still, so the time alone does not limit it."""

SLOW_UPDATES = 8
"""Number of updates that show that a finger is slow: 0.8 s at 10 Hz."""

FingerFaults = Mapping[str, tuple[Fault, ...]]
"""Faults by finger."""


def measure_rate(arrivals: Iterable[Arrival], fingers: Iterable[str]) -> float | None:
    """Return the median rate of the fingers, from steps without gaps [Hz]; None without steps."""
    rates = []
    for name in fingers:
        steps = np.diff([arrival.time for arrival in arrivals if name in arrival.samples])
        if len(steps):
            rates.append(1 / steps[steps <= GAP_PERIODS * np.median(steps)].mean())
    return float(np.median(rates)) if rates else None


def measure_hold(arrivals: Iterable[Arrival], fingers: Mapping[str, Sensor], rate: float) -> float:
    """Return how many rows of a rate [Hz] the sensors hold each sample; 1 if one does not."""
    rows = []
    for name, sensor in fingers.items():
        samples = [arrival.samples[name] for arrival in arrivals if name in arrival.samples]
        if samples:
            rows.append(held_rows(np.array(samples), sensor, rate))
    counted_rows = [n_rows for n_rows in rows if n_rows is not None]
    return float(np.median(counted_rows)) if min(counted_rows, default=1.0) > 1.0 else 1.0


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
        # Of each finger: the time of its last sample, and the length and number of the steps since
        # its rate was last compared. `update` alone changes them.
        self._last = dict.fromkeys(fingers, math.nan)
        self._steps = dict.fromkeys(self._last, (0.0, 0))
        self.changed: set[str] = set()

    def update(self, samples: Mapping[str, object], time: float) -> list[str]:
        """Update the rates of the fingers with a sample at a time [s]; return new notices."""
        notices: list[str] = []
        for name in samples:
            step, self._last[name] = time - self._last[name], time
            if not step <= self._longest_step:  # a pause, or the first sample
                continue
            length, n = self._steps[name][0] + step, self._steps[name][1] + 1
            self._steps[name] = (length, n) if length < self._interval else (0.0, 0)
            if length < self._interval:
                continue
            if abs(n / length / self._rate - 1) <= MAX_RATE_CHANGE:
                self.changed.discard(name)
                continue
            if not self.changed:  # the fingers of a device change together: one notice is enough
                notices.append(
                    f"{name} sends {n / length:.3g} samples per second, {self._rate:.3g} at the "
                    "start: open the source again"
                )
            self.changed.add(name)
        return notices


class _Updates:
    """Newest updates of a finger: the last reading, when it came, and the updates before it."""

    def __init__(self, sensor: Sensor) -> None:
        self._skips_zeros = not sensor.rests_at_zero
        self._reading: npt.NDArray[Any] | None = None
        self._time, self._n_rows = math.nan, 0
        # Of each update: the time [s] and the rows since the one before; whether most taxels
        # changed.
        self._steps: deque[tuple[float, int, bool]] = deque(maxlen=SLOW_UPDATES)
        self.is_slow = False

    def add(self, reading: npt.NDArray[Any], time: float) -> None:
        """Add a row. A sensor is slow that updates evenly, or all at once, with rows between."""
        before, self._n_rows = self._reading, self._n_rows + 1
        if self._skips_zeros and not reading.any():
            return
        if before is not None:
            n, n_changed = len(reading), np.count_nonzero(differing_taxels(reading, before))
            if not n_changed:
                return
            at_once = n >= MIN_COMPARED_TAXELS and n_changed >= CHANGED_SHARE * n
            self._steps.append((time - self._time, self._n_rows, bool(at_once)))
        self._reading, self._time, self._n_rows = np.array(reading), time, 0
        if len(self._steps) < SLOW_UPDATES:
            return
        steps, rows, at_once_each = zip(*self._steps, strict=True)
        longest = 1 / (MIN_UPDATE_RATE * (1 - EXACT_RATE))
        # The rows first: in a living stream every row is an update, and the rest is not looked at.
        self.is_slow = (
            median(rows) > 1
            and median(steps) > longest
            and (all(at_once_each) or max(rows) - min(rows) <= 1)
        )


class FilteredSamples(NamedTuple):
    """Samples of one instant for the detector, and which fingers the stream makes UNKNOWN.

    Attributes:
        time: of the samples, at the rate of the model [s]; NaN without samples.
        samples: (n_taxels, 3) by finger; empty if only faults arrived.
        reported: fingers of which this arrival reports a fault.
        hidden: faults by finger, and the reason why these fingers are UNKNOWN.
    """

    time: float
    samples: ModuleSamples
    reported: tuple[str, ...]
    hidden: tuple[tuple[FingerFaults, Reason], ...]


class SourceFilter:
    """Filter that makes samples for a detector of the arrivals of a source.

    It buffers the first half second, until it has measured the rate of the source. Of a
    sample-and-hold sensor it takes the true updates. It resamples a source whose rate is not
    within 20 % of the model's. It leaves out modules that the model does not use, and keeps the
    faults of the stream until the next sample of their finger. A finger has the fault SLOW while it
    updates under 30 times a second in rows that repeat the reading, or are zero.

    Args:
        fingers: sensor of each finger that the model uses.
        strict: refuse a rate that is not the model's instead of resampling.
        watch_rate: report the fault RATE while a finger has another rate than at the start.
        finds_pull: report a normal force below its first value, see `ReadingsMonitor`.

    Attributes:
        rate: measured rate of the source, of the true updates [Hz]; NaN while it is not known.
        resampled: whether the source is resampled to the model's rate.
        notices: messages for the user; the caller that passes them on clears the list.
    """

    def __init__(
        self, fingers: Mapping[str, Sensor], *, strict: bool, watch_rate: bool, finds_pull: bool
    ) -> None:
        self.rate, self.resampled = math.nan, False
        self.notices: list[str] = []
        self._fingers = fingers
        self._strict, self._watch_rate, self._finds_pull = strict, watch_rate, finds_pull
        # Empty from when the rate is known; the next three are made then.
        self._buffer: deque[Arrival] = deque(maxlen=MAX_BUFFERED_ARRIVALS)
        self._updates: dict[str, UpdateFilter] = {}  # empty if the sensors do not hold samples
        self._resamplers: dict[str, Resampler] = {}  # empty if the rate is the model's
        self._monitor: RateMonitor | None = None
        self._time = -math.inf  # of the newest samples that were resampled
        self._faults: dict[str, tuple[Fault, ...]] = {}  # until the next sample of the finger
        self._last_updates = {name: _Updates(sensor) for name, sensor in fingers.items()}
        self._silent: set[str] = set()  # set by `mark_silent`, until the next sample likewise
        self.compare_from_now()

    def compare_from_now(self) -> None:
        """Compare the readings with those that come now, as the hand is open now."""
        self._readings = ReadingsMonitor(self._fingers, finds_pull=self._finds_pull)

    def mark_silent(self) -> tuple[tuple[FingerFaults, Reason], ...]:
        """Hide every finger until its next sample; return what is hidden now."""
        self._silent = set(self._fingers)
        return self._hidden()

    def update(self, arrival: Arrival, model: Model) -> Iterator[FilteredSamples]:
        """Yield the samples and faults of an arrival; none while the rate is not known.

        Args:
            arrival: of the source.
            model: whose rate the samples get.

        Raises:
            ModelError: the rate is not the model's, and `strict`.
        """
        if not math.isnan(self.rate):
            yield from self._filter(arrival)
            return
        buffer = self._buffer
        if buffer and not (arrival.samples or buffer[-1].samples):
            # Joined, or a device that sends nothing but faults would push the samples out.
            arrival = arrival._replace(faults={**buffer.pop().faults, **arrival.faults})
        buffer.append(arrival)
        sampled = [earlier for earlier in buffer if earlier.samples]
        if not arrival.samples or arrival.time - sampled[0].time < RATE_MEASUREMENT_TIME:
            return
        rate = measure_rate(sampled, self._fingers)
        if rate is None:  # no steps of the model's fingers yet: the half second begins anew
            buffer.clear()
            buffer.append(arrival)
            return
        yield from self._begin(rate, model)

    def finish(self, model: Model) -> Iterator[FilteredSamples]:
        """Yield the samples of a source that ended before its rate was known."""
        sampled = [arrival for arrival in self._buffer if arrival.samples]
        if sampled:
            # A single sample has no step: then the rate of the model counts, or that of a sensor.
            nominal = next(iter(self._fingers.values())).rate
            rate = measure_rate(sampled, self._fingers) or model.rate or nominal
            yield from self._begin(rate, model)

    def _begin(self, rate: float, model: Model) -> Iterator[FilteredSamples]:
        """Choose what the rate [Hz] needs, and process the buffer."""
        # The true updates first, as offline: rows that repeat are no samples of a faster sensor.
        n_rows = measure_hold(self._buffer, self._fingers, rate)
        if n_rows > 1.0 and rate / n_rows >= MIN_UPDATE_RATE:
            self.notices.append(
                f"readings repeat in rows of {rate:.4g} Hz; the true updates are used, "
                f"{rate / n_rows:.4g} Hz"
            )
            rate /= n_rows
            self._updates = {
                name: UpdateFilter(rate, skips_zeros=not sensor.rests_at_zero)
                for name, sensor in self._fingers.items()
            }
        self.rate = rate
        if model.rate is not None and not model.rate_fits(rate):
            if self._strict:
                raise ModelError(
                    f"{rate:.4g} Hz given, the model expects {model.rate:g} Hz within 20 % "
                    "(--rate resample accepts it)"
                )
            self.resampled = True
            self._resamplers = {name: Resampler(rate, model.rate) for name in self._fingers}
        if self._watch_rate:
            self._monitor = RateMonitor(rate, self._fingers)
        buffered = list(self._buffer)
        self._buffer.clear()
        for arrival in buffered:
            yield from self._filter(arrival)

    def _filter(self, arrival: Arrival) -> Iterator[FilteredSamples]:
        if self._faults or self._silent:
            for name in arrival.samples:
                self._faults.pop(name, None)
                self._silent.discard(name)
        self._faults.update(arrival.faults)
        time, used = arrival.time, arrival.samples
        used = {name: used[name] for name in self._fingers if name in used}
        self._find_slow(used, time)
        if self._updates:
            used = {n: new for n, new in used.items() if self._updates[n].is_update(time, new)}
        if self._monitor is not None:
            self.notices += self._monitor.update(used, time)
            for name in self._monitor.changed & used.keys():
                self._faults[name] = (*self._faults.get(name, ()), Fault.RATE)
        self.notices += self._readings.update(used, time)
        hidden = self._hidden()
        if not used:
            reported = tuple(name for name in self._fingers if name in arrival.faults)
            if reported:
                yield FilteredSamples(math.nan, {}, reported, hidden)
        elif not self.resampled:
            yield FilteredSamples(time, used, (), hidden)
        else:
            instants: dict[float, dict[str, npt.NDArray[Any]]] = {}
            for name, sample in used.items():
                for when, value in self._resamplers[name].push(time, sample):
                    instants.setdefault(when, {})[name] = value
            for when in sorted(instants):
                # Every module has its own instants, and one may lag: times must increase.
                self._time = max(when, math.nextafter(self._time, math.inf))
                yield FilteredSamples(self._time, instants[when], (), hidden)

    def _find_slow(self, samples: ModuleSamples, time: float) -> None:
        """Add the fault SLOW to the fingers whose rows pretend a rate."""
        for name, sample in samples.items():
            self._last_updates[name].add(np.asarray(sample), time)
            if self._last_updates[name].is_slow:
                self._faults[name] = (*self._faults.get(name, ()), Fault.SLOW)

    def _hidden(self) -> tuple[tuple[FingerFaults, Reason], ...]:
        """Return the faults that hold now; a silent finger is rather a gap than a fault."""
        if not (self._faults or self._silent):  # nearly always
            return ()
        gap = dict.fromkeys(self._silent, (Fault.PACKET_GAP,))
        both = ((self._faults, Reason.FAULT), (gap, Reason.GAP))
        return tuple((dict(faults), reason) for faults, reason in both if faults)
