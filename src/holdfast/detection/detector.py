"""The detector: from samples of a hand to estimates. No I/O, no clock, no growth of memory.

Offline detection is the same detector, fed with a recording. The C kernel does all that happens at
a sample, see `kernel/detector.h`.
"""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Self

import numpy as np
import numpy.typing as npt
from numpy import ndarray

from holdfast.contact import (
    ContactEvent,
    HandEstimate,
    StateChanges,
)
from holdfast.detection import kernel_config as tables
from holdfast.detection.model import Model
from holdfast.detection.plan import Start, StreamPlan, declared_baselines
from holdfast.detection.streams import FeatureStream
from holdfast.detection.traces import STATE_BY_CODE, Chunk, Detection, detection_of, makers
from holdfast.errors import ModelError, StreamError
from holdfast.kernel import _extension
from holdfast.recordings import BASELINES, Recording
from holdfast.resampling import at_rate
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

IgnoredTaxels = Mapping[str, Sequence[int]]
HAND = "hand"
"""Name of the hand as a whole, beside the fingers of events and metrics."""
MAX_EVENTS = 1000
"""Number of events that a detector keeps until `events` is called; the oldest are dropped."""


class Detector:
    """Detector of contact states for one hand, sample by sample.

    Args:
        model: features, classifiers and decision rule.
        fingers: sensor of each finger, for a model of any finger; by default all fingers that
            the model names.
        rate: samples per second of the source [Hz], for a model of any rate; by default the
            rate of the first sensor.
        ignore: indices by finger, from 0, of taxels that contribute nothing and cause no fault.
        in_contact: the first samples are load, and not an open hand.
        baselines: (n_taxels, 3) readings without contact by finger, if `in_contact`; else the
            load at the first sample is unknown, unless the readings are in newtons.

    Raises:
        ModelError: the model is for any finger and `fingers` is missing; a finger has another
            sensor; or the tare of the model is an interval, which is not known live.
        ValueError: `ignore` names a finger or a taxel that does not exist.

    Example:
        >>> from holdfast.sensors import sensor
        >>> detector = Detector(Model.load("builtin:noise-floor"), {"index": sensor("uskin-4x4")})
        >>> estimate = detector.update({"index": np.full((16, 3), 32000)}, time=0.0)
        >>> estimate.fingers["index"].state, estimate.fingers["index"].reason
        (<ContactState.UNKNOWN: 'UNKNOWN'>, <Reason.TARE: 'tare'>)
    """

    def __init__(
        self,
        model: Model,
        fingers: Mapping[str, Sensor] | None = None,
        rate: float | None = None,
        *,
        ignore: IgnoredTaxels | None = None,
        in_contact: bool = False,
        baselines: Mapping[str, npt.ArrayLike] | None = None,
    ) -> None:
        if fingers is not None:
            sensors = model.fingers_of(fingers)
        elif any(f == "*" or part.sensor is None for f, part in model.fingers.items()):
            raise ModelError(
                f"the model {model.name or 'given'} is for any finger: the fingers of the hand and "
                "their sensors expected"
            )
        else:
            sensors = {f: model.sensors[str(part.sensor)] for f, part in model.fingers.items()}
        first = next(iter(sensors.values()))
        plan = _ignoring(model.plan(sensors, rate or first.rate), ignore)
        known = declared_baselines({BASELINES: baselines}, sensors)
        plan = replace(plan, start=Start(in_contact, known))
        # Last, so that a wrong finger or taxel is reported first, as by `for_recording`.
        if plan.tare.kind == "interval":
            raise ModelError(
                f"the model's tare is the interval {model.tare} s of a recording; "
                "seconds, 'first' or 'none' expected where samples come one by one"
            )
        self._start(model, FeatureStream(plan))

    @classmethod
    def for_recording(
        cls,
        model: Model,
        recording: Recording,
        *,
        ignore: IgnoredTaxels | None = None,
    ) -> Self:
        """Return a detector for a recording, whose tare may be an interval of it.

        Args:
            model: features, classifiers and decision rule.
            recording: the recording; or its first part, if `run` receives it in parts. A tare by
                interval then needs that interval in the first part.
            ignore: indices by finger, from 0, of taxels that contribute nothing and cause no fault.

        Raises:
            ModelError: the recording has none of the model's fingers, or another sensor.
            ValueError: a tare by interval finds no samples, or `ignore` names a finger or a
                taxel that does not exist.
        """
        # Past `__init__`, which refuses the tare by interval that a recording may have.
        detector = cls.__new__(cls)
        sensors = model.fingers_of({name: m.sensor for name, m in recording.modules.items()})
        plan = _ignoring(model.plan(sensors, recording.rate), ignore)
        detector._start(model, FeatureStream.for_recording(plan, recording))
        return detector

    def _start(self, model: Model, stream: FeatureStream) -> None:
        plan = stream.plan
        # What holds for the life of the detector; only `set_thresholds` replaces the rules.
        # `_readings` and `_present` are memory for samples of other types.
        self._names = (*plan.fingers, HAND)
        self._settings = tables.model_table(model, plan)
        self._parts = [model.finger(*finger) for finger in plan.sensors.items()]
        self._rules = tables.rules_of(model, plan)
        self._readings = np.zeros_like(stream.baseline)
        self._present = np.zeros(len(plan.fingers), dtype=np.bool_)
        self._slots = {
            finger: (place, self._readings[taxels], (taxels.stop - taxels.start, 3))
            for place, (finger, taxels) in enumerate(stream.slices.items())
        }
        self._use(stream)

    def _use(self, stream: FeatureStream) -> None:
        """Set a new feature stream, and an empty decision memory."""
        self._stream = stream
        # The kernel appends to `_transitions` at each change; `events` and `run` turn them into
        # events, so that an update makes no Python objects for them.
        self._changes = StateChanges(self._names)
        self._events: deque[ContactEvent] = deque(maxlen=MAX_EVENTS)
        self._transitions: deque[tuple[float, bytes, bytes]] = deque(maxlen=MAX_EVENTS)
        self._kernel = _extension.Detector(
            stream.tables(), self._settings, *self._rules,
            makers(stream.plan.fingers, self._parts), ndarray, self._transitions.append,
        )  # fmt: skip

    def __getstate__(self) -> object:
        # A copy would share the memory of the kernel with this one.
        raise TypeError("a detector is not copied or pickled; make another of the same model")

    @property
    def n_fingers(self) -> int:
        """Number of fingers of the model, on which the state of the hand depends."""
        return int(self._settings["n_model_fingers"])

    def baselines(self) -> dict[str, Array]:
        """Return (n_taxels, 3) the tare of each finger whose tare is complete [its unit]."""
        baseline = np.empty_like(self._readings)
        complete = self._kernel.baselines(baseline)
        slices = self._stream.slices.items()
        return {
            f: baseline[taxels] for (f, taxels), done in zip(slices, complete, strict=True) if done
        }

    def reset(self, *, in_contact: bool | None = None) -> None:
        """Discard all samples, events and the tare.

        Args:
            in_contact: whether the next samples are load; None for as before.
        """
        plan = self._stream.plan
        loaded = plan.start.loaded if in_contact is None else in_contact
        self._use(FeatureStream(replace(plan, start=replace(plan.start, loaded=loaded))))

    def set_thresholds(self, thresholds: Mapping[str, float]) -> None:
        """Change the probability from which a contact is stable, from the next sample on.

        `reset` keeps the thresholds.

        Args:
            thresholds: from 0 to 1, by finger; other fingers keep theirs.

        Raises:
            ValueError: a threshold is not from 0 to 1, or a finger is unknown; nothing has
                changed then.
        """
        check_thresholds(thresholds)
        unknown = thresholds.keys() - self._slots.keys()
        if unknown:
            raise ValueError(
                f"threshold of {', '.join(sorted(unknown))} given; "
                f"the detector has {', '.join(self._slots)}"
            )
        # A copy, so that nothing has changed if the kernel refuses it.
        limits, heads, weights = self._rules
        rules = limits, [dict(head) for head in heads], weights
        for finger, threshold in thresholds.items():
            tables.stable_head(rules, self._slots[finger][0])["threshold"] = threshold
        self._kernel.set_rules(*rules)
        self._rules = rules

    def update(self, samples: Mapping[str, npt.ArrayLike], time: float) -> HandEstimate:
        """Process one sample of some or all fingers.

        Args:
            samples: (n_taxels, 3) by finger, in taxel frames, in the unit of the training.
            time: of the samples, later than the last [s].

        Returns:
            The latest estimate of every finger. A finger without a sample keeps its estimate
            until the time since its last sample is a gap.

        Raises:
            StreamError: an unknown finger, another number of taxels or axes, what is no number,
                or a time that does not increase. The detector has not changed then.
        """
        # None for what is converted or refused here: other types, shapes, names or times.
        estimate = self._kernel.update(samples, time)
        if estimate is not None:
            return estimate
        # The time first: `_store` changes the memory for samples, which a wrong time must not.
        time = float(time)
        self._check_time(time)
        self._store(samples)
        return self._kernel.step(self._readings, self._present, time)

    def events(self) -> list[ContactEvent]:
        """Return the changes of state since the last call, at most `MAX_EVENTS`, oldest first."""
        self._settle_transitions()
        events = list(self._events)
        self._events.clear()
        return events

    def run(self, recording: Recording) -> Detection:
        """Process all samples of a recording, after those that the detector has had.

        Args:
            recording: that has some of the fingers. A long recording may come in parts, one
                call for each.

        Returns:
            The estimates that `update` would return, sample by sample.

        Raises:
            StreamError: the recording has no sample of the fingers, another number of taxels,
                or begins before the last sample.
        """
        # All is checked before the first sample: a recording is processed as a whole or not.
        modules = {f: recording.modules[f] for f in self._slots if f in recording.modules}
        if not any(module.n_samples for module in modules.values()):
            raise StreamError(
                f"recording {recording.name!r} has samples of {', '.join(recording.modules)}; "
                f"the model is for {', '.join(self._slots)}"
            )
        for finger, module in modules.items():
            self._check_shape(finger, module.readings.shape[1:])
        self._check_time(min(float(m.times[0]) for m in modules.values() if m.n_samples))
        self._settle_transitions()
        fingers, chunks = self._stream.plan.fingers, self._estimates(recording)
        return detection_of(recording, fingers, self._parts, chunks)

    def _estimates(self, recording: Recording) -> Iterator[Chunk]:
        """Yield the estimates of all samples of a recording, in chunks."""
        for times, present, readings in self._stream.samples_of(recording):
            estimates, numbers = tables.estimate_rows(*present.shape)
            hand = np.empty(len(times))
            self._kernel.run(readings, present, times, numbers, hand)
            codes = np.column_stack([estimates["state"], hand.astype(np.int64)])
            self._events += self._changes.update_chunk(times, codes)
            yield Chunk(times, present, estimates, hand)

    def _check_time(self, time: float) -> None:
        last = self._kernel.last_time()
        if not last < time < inf:
            after = "" if last == -inf else f" after {last:.15g} s"
            raise StreamError(f"time {time:.15g} s given{after}; finite, increasing times expected")

    def _check_shape(self, finger: str, shape: tuple[int, ...]) -> None:
        expected = self._slots[finger][2]
        if shape != expected:
            raise StreamError(
                f"{finger}: a sample of shape {shape} given, {expected} expected "
                f"({self._stream.plan.sensors[finger].name})"
            )

    def _store(self, samples: Mapping[str, npt.ArrayLike]) -> None:
        """Copy samples of any type for the kernel."""
        slots = self._slots
        self._present[:] = False
        for finger, sample in samples.items():
            if finger not in slots:
                raise StreamError(f"finger {finger!r} given; the model is for {', '.join(slots)}")
            place, slot, shape = slots[finger]
            try:
                values = sample if isinstance(sample, ndarray) else np.asarray(sample)
                if values.shape != shape:
                    self._check_shape(finger, values.shape)
                slot[...] = values
            except (
                ValueError,
                TypeError,
                OverflowError,
            ) as cause:  # of objects, or rows of lengths
                raise StreamError(f"{finger}: {shape} numbers expected; {cause}") from cause
            self._present[place] = True

    def _settle_transitions(self) -> None:
        """Turn the changes of state of the last updates into events."""
        for time, *codes in self._transitions:
            before, after = ([STATE_BY_CODE[code] for code in states] for states in codes)
            self._changes.states = before  # the change before this one may be forgotten
            self._events += self._changes.update(after, time)
        self._transitions.clear()


