"""Detect contact states from a live source. `StreamDetector` reads it and owns the only clock."""

import math
import time
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import (
    LASTING_DURATION,
    ContactEvent,
    ContactState,
    HandEstimate,
    StateChanges,
)
from holdfast.detector import HAND
from holdfast.devices.sources import Arrival, Source
from holdfast.devices.sources.base import DeviceSource, ModuleSamples
from holdfast.live.arrival_detector import ArrivalDetector, StreamEstimate
from holdfast.model import Model
from holdfast.recordings import STARTS_LOADED


class StreamUpdate(NamedTuple):
    """Result of one reading of a source.

    Attributes:
        arrival: the arrival; None if nothing arrived in time.
        estimates: the new estimates, oldest first.
        events: the changes of contact state.
    """

    arrival: Arrival | None
    estimates: list[StreamEstimate]
    events: list[ContactEvent]


class StreamDetector:
    """Detect the contact states of a hand from a source, while its samples arrive.

    It merges the modules by time, resamples the source to the model's rate, adds the faults of
    the transport, and ignores modules that the model does not use. A source without samples of
    any used finger is silent: every finger is then UNKNOWN, also while the source reports
    faults or notices.

    Iterate over it to get every `HandEstimate`, use `changes` to get the changes of state that
    lasted, or call `read` in a loop of your own.

    Args:
        model: with a tare that can be taken live.
        source: an open source.
        strict: refuse a rate that is not the model's instead of resampling.
        ignore: indices by finger, from 0, of taxels that contribute nothing and cause no fault.
        in_contact: the first samples are load, and not an open hand; also if the metadata of the
            source say so (`starts_loaded`).

    Attributes:
        source: the source.
        fingers: sensor of each finger that the model uses.
        silent: True while no samples arrive.
        start: time of the first estimate [s]; NaN before it. Clocks of devices count from 1970,
            so that a person can read `change.time - detector.start` rather than `change.time`.

    Raises:
        ModelError: the source has none of the model's fingers, or another sensor; or the
            model's tare is an interval of a recording.
        ValueError: `ignore` names a finger or a taxel that does not exist.

    Example:
        A recording serves as the source here. A device works in the same way:
        `open_source("xela://auto")`.

        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> from holdfast import Model, StreamDetector, open_source, save_recording
        >>> from holdfast.synthetic import synthetic_recording
        >>> folder = TemporaryDirectory()
        >>> uri = str(Path(folder.name) / "grasp.parquet")
        >>> save_recording(synthetic_recording("grasp", seed=1), uri)
        >>> model = Model.load("builtin:twin")
        >>> states = []
        >>> with open_source(uri, speed=0) as source:
        ...     for estimate in StreamDetector(model, source):
        ...         states.append(estimate.state.value)
        >>> len(states), sorted(set(states))
        (1725, ['NO_CONTACT', 'STABLE', 'UNKNOWN', 'UNSTABLE'])
        >>> folder.cleanup()
    """

    def __init__(
        self,
        model: Model,
        source: Source,
        *,
        strict: bool = False,
        ignore: Mapping[str, tuple[int, ...]] | None = None,
        in_contact: bool = False,
    ) -> None:
        self.source = source
        self.silent = False
        self.start = math.nan
        self._detector = ArrivalDetector(
            model, source.sensors, strict=strict, ignore=ignore,
            watch_rate=isinstance(source, DeviceSource),
            metadata={**source.metadata, STARTS_LOADED: True} if in_contact else source.metadata,
        )  # fmt: skip
        self.fingers = self._detector.fingers
        self._changes = StateChanges((*self.fingers, HAND))
        self._slowdown = 1 / min(source.speed or 1.0, 1.0)
        self._last_sample_at = time.monotonic()

    def __iter__(self) -> Iterator[HandEstimate]:
        """Yield the estimates until the source ends."""
        while not self.source.ended:
            for estimate, _ in self.read().estimates:
                yield estimate
        for estimate, _ in self.finish().estimates:
            yield estimate

    def changes(self, min_duration: float = LASTING_DURATION) -> Iterator[ContactEvent]:
        """Yield the changes of each finger and of the hand that lasted, until the source ends.

        A change is yielded when the new state has lasted, with the time at which it began. For
        control, use the estimates: they come without this delay.

        Args:
            min_duration: minimum time that a new state must last [s].

        Raises:
            ValueError: the duration is negative or not finite.
        """
        lasting = StateChanges((*self.fingers, HAND), min_duration)
        for estimate in self:
            yield from lasting.update(_states(estimate), estimate.time)

    @property
    def rate(self) -> float:
        """Measured rate of the source [Hz]; NaN during the first half second."""
        return self._detector.rate

    @property
    def resampled(self) -> bool:
        """True if the source is resampled to the model's rate."""
        return self._detector.resampled

    @property
    def thresholds(self) -> Mapping[str, float]:
        """Probability from which each finger is stable."""
        return self._detector.thresholds

    def set_threshold(self, threshold: float | None) -> None:
        """Change the probability from which a contact is stable, for all fingers.

        Args:
            threshold: from 0 to 1; None for the thresholds of the model.

        Raises:
            ValueError: the threshold is not from 0 to 1.
        """
        self._detector.set_threshold(threshold)

    @property
    def model(self) -> Model:
        """The model that decides now."""
        return self._detector.model

    def set_model(self, model: Model) -> None:
        """Change the model to one of the same features, such as the model with own handling.

        States and filters continue: nothing warms up again. The thresholds are those of the model.

        Raises:
            ModelError: it has other features or another debouncing; nothing has changed then.
        """
        self._detector.set_model(model)

    def start_metadata(self) -> dict[str, Any]:
        """Return the metadata of a recording that begins now, which has the zero of this stream."""
        return self._detector.start_metadata()

    def without_ignored(self, name: str, readings: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return (n, n_taxels, 3) readings of a finger, 0 in the taxels that are ignored."""
        return self._detector.without_ignored(name, readings)

    def read(self) -> StreamUpdate:
        """Read the source once, and process what arrived.

        It blocks until something arrives or the source counts as silent: 0.1 s, or three
        sample periods if that is longer.

        Raises:
            ModelError: the rate is not the model's, and `strict`.
        """
        timeout = self._detector.silence_timeout * self._slowdown
        arrival = self.source.read(timeout)
        estimates = [] if arrival is None else self._detector.update(arrival)
        if arrival is not None and not self.fingers.keys().isdisjoint(arrival.samples):
            self.silent = False
            self._last_sample_at = time.monotonic()
        elif not (self.silent or self.source.ended) and self._timed_out(arrival, timeout):
            self.silent = True
            estimates += self._detector.mark_silent()
        if arrival is not None and self._detector.notices:
            arrival = arrival._replace(notices=(*arrival.notices, *self._detector.notices))
            self._detector.notices.clear()
        return self._update(arrival, estimates)

    def finish(self) -> StreamUpdate:
        """Return the estimates of a source that ended before its rate was known."""
        return self._update(None, self._detector.finish())

    def restart_tare(self) -> None:
        """Discard the tare, and take a new one from the next samples.

        Raises:
            StreamError: a finger is in contact.
        """
        self._detector.restart_tare()

    def subtract_tare(self, samples: ModuleSamples) -> dict[str, npt.NDArray[np.float64]]:
        """Return (n_taxels, 3) minus the tare, for the fingers whose tare is complete."""
        return self._detector.subtract_tare(samples)

    def _timed_out(self, arrival: Arrival | None, timeout: float) -> bool:
        """Return whether samples of the fingers have been missing for `timeout` [s]."""
        if arrival is None:
            return True
        # A source that is not paced does not keep real time.
        return self.source.paced and time.monotonic() - self._last_sample_at >= timeout

    def _update(self, arrival: Arrival | None, estimates: list[StreamEstimate]) -> StreamUpdate:
        if estimates and math.isnan(self.start):
            self.start = estimates[0].estimate.time
        events = [event for estimate, _ in estimates for event in self._events(estimate)]
        return StreamUpdate(arrival, estimates, events)

    def _events(self, estimate: HandEstimate) -> list[ContactEvent]:
        return self._changes.update(_states(estimate), estimate.time)


def _states(estimate: HandEstimate) -> list[ContactState]:
    """Return the states of the fingers, then that of the hand."""
    return [*(finger.state for finger in estimate.fingers.values()), estimate.state]
