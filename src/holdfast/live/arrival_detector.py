"""Detect contact states from the arrivals of a source: no clock, no thread, no I/O."""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import (
    ContactEstimate,
    ContactState,
    Fault,
    HandEstimate,
    Reason,
    StateChanges,
    with_faults,
)
from holdfast.detector import Detector
from holdfast.detector.detector import check_thresholds
from holdfast.devices.sources.base import Arrival, ModuleSamples
from holdfast.errors import ModelError, StreamError
from holdfast.features import Tare
from holdfast.features.start import Start
from holdfast.live.readings_monitor import ReadingsMonitor
from holdfast.model import Model
from holdfast.recordings import BASELINES, GAP_PERIODS, STARTS_LOADED
from holdfast.resampling import MIN_UPDATE_RATE, Resampler, UpdateFilter, rows_per_update
from holdfast.sensors import Sensor

MAX_RATE_CHANGE = 0.2
"""A rate that differs by more than this from that at the start has changed."""
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
MIN_SILENCE_TIMEOUT = 0.1
"""Minimum time without samples after which a source counts as silent [s]."""


def measure_rate(arrivals: list[Arrival], fingers: Iterable[str]) -> float | None:
    """Return the median rate of the fingers, from steps without gaps [Hz]; None without steps."""
    rates = []
    for name in fingers:
        steps = np.diff([arrival.time for arrival in arrivals if name in arrival.samples])
        if len(steps):
            rates.append(1 / steps[steps <= GAP_PERIODS * np.median(steps)].mean())
    return float(np.median(rates)) if rates else None


def measure_hold(arrivals: list[Arrival], fingers: Iterable[str]) -> float:
    """Return how many rows the sensors hold each sample; 1 if one of them does not."""
    rows = []
    for name in fingers:
        samples = [arrival.samples[name] for arrival in arrivals if name in arrival.samples]
        if samples:
            changed = [not np.array_equal(*pair, equal_nan=True) for pair in pairwise(samples)]
            rows.append(rows_per_update([True, *changed]))
    return float(np.median(rows)) if rows and min(rows) > 1.0 else 1.0


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


class StreamEstimate(NamedTuple):
    """Estimate of the hand after an arrival.

    Attributes:
        estimate: of the hand and all its fingers.
        updated_fingers: fingers whose estimate is new: they have a sample, or their fault
            was reported, or their samples have been missing for too long.
    """

    estimate: HandEstimate
    updated_fingers: tuple[str, ...]


def _touches(finger: ContactEstimate) -> bool:
    return finger.state in (ContactState.STABLE, ContactState.UNSTABLE)


