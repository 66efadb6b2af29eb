"""Buffer of the samples, markers and packet statistics of a recording, before they are written."""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.contact import Fault
from holdfast.devices.sources import Arrival
from holdfast.devices.sources.base import MARKER_PREFIX
from holdfast.io.header import NUMBER_TYPES
from holdfast.recordings import GAP_PERIODS
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

MARKER_REPEAT_INTERVAL = 1.0
"""Minimum time between two markers of the same notice [s]."""
RECENT_FAULT_AGE = 1.0
"""Maximum age of a fault that counts as recent [s]."""
MAX_NOTICES = 100
"""Maximum number of different notices that become markers within `MARKER_REPEAT_INTERVAL`."""
MAX_PENDING_MARKERS = 2048
"""Maximum number of markers that wait for the first sample, or to be written."""
MAX_MARKER_LENGTH = 200
"""Maximum length of a marker [characters]; longer ones are cut."""

_N_STEPS = 32
"""Number of newest time steps from which the period is estimated."""
_MIN_STEPS = 4
"""Minimum number of steps for that; with fewer, the period is the sensor's."""


class ModuleBuffer:
    """Buffer of the samples of one module that are not written yet.

    Args:
        sensor: of the module.

    Attributes:
        n_samples: samples that were appended.
        n_gaps: time steps longer than three periods; the period is the median of the newest
            steps.
    """

    def __init__(self, sensor: Sensor) -> None:
        self.n_samples = self.n_gaps = 0
        self._sensor = sensor
        self._dtype: np.dtype[Any] | None = None  # of the first sample: a file has one
        self._last_time = -math.inf
        # Gaps are counted when samples are written: the step from the last chunk, and the newest
        # steps, whose median is the period.
        self._last_popped_time = math.nan
        self._steps: Array = np.empty(0)
        self._times: list[float] = []
        self._readings: list[npt.NDArray[Any]] = []

    def append(self, time: float, readings: npt.NDArray[Any]) -> bool:
        """Append a sample. Return False if its shape, dtype or time cannot be stored."""
        if not self._last_time < time < math.inf or readings.shape != (self._sensor.n_taxels, 3):
            return False
        if self._dtype is None and readings.dtype.name in NUMBER_TYPES:
            self._dtype = readings.dtype
        kept = readings
        if readings.dtype != self._dtype:
            if self._dtype is None or readings.dtype.kind not in "biuf":
                return False
            with np.errstate(invalid="ignore", over="ignore"):
                kept = readings.astype(self._dtype)
                back = kept.astype(readings.dtype)  # comparing int64 with float64 rounds
            # A file has one number type: what does not keep its value in it is not stored.
            nan = self._dtype.kind == "f"
            if not all(np.array_equal(x, readings, equal_nan=nan) for x in (kept, back)):
                return False
        self._times.append(time)
        self._readings.append(kept)
        self._last_time = time
        self.n_samples += 1
        return True

    def pop_samples(self) -> tuple[Array, npt.NDArray[Any]]:
        """Remove and return times (n,) [s] and readings (n, n_taxels, 3)."""
        times, readings = np.array(self._times), np.array(self._readings)
        self._times.clear()
        self._readings.clear()
        if len(times):
            steps = np.diff(times, prepend=self._last_popped_time)
            steps = steps[~np.isnan(steps)]  # there is no step before the first sample
            self._steps = np.concatenate([self._steps, steps])[-_N_STEPS:]
            is_measured = len(self._steps) >= _MIN_STEPS
            period = float(np.median(self._steps)) if is_measured else 1 / self._sensor.rate
            self.n_gaps += int((steps > GAP_PERIODS * period).sum())
            self._last_popped_time = self._last_time
        return times, readings


