"""Detect contact states from a live source. `StreamDetector` reads it and owns the only clock."""

import math
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import (
    LASTING_DURATION,
    ContactEvent,
    ContactState,
    HandEstimate,
    StateChanges,
    with_faults,
)
from holdfast.detection import HAND, Detector, Model, Tare
from holdfast.detection.detector import check_thresholds
from holdfast.detection.plan import Start
from holdfast.devices.sources import Arrival, Source
from holdfast.devices.sources.base import ModuleSamples
from holdfast.errors import ModelError, SourceError, StreamError
from holdfast.live.source_filter import FilteredSamples, SourceFilter
from holdfast.recordings import BASELINES, GAP_PERIODS, STARTS_LOADED

MIN_SILENCE_TIMEOUT = 0.1
"""Minimum time without samples after which a source counts as silent [s]."""
TOUCHING = (ContactState.STABLE, ContactState.UNSTABLE)
"""States of a finger that touches something."""


class StreamEstimate(NamedTuple):
    """Estimate of the hand after an arrival.

    Attributes:
        estimate: of the hand and all its fingers.
        updated_fingers: fingers whose estimate is new: they have a sample, or their fault
            was reported, or their samples have been missing for too long.
    """

    estimate: HandEstimate
    updated_fingers: tuple[str, ...]


class StreamUpdate(NamedTuple):
    """Result of one reading of a source.

    Attributes:
        arrival: the arrival, with the notices of the detector; None if nothing arrived in time.
        estimates: the new estimates, oldest first.
        events: the changes of contact state.
    """

    arrival: Arrival | None
    estimates: list[StreamEstimate]
    events: list[ContactEvent]


