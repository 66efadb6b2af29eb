"""What arrives, sorted for a recording: samples by module, words as markers, and counts."""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.contact import Fault
from holdfast.io.header import NUMBERS
from holdfast.recordings import GAP_PERIODS
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array
from holdfast.sources import Arrival

AGAIN = 1.0
"""The same words become a marker again after so long [s]."""
NOW = 1.0
"""A fault that was told of so recently is there now [s]."""
MOST_WORDS = 100
"""So many different words become markers within `AGAIN`; of a device that babbles, no more."""
MOST_MARKERS = 2048
"""So many markers wait at most, for the first sample or to be written."""
MOST_TEXT = 200
"""Longer markers are cut."""

_MARKER = "marker: "
"""How a recording that is played tells of its own markers."""
_N_STEPS = 32
_N_STEPS_LEAST = 4


class Track:
    """What came of one module, and what of it is not written yet.

    Args:
        sensor: of the module.

    Attributes:
        n_samples: that were taken.
        n_gaps: steps in time longer than three periods, the period being the median of the
            newest steps.
    """

    def __init__(self, sensor: Sensor) -> None:
        self.n_samples = self.n_gaps = 0
        self._sensor = sensor
        self._number: np.dtype[Any] | None = None
        self._last = -math.inf
        self._drained = math.nan
        self._steps: Array = np.empty(0)
        self._times: list[float] = []
        self._readings: list[npt.NDArray[Any]] = []

    def take(self, time: float, readings: npt.NDArray[Any]) -> bool:
        """Takes a sample, unless no file could hold it; whether it did."""
        if not self._last < time < math.inf or readings.shape != (self._sensor.n_taxels, 3):
            return False
        if self._number is None and readings.dtype.name in NUMBERS:
            self._number = readings.dtype
        kept = readings if readings.dtype == self._number else _as(readings, self._number)
        if kept is None:
            return False
        self._times.append(time)
        self._readings.append(kept)
        self._last = time
        self.n_samples += 1
        return True

    def drain(self) -> tuple[Array, npt.NDArray[Any]]:
        """Times (n,) and readings (n, n_taxels, 3) that were taken since the last time."""
        times, readings = np.array(self._times), np.array(self._readings)
        self._times.clear()
        self._readings.clear()
        if len(times):
            self._count_gaps(np.diff(times, prepend=self._drained))
            self._drained = self._last
        return times, readings

    def _count_gaps(self, steps: Array) -> None:
        steps = steps[~np.isnan(steps)]  # nothing comes before the first sample
        self._steps = np.concatenate([self._steps, steps])[-_N_STEPS:]
        known = len(self._steps) >= _N_STEPS_LEAST
        period = float(np.median(self._steps)) if known else 1 / self._sensor.rate
        self.n_gaps += int((steps > GAP_PERIODS * period).sum())