class ArrivalBuffer:
    """Buffer incoming samples, markers and packet statistics of a recording, by module.

    It has no clock, and serves one thread.

    Args:
        sensors: of the modules to record; samples of other modules are ignored.

    Attributes:
        modules: buffer of each module.
        first_time: time of the first sample [s]; NaN before.
        newest_time: time of the newest sample [s]; NaN before.
        n_samples: instants with at least one sample.
        n_lost: packets that are missing by the device's own count.
        n_refused: packets that could not be decoded.
        n_rejected: instants with samples that could not be stored: wrong shape or number type,
            or a time that is not later than the last.
        faults: number of arrivals that reported each fault.
    """

    def __init__(self, sensors: Mapping[str, Sensor]) -> None:
        self.modules = {module: ModuleBuffer(sensor) for module, sensor in sensors.items()}
        self.first_time = self.newest_time = math.nan
        self.n_samples = self.n_lost = self.n_refused = self.n_rejected = 0
        self.faults: Counter[Fault] = Counter()
        # By module: the faults that last, so that a marker is set where one begins only.
        self._active_faults: dict[str, tuple[Fault, ...]] = {}
        # When an arrival reported each fault last, for `recent_faults`.
        self._fault_times: dict[tuple[str, Fault], float] = {}
        # When each text became a marker last: a notice that repeats fills no file.
        self._notice_times: dict[str, float] = {}
        self._markers: list[tuple[float, str]] = []

    def add(self, arrival: Arrival) -> None:
        """Add the samples, faults and notices of an arrival."""
        self.n_lost += arrival.n_lost
        self.n_refused += arrival.n_refused
        if arrival.samples:
            rejected, n_appended = [], 0
            for module, readings in arrival.samples.items():
                if buffer := self.modules.get(module):
                    appended = buffer.append(arrival.time, readings)
                    n_appended += appended
                    rejected += [module] * (not appended)
            if n_appended:
                self.n_samples += 1
                self.newest_time = arrival.time
                if math.isnan(self.first_time):
                    self.first_time = arrival.time
            if rejected:
                self.n_rejected += 1
                text = f"note: a sample of {', '.join(rejected)} cannot be stored: dropped"
                self.add_notice(text, arrival.received)
        if arrival.faults or self._active_faults:
            self._add_faults(arrival)
        for notice in arrival.notices:
            if notice.startswith(MARKER_PREFIX):
                self.add_marker(math.nan, notice.removeprefix(MARKER_PREFIX))
            else:
                self.add_notice(f"note: {notice}", arrival.received)

    def add_marker(self, time: float, text: str) -> None:
        """Add a marker; if the time is not finite, at the newest sample."""
        if len(self._markers) < MAX_PENDING_MARKERS:
            when = time if math.isfinite(time) else self.newest_time
            self._markers.append((when, marker_text(text)))

    def pop_markers(self) -> list[tuple[float, str]]:
        """Remove and return the markers (time [s], text); none before the first sample."""
        if math.isnan(self.first_time):
            return []
        first = self.first_time
        markers = [(first if math.isnan(time) else time, text) for time, text in self._markers]
        self._markers.clear()
        return markers

    def add_notice(self, text: str, received: float) -> None:
        """Add a notice as a marker, unless the same notice became one within the last second.

        Args:
            text: of the marker.
            received: when the notice arrived, by `time.monotonic` [s].
        """
        if received - self._notice_times.get(text, -math.inf) < MARKER_REPEAT_INTERVAL:
            return
        self._notice_times = {
            note: when
            for note, when in self._notice_times.items()
            if received - when < MARKER_REPEAT_INTERVAL
        }
        if len(self._notice_times) < MAX_NOTICES:
            self._notice_times[text] = received
            self.add_marker(math.nan, text)

    def recent_faults(self, now: float) -> dict[str, tuple[Fault, ...]]:
        """Return the faults of each module within the last second.

        Args:
            now: by `time.monotonic` [s].
        """
        recent: dict[str, tuple[Fault, ...]] = {}
        for (module, fault), when in self._fault_times.copy().items():
            if now - when < RECENT_FAULT_AGE:
                recent[module] = (*recent.get(module, ()), fault)
        return recent

    def _add_faults(self, arrival: Arrival) -> None:
        """Count the faults, and add a marker for each that begins.

        A fault lasts until the next arrival with samples of the module, or with another list
        of its faults.
        """
        begun: dict[Fault, list[str]] = {}
        for module in self.modules:
            faults = arrival.faults.get(module, ())
            for fault in faults:
                self._fault_times[module, fault] = arrival.received
                if fault not in self._active_faults.get(module, ()):
                    begun.setdefault(fault, []).append(module)
            if faults:
                self._active_faults[module] = faults
            elif module in arrival.samples or module in arrival.faults:
                self._active_faults.pop(module, None)
        self.faults.update({fault for faults in arrival.faults.values() for fault in faults})
        for fault, modules in begun.items():
            for module in modules if len(modules) < len(self.modules) else ["all"]:
                self.add_notice(f"fault {module} {fault}", arrival.received)


def marker_text(text: str) -> str:
    """Return a text as one line of printable characters, at most `MAX_MARKER_LENGTH` long."""
    line = " ".join(text.split())[:MAX_MARKER_LENGTH]
    return "".join(character if character.isprintable() else "?" for character in line)