class StreamDetector:
    """Detect the contact states of a hand from a source, while its samples arrive.

    It merges the modules by time, resamples the source to the model's rate, adds the faults of
    the transport, and ignores modules that the model does not use (`SourceFilter`). A source
    without samples of any used finger is silent: every finger is then UNKNOWN, also while the
    source reports faults or notices. All other samples give the same estimates as in a recording
    of the same rate: a recording has the rate of all its samples, a stream that of its first half
    second.

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
        model: the model.
        fingers: sensor of each finger that the model uses.
        thresholds: probability from which each finger is stable; change it by `set_threshold`.
        rate: measured rate of the source [Hz]; NaN during the first half second.
        resampled: True if the source is resampled to the model's rate.
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
        model: Model | str | Path,
        source: Source,
        *,
        strict: bool = False,
        ignore: Mapping[str, tuple[int, ...]] | None = None,
        in_contact: bool = False,
    ) -> None:
        model = Model.of(model)
        tare = Tare.parse(model.tare)
        if tare.kind == "interval":
            raise ModelError(
                f"the model's tare is the interval {model.tare} s of a recording, which a live "
                "source does not have; train with --tare 0.5, first or none"
            )
        self.source, self.model = source, model
        self.fingers = dict(model.fingers_of(source.sensors))
        self.rate, self.resampled = math.nan, False
        self.silent, self.start = False, math.nan
        metadata = {**source.metadata, STARTS_LOADED: True} if in_contact else source.metadata
        self._begin = Start.of(metadata, self.fingers)
        self._ignore = ignore or {}
        self._filter = SourceFilter(
            self.fingers,
            strict=strict,
            watch_rate=source.is_device,
            # A tare of seconds finds a load at the start itself, as the fault `tare_loaded`.
            finds_pull=tare.kind != "seconds" and not self._begin.loaded,
        )
        self._detector: Detector | None = None  # made when the rate is known
        self._new_detector(100.0)  # at any rate: it raises for wrong arguments
        self.set_threshold(None)
        self._last: HandEstimate | None = None  # from the readings alone, without `hidden`
        self._changes = StateChanges()
        # A source slower than real time sends its samples later; a faster one keeps the timeout.
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
        lasting = StateChanges(min_duration)
        for estimate in self:
            yield from lasting.update(_states(estimate), estimate.time)

    @property
    def silence_timeout(self) -> float:
        """Time without samples after which the source counts as silent [s]."""
        # The rate is NaN at first: `max` then returns its first argument.
        return max(MIN_SILENCE_TIMEOUT, GAP_PERIODS / self.rate)

    def read(self) -> StreamUpdate:
        """Read the source once, and process what arrived.

        It blocks until something arrives or the source counts as silent: 0.1 s, or three
        sample periods if that is longer.

        Raises:
            ModelError: the rate is not the model's, and `strict`.
        """
        timeout = self.silence_timeout * self._slowdown
        arrival = self.source.read(timeout)
        if arrival is not None and not self.fingers.keys().isdisjoint(arrival.samples):
            self.silent = False
            self._last_sample_at = time.monotonic()
            return self.update(arrival)
        # A source that is not paced does not keep real time: only a read that times out is silence.
        timed_out = arrival is None or (
            self.source.paced and time.monotonic() - self._last_sample_at >= timeout
        )
        return self.update(arrival, silent=timed_out and not (self.silent or self.source.ended))

    def update(self, arrival: Arrival | None, *, silent: bool = False) -> StreamUpdate:
        """Process an arrival, without a look at the clock.

        Args:
            arrival: of the source; None if nothing arrived.
            silent: make every finger UNKNOWN, with the reason `gap`, until its next sample.

        Returns:
            No estimates while the rate is not known.

        Raises:
            ModelError: the rate is not the model's, and `strict`.
        """
        estimates: list[StreamEstimate] = []
        if arrival is not None:
            estimates = self._detect(self._filter.update(arrival, self.model))
        if silent:
            self.silent = True
            if self._last is not None:
                gap = FilteredSamples(math.nan, {}, tuple(self.fingers), self._filter.mark_silent())
                estimates += self._detect([gap])
        if arrival is not None and self._filter.notices:
            arrival = arrival._replace(notices=(*arrival.notices, *self._filter.notices))
            self._filter.notices.clear()
        return self._update_of(arrival, estimates)

    def finish(self) -> StreamUpdate:
        """Return the estimates of a source that ended before its rate was known."""
        return self._update_of(None, self._detect(self._filter.finish(self.model)))

    def set_threshold(self, threshold: float | None) -> None:
        """Change the probability from which a contact is stable, for all fingers.

        Args:
            threshold: from 0 to 1; None for the thresholds of the model.

        Raises:
            ValueError: the threshold is not from 0 to 1.
        """
        limits = {
            name: self.model.finger(name, s).stable.threshold for name, s in self.fingers.items()
        }
        thresholds = limits if threshold is None else dict.fromkeys(limits, threshold)
        check_thresholds(thresholds)
        if self._detector is not None:
            self._detector.set_thresholds(thresholds)
        self.thresholds = thresholds

    def restart_tare(self) -> None:
        """Discard the tare, and take a new one from the next samples.

        Raises:
            SourceError: the source is silent.
            StreamError: a finger is in contact.
        """
        if self.silent:
            raise SourceError("no samples arrive: no tare can be taken")
        if self._detector is None or self._last is None:
            return
        touching = [name for name, x in self._last.fingers.items() if x.state in TOUCHING]
        if touching:
            raise StreamError(
                f"{', '.join(touching)} in contact: open the hand, then take the tare"
            )
        self._detector.reset(in_contact=False)
        self._filter.compare_from_now()

    def start_metadata(self) -> dict[str, Any]:
        """Return the metadata of a recording that begins with this stream, and has its zero."""
        if not self._begin.loaded:
            return {}
        stated = {name: values.tolist() for name, values in self._begin.baselines.items()}
        return {STARTS_LOADED: True, **({BASELINES: stated} if stated else {})}

    def subtract_tare(self, samples: ModuleSamples) -> dict[str, npt.NDArray[np.float64]]:
        """Return (n_taxels, 3) minus the tare, for the fingers whose tare is complete."""
        baselines = {} if self._detector is None else self._detector.baselines()
        return {name: samples[name] - zero for name, zero in baselines.items() if name in samples}

    def _new_detector(self, rate: float) -> Detector:
        return Detector(
            self.model, self.fingers, rate,
            ignore=self._ignore, in_contact=self._begin.loaded, baselines=self._begin.baselines,
        )  # fmt: skip

    def _detect(self, filtered: Iterable[FilteredSamples]) -> list[StreamEstimate]:
        estimates = []
        for instant, samples, reported, hidden in filtered:
            if self._detector is None:
                self.rate, self.resampled = self._filter.rate, self._filter.resampled
                self._detector = self._new_detector(self.rate)
                self._detector.set_thresholds(self.thresholds)
            before, updated = self._last, reported
            if samples:
                self._last = self._detector.update(samples, instant)
                updated = tuple(samples)
                # A finger without a sample may have become UNKNOWN, because its gap is too long.
                if before is not None and len(samples) < len(self.fingers):
                    updated += tuple(
                        name
                        for name, finger in self._last.fingers.items()
                        if name not in samples
                        and finger.state is ContactState.UNKNOWN
                        and before.fingers[name].state is not ContactState.UNKNOWN
                    )
            if self._last is None:
                continue
            estimate = self._last
            for faults, reason in hidden:
                estimate = with_faults(estimate, faults, self._detector.n_fingers, reason)
            estimates.append(StreamEstimate(estimate, updated))
        return estimates

    def _update_of(self, arrival: Arrival | None, estimates: list[StreamEstimate]) -> StreamUpdate:
        if estimates and math.isnan(self.start):
            self.start = estimates[0].estimate.time
        events = [
            event
            for estimate, _ in estimates
            for event in self._changes.update(_states(estimate), estimate.time)
        ]
        return StreamUpdate(arrival, estimates, events)


def _states(estimate: HandEstimate) -> dict[str, ContactState]:
    """Return the states of the fingers, then that of the hand."""
    return {name: f.state for name, f in estimate.fingers.items()} | {HAND: estimate.state}