class RecordingBuffer:
    """Sorts arrivals into tracks and markers; has no clock and is for one thread.

    Args:
        sensors: of the modules that are recorded; what comes of others is left out.

    Attributes:
        tracks: by module.
        first: time of the first sample [s]; NaN before.
        newest: time of the newest sample [s]; NaN before.
        n_samples: instants that have a sample.
        n_lost: packets that are missing by the device's own count.
        n_refused: packets that made no sense.
        n_unfit: samples of which some or all could not be kept: of another shape, number type,
            or not later than the last.
        faults: how many arrivals told of each.
    """

    def __init__(self, sensors: Mapping[str, Sensor]) -> None:
        self.tracks = {module: Track(sensor) for module, sensor in sensors.items()}
        self.first = self.newest = math.nan
        self.n_samples = self.n_lost = self.n_refused = self.n_unfit = 0
        self.faults: Counter[Fault] = Counter()
        self._there: dict[str, tuple[Fault, ...]] = {}
        self._told: dict[tuple[str, Fault], float] = {}
        self._said: dict[str, float] = {}
        self._markers: list[tuple[float, str]] = []

    def take(self, arrival: Arrival) -> None:
        """Takes the samples and the words of an arrival."""
        self.n_lost += arrival.n_lost
        self.n_refused += arrival.n_refused
        if arrival.samples:
            self._take_samples(arrival)
        if arrival.faults or self._there:
            self._take_faults(arrival)
        for notice in arrival.notices:
            if notice.startswith(_MARKER):
                self.mark(math.nan, notice.removeprefix(_MARKER))
            else:
                self.say(f"note: {notice}", arrival.received)

    def mark(self, time: float, text: str) -> None:
        """Takes a marker; where the time is not finite, at the newest sample."""
        if len(self._markers) < MOST_MARKERS:
            self._markers.append((time if math.isfinite(time) else self.newest, plain(text)))

    def drain_markers(self) -> list[tuple[float, str]]:
        """Times and texts of the markers since the last time; none before the first sample."""
        if math.isnan(self.first):
            return []
        markers = [(self.first if math.isnan(time) else time, text) for time, text in self._markers]
        self._markers.clear()
        return markers

    def say(self, text: str, received: float) -> None:
        """Makes words a marker, unless the same were said within the last second."""
        if received - self._said.get(text, -math.inf) < AGAIN:
            return
        self._said = {one: when for one, when in self._said.items() if received - when < AGAIN}
        if len(self._said) < MOST_WORDS:
            self._said[text] = received
            self.mark(math.nan, text)

    def faulty(self, now: float) -> dict[str, tuple[Fault, ...]]:
        """The faults that each module had within the last second."""
        recent: dict[str, tuple[Fault, ...]] = {}
        for (module, fault), when in self._told.copy().items():
            if now - when < NOW:
                recent[module] = (*recent.get(module, ()), fault)
        return recent

    def _take_samples(self, arrival: Arrival) -> None:
        unfit, n_taken = [], 0
        for module, readings in arrival.samples.items():
            if track := self.tracks.get(module):
                taken = track.take(arrival.time, readings)
                n_taken += taken
                unfit += [module] * (not taken)
        if n_taken:
            self.n_samples += 1
            self.newest = arrival.time
            if math.isnan(self.first):
                self.first = arrival.time
        if unfit:
            self.n_unfit += 1
            self.say(f"note: a sample of {', '.join(unfit)} is unfit: dropped", arrival.received)

    def _take_faults(self, arrival: Arrival) -> None:
        """Counts faults, and says which begin; they last as `Arrival` tells."""
        begun: dict[Fault, list[str]] = {}
        for module in self.tracks:
            faults = arrival.faults.get(module, ())
            for fault in faults:
                self._told[module, fault] = arrival.received
                if fault not in self._there.get(module, ()):
                    begun.setdefault(fault, []).append(module)
            if faults:
                self._there[module] = faults
            elif module in arrival.samples or module in arrival.faults:
                self._there.pop(module, None)
        self.faults.update({fault for faults in arrival.faults.values() for fault in faults})
        for fault, modules in begun.items():
            for module in modules if len(modules) < len(self.tracks) else ["all"]:
                self.say(f"fault {module} {fault}", arrival.received)


def plain(text: str) -> str:
    """A marker's text: one line of what can be printed, of bounded length."""
    words = " ".join(text.split())[:MOST_TEXT]
    return "".join(sign if sign.isprintable() else "?" for sign in words)


def _as(readings: npt.NDArray[Any], number: np.dtype[Any] | None) -> npt.NDArray[Any] | None:
    """The readings in that number type, where it holds every one of them; else None."""
    if number is None or readings.dtype.kind not in "biuf":
        return None
    with np.errstate(invalid="ignore", over="ignore"):
        cast = readings.astype(number)
        back = cast.astype(readings.dtype)  # comparing int64 with float64 rounds
    same = all(np.array_equal(one, readings, equal_nan=number.kind == "f") for one in (cast, back))
    return cast if same else None