class ArrivalDetector:
    """Detector that takes arrivals instead of samples.

    It buffers the first half second until it has measured the rate of the source, then
    processes the buffer. Of a sample-and-hold sensor it uses the true updates. It resamples a
    source whose rate is not within 20 % of the model's.
    A finger is UNKNOWN while the source reports a fault of it. Modules that the model does
    not use are ignored. All other samples give the same estimates as in a recording of the same
    rate: a recording has the rate of all its samples, a stream that of its first half second.

    Args:
        model: with a tare that can be taken live.
        sensors: of the source, by module.
        strict: refuse a rate that is not the model's instead of resampling.
        ignore: indices by finger, from 0, of taxels that contribute nothing and cause no fault.
        watch_rate: report the fault RATE while a finger has another rate than at the start.
        metadata: of the source, which declare how it begins.

    Attributes:
        fingers: sensor of each finger that the model uses.
        notices: messages for the user since they were last taken from the list.
        rate: measured rate of the source [Hz]; NaN while it is not known.
        resampled: True if the source is resampled to the model's rate.
        thresholds: probability from which each finger is stable.

    Raises:
        ModelError: the source has none of the model's fingers, or another sensor.
    """

    def __init__(
        self,
        model: Model,
        sensors: Mapping[str, Sensor],
        *,
        strict: bool = False,
        ignore: Mapping[str, tuple[int, ...]] | None = None,
        watch_rate: bool = False,
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        tare = Tare.parse(model.tare)
        if tare.kind == "interval":
            raise ModelError(
                f"the model's tare is the interval {model.tare} s of a recording, which a live "
                "source does not have; train with --tare 0.5, first or none"
            )
        self.model = model
        self.fingers = dict(model.fingers_of(sensors))
        self.rate = math.nan
        self.resampled = False
        self.notices: list[str] = []
        self._watch_rate = watch_rate
        self._monitor: RateMonitor | None = None
        self._begin = Start.of(metadata or {}, self.fingers)
        self._finds_pull = tare.kind != "seconds" and not self._begin.loaded
        self._readings = ReadingsMonitor(self.fingers, finds_pull=self._finds_pull)
        self._strict = strict
        self._ignore = ignore
        self._buffer: deque[Arrival] = deque(maxlen=MAX_BUFFERED_ARRIVALS)
        self._detector: Detector | None = None
        self._new_detector(100.0)  # raises for wrong arguments
        self.thresholds = self._own_thresholds()
        self._resamplers: dict[str, Resampler] = {}
        self._filters: dict[str, UpdateFilter] = {}
        self._faults: dict[str, tuple[Fault, ...]] = {}
        self._silent_fingers: set[str] = set()
        self._last: HandEstimate | None = None
        self._changes = StateChanges(tuple(self.fingers))

    @property
    def silence_timeout(self) -> float:
        """Time without samples after which the source counts as silent [s]."""
        if math.isnan(self.rate):
            return MIN_SILENCE_TIMEOUT
        return max(GAP_PERIODS / self.rate, MIN_SILENCE_TIMEOUT)

    def update(self, arrival: Arrival) -> list[StreamEstimate]:
        """Process an arrival.

        Returns:
            The new estimates, oldest first; none while the rate is not known.

        Raises:
            ModelError: the rate is not the model's, and `strict`.
        """
        if self._detector is not None:
            return list(self._detect(self._detector, arrival))
        self._append_to_buffer(arrival)
        buffered = [earlier for earlier in self._buffer if earlier.samples]
        if not arrival.samples or arrival.time - buffered[0].time < RATE_MEASUREMENT_TIME:
            return []
        rate = measure_rate(buffered, self.fingers)
        if rate is None:  # no samples of the model's fingers yet
            self._buffer.clear()
            self._buffer.append(arrival)
            return []
        return self._start(rate)

    def finish(self) -> list[StreamEstimate]:
        """Return the estimates of a source that ended before its rate was known."""
        buffered = [arrival for arrival in self._buffer if arrival.samples]
        if self._detector is not None or not buffered:
            return []
        nominal = next(iter(self.fingers.values())).rate
        return self._start(measure_rate(buffered, self.fingers) or self.model.rate or nominal)

    def mark_silent(self) -> list[StreamEstimate]:
        """Set every finger to UNKNOWN, with the reason `gap`, until its next sample.

        Returns:
            The estimate; none if there was no estimate before.
        """
        if self._last is None:
            return []
        self._silent_fingers = set(self.fingers)
        return [StreamEstimate(self._with_stream_faults(self._last), tuple(self.fingers))]

    def restart_tare(self) -> None:
        """Discard the tare, and take a new one from the next samples.

        Raises:
            StreamError: a finger is in contact.
        """
        if self._detector is None or self._last is None:
            return
        touching = [name for name, finger in self._last.fingers.items() if _touches(finger)]
        if touching:
            raise StreamError(
                f"{', '.join(touching)} in contact: open the hand, then take the tare"
            )
        self._detector.reset(in_contact=False)
        self._readings = ReadingsMonitor(self.fingers, finds_pull=self._finds_pull)

    def set_threshold(self, threshold: float | None) -> None:
        """Change the probability from which a contact is stable, for all fingers.

        Args:
            threshold: from 0 to 1; None for the thresholds of the model.

        Raises:
            ValueError: the threshold is not from 0 to 1.
        """
        own = self._own_thresholds()
        wanted = own if threshold is None else dict.fromkeys(own, threshold)
        check_thresholds(wanted)
        if self._detector is not None:
            self._detector.set_thresholds(wanted)
        self.thresholds = wanted

    def set_model(self, model: Model) -> None:
        """Change the model to one of the same features; its thresholds replace those of now.

        Raises:
            ModelError: it has other features or another debouncing; nothing has changed then.
        """
        if self._detector is not None:
            self._detector.set_model(model)
        self.model = model
        self.thresholds = self._own_thresholds()

    def start_metadata(self) -> dict[str, Any]:
        """Return the metadata of a recording that begins now, which has the zero of this stream.

        Without it, the tare of the recording would be what the hand holds now.
        """
        if self._detector is None:
            return self._declared(self._begin.baselines) if self._begin.loaded else {}
        if self._detector.knows_zero:
            baselines = self._detector.baselines()
            return self._declared(baselines) if baselines else {}
        fingers = () if self._last is None else self._last.fingers.values()
        return {STARTS_LOADED: True} if any(_touches(finger) for finger in fingers) else {}

    def _declared(self, baselines: Mapping[str, npt.NDArray[np.float64]]) -> dict[str, Any]:
        """Return the metadata of samples that are load over some readings without contact."""
        stated = {}
        for name, values in baselines.items():
            kept = values.copy()
            kept[list((self._ignore or {}).get(name, ()))] = 0.0
            stated[name] = kept.tolist()
        return {STARTS_LOADED: True, **({BASELINES: stated} if stated else {})}

    def without_ignored(self, name: str, readings: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return (n, n_taxels, 3) readings of a finger, 0 in the taxels that are ignored."""
        taxels = list((self._ignore or {}).get(name, ()))
        if not taxels:
            return readings
        kept = readings.copy()
        kept[:, taxels] = 0
        return kept

    def _own_thresholds(self) -> dict[str, float]:
        return {
            name: self.model.finger(name, sensor).stable.threshold
            for name, sensor in self.fingers.items()
        }

    def subtract_tare(self, samples: ModuleSamples) -> dict[str, npt.NDArray[np.float64]]:
        """Return (n_taxels, 3) minus the tare, for the fingers whose tare is complete."""
        baselines = {} if self._detector is None else self._detector.baselines()
        return {
            name: samples[name] - baseline
            for name, baseline in baselines.items()
            if name in samples
        }

    def _append_to_buffer(self, arrival: Arrival) -> None:
        """Append an arrival; join consecutive arrivals without samples to one."""
        if self._buffer and not (arrival.samples or self._buffer[-1].samples):
            before = self._buffer.pop()
            arrival = arrival._replace(faults={**before.faults, **arrival.faults})
        self._buffer.append(arrival)

    def _start(self, rate: float) -> list[StreamEstimate]:
        """Create the detector for a rate, and process the buffer."""
        n_rows = measure_hold(list(self._buffer), self.fingers)
        if n_rows > 1.0 and rate / n_rows >= MIN_UPDATE_RATE:
            self.notices.append(
                f"readings repeat in rows of {rate:.4g} Hz; the true updates are used, "
                f"{rate / n_rows:.4g} Hz"
            )
            rate /= n_rows
            self._filters = {name: UpdateFilter(rate) for name in self.fingers}
        model, self.rate = self.model, rate
        if model.rate is not None and not model.rate_fits(rate):
            if self._strict:
                raise ModelError(
                    f"{rate:.4g} Hz given, the model expects {model.rate:g} Hz within 20 % "
                    "(--rate resample accepts it)"
                )
            self.resampled = True
            self._resamplers = {name: Resampler(rate, model.rate) for name in self.fingers}
        self._monitor = RateMonitor(rate, self.fingers) if self._watch_rate else None
        detector = self._new_detector(rate)
        detector.set_thresholds(self.thresholds)
        self._detector = detector
        buffered = list(self._buffer)
        self._buffer.clear()
        return [result for arrival in buffered for result in self._detect(detector, arrival)]

    def _new_detector(self, rate: float) -> Detector:
        return Detector(
            self.model, self.fingers, rate,
            ignore=self._ignore, in_contact=self._begin.loaded, baselines=self._begin.baselines,
        )  # fmt: skip

    def _detect(self, detector: Detector, arrival: Arrival) -> Iterator[StreamEstimate]:
        if self._faults or self._silent_fingers:
            for name in arrival.samples:
                self._faults.pop(name, None)
                self._silent_fingers.discard(name)
        self._faults.update(arrival.faults)
        used = {name: arrival.samples[name] for name in self.fingers if name in arrival.samples}
        if self._filters:
            used = {
                name: sample
                for name, sample in used.items()
                if self._filters[name].is_update(arrival.time, sample)
            }
        if self._monitor is not None:
            self._watch(self._monitor, used, arrival.time)
        self.notices += self._readings.update(used, arrival.time)
        for instant, samples in self._at_model_rate(arrival.time, used):
            self._last = detector.update(samples, instant)
            lost = [name for name in self._lost_fingers(self._last) if name not in samples]
            yield StreamEstimate(self._with_stream_faults(self._last), (*samples, *lost))
        if not used and self._last is not None:
            faulty = tuple(name for name in self.fingers if name in arrival.faults)
            if faulty:
                yield StreamEstimate(self._with_stream_faults(self._last), faulty)

    def _lost_fingers(self, estimate: HandEstimate) -> list[str]:
        """Return the fingers whose state has become UNKNOWN."""
        states = [finger.state for finger in estimate.fingers.values()]
        changes = self._changes.update(states, estimate.time)
        return [change.finger for change in changes if change.state is ContactState.UNKNOWN]

    def _watch(self, monitor: RateMonitor, samples: ModuleSamples, instant: float) -> None:
        """Report a change of the rate of fingers as a fault and a notice."""
        self.notices += monitor.update(samples, instant)
        for name in monitor.changed & samples.keys():
            self._faults[name] = (*self._faults.get(name, ()), Fault.RATE)

    def _with_stream_faults(self, estimate: HandEstimate) -> HandEstimate:
        """Return the estimate with the faults of the source, and with silent fingers."""
        n_fingers = 0 if self._detector is None else self._detector.n_fingers
        if self._faults:
            estimate = with_faults(estimate, self._faults, n_fingers)
        if self._silent_fingers:
            gap = dict.fromkeys(self._silent_fingers, (Fault.PACKET_GAP,))
            estimate = with_faults(estimate, gap, n_fingers, Reason.GAP)
        return estimate

    def _at_model_rate(
        self, instant: float, samples: ModuleSamples
    ) -> Iterator[tuple[float, ModuleSamples]]:
        """Yield the samples unchanged, or resampled to the model's rate."""
        if not self.resampled:
            if samples:
                yield instant, samples
            return
        resampled: dict[float, dict[str, npt.NDArray[Any]]] = {}
        for name, sample in samples.items():
            for when, value in self._resamplers[name].push(instant, sample):
                resampled.setdefault(when, {})[name] = value
        last = -math.inf if self._last is None else self._last.time
        for when in sorted(resampled):
            last = max(when, math.nextafter(last, math.inf))
            yield last, resampled[when]