def detect(model: Model, recording: Recording, *, in_contact: bool | None = None) -> Detection:
    """Return the estimates of a whole recording, the same as `Detector.update` gives.

    Args:
        model: features, classifiers and decision rule.
        recording: that has some of the model's fingers. Of a sample-and-hold sensor its true
            updates are used. It is resampled first, if its rate is not within 20 % of the model's.
        in_contact: the first samples are load; None if the metadata say it (`starts_loaded`).

    Returns:
        The trace of each finger that the recording has, and of the hand.

    Raises:
        ModelError: the recording has none of the model's fingers, or another sensor.
        ValueError: a tare by interval finds no samples.

    Example:
        >>> from holdfast.synthetic import synthetic_recording
        >>> recording = synthetic_recording("made", seed=0)
        >>> found = detect(Model.load("builtin:noise-floor"), recording)
        >>> sorted(found.fingers), len(found.fingers["index"]), found.hand.shape
        (['index', 'middle', 'thumb'], 1725, (1725,))
    """
    recording = at_rate(recording.with_start(loaded=in_contact), model.rate)
    return Detector.for_recording(model, recording).run(recording)


def check_thresholds(thresholds: Mapping[str, float]) -> None:
    """Raise `ValueError` for a threshold that is not from 0 to 1."""
    for threshold in thresholds.values():
        if not 0 <= threshold <= 1:
            raise ValueError(f"a threshold from 0 to 1 expected, {threshold} given")


def _ignoring(plan: StreamPlan, ignore: IgnoredTaxels | None) -> StreamPlan:
    """Return the plan without some taxels."""
    for finger, taxels in (ignore or {}).items():
        if finger not in plan.sensors:
            raise ValueError(
                f"taxels of {finger!r} to be ignored; the model is for {', '.join(plan.fingers)}"
            )
        n_taxels = plan.sensors[finger].n_taxels
        for taxel in taxels:
            if not 0 <= taxel < n_taxels:
                raise ValueError(
                    f"{finger}: taxel index {taxel} to be ignored; "
                    f"it has the indices 0 to {n_taxels - 1}"
                )
    return replace(plan, ignore=ignore or {})
