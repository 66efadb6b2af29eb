"""The detector: from samples of a hand to estimates. No I/O, no clock, no growth of memory.

Offline detection is the same detector, fed with a recording. The C kernel does all that happens at
a sample, see `kernel/holdfast.h`.
"""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt
from numpy import ndarray

from holdfast.contact import ContactEvent, HandEstimate
from holdfast.detection.kernel_config import (
    packed,
    stable_thresholds,
    stream_config,
    with_thresholds,
)
from holdfast.detection.model import Model
from holdfast.detection.plan import Start, StreamPlan, declared_baselines
from holdfast.detection.traces import STATE_BY_CODE, Chunk, Detection, EstimateTypes, detection_of
from holdfast.errors import ModelError, RecordingError, StreamError
from holdfast.kernel import _extension
from holdfast.kernel.structs import struct_type
from holdfast.recordings import BASELINES, Recording
from holdfast.resampling import at_rate
from holdfast.sensors import Sensor, as_sensor
from holdfast.sensors.types import Array

IgnoredTaxels = Mapping[str, Sequence[int]]
HAND = "hand"
"""Name of the hand as a whole, beside the fingers of events and metrics."""
MAX_EVENTS = 1000
"""Number of events that a detector keeps until `events` is called; the oldest are dropped."""


class Detector:
    """Detector of contact states for one hand, sample by sample.

    Args:
        model: features, classifiers and decision rule; or its file, or the name of a built-in one.
        fingers: sensor of each finger, or its name, for a model of any finger; by default all
            fingers that the model names.
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
        >>> detector = Detector("builtin:noise-floor", {"index": "uskin-4x4"})
        >>> estimate = detector.update({"index": np.full((16, 3), 32000)}, time=0.0)
        >>> estimate.fingers["index"].state, estimate.fingers["index"].reason
        (<ContactState.UNKNOWN: 'UNKNOWN'>, <Reason.TARE: 'tare'>)
    """

    def __init__(
        self,
        model: Model | str | Path,
        fingers: Mapping[str, Sensor | str] | None = None,
        rate: float | None = None,
        *,
        ignore: IgnoredTaxels | None = None,
        in_contact: bool = False,
        baselines: Mapping[str, npt.ArrayLike] | None = None,
    ) -> None:
        model = Model.of(model)
        if fingers is not None:
            sensors = model.fingers_of({f: as_sensor(kind) for f, kind in fingers.items()})
        elif any(f == "*" or part.sensor is None for f, part in model.fingers.items()):
            raise ModelError(
                f"the model {model.name or 'given'} is for any finger: the fingers of the hand and "
                "their sensors expected"
            )
        else:
            sensors = {f: model.sensors[str(part.sensor)] for f, part in model.fingers.items()}
        first = next(iter(sensors.values()))
        plan = _ignoring(model.plan(sensors, rate or first.rate), ignore)
        stated = declared_baselines({BASELINES: baselines}, sensors)
        # Last, so that a wrong finger or taxel is reported first.
        if plan.tare.kind == "interval" and baselines is None:
            raise ModelError(
                f"the model's tare is the interval {model.tare} s of a recording; "
                "seconds, 'first' or 'none' expected where samples come one by one"
            )
        self._plan = replace(plan, start=Start(in_contact, stated))
        self._names = (*plan.fingers, HAND)
        # Only `set_thresholds` replaces the rules. `_readings` and `_present` are memory for
        # samples of other types.
        self._model = model
        self._settings, self._rules, self._weights = model.config(self._plan)
        self._readings = np.zeros_like(self._plan.baseline)
        self._present = np.zeros(len(plan.fingers), dtype=np.bool_)
        self._begin()

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
        modules = {name: module.sensor for name, module in recording.modules.items()}
        plan = _ignoring(model.plan(model.fingers_of(modules), recording.rate), ignore)
        start = plan.for_recording(recording).start
        return cls(
            model, modules, recording.rate,
            ignore=ignore, in_contact=start.loaded, baselines=start.baselines,
        )  # fmt: skip

    def _begin(self) -> None:
        """Begin before the first sample, without tare and events."""
        # (time, codes before, codes after) of each change of state, which the kernel appends:
        # `events` turns them into events, so that an update makes no Python objects for them.
        self._transitions: deque[tuple[float, bytes, bytes]] = deque(maxlen=MAX_EVENTS)
        plan = self._plan
        indices = {finger: index for index, finger in enumerate(plan.fingers)}
        self._kernel = _extension.Detector(
            *packed(stream_config(plan)), plan.baseline.tobytes(), self._settings.tobytes(),
            self._rules.tobytes(), self._weights.tobytes(),
            EstimateTypes(indices, self._transitions.append),
        )  # fmt: skip

    def __getstate__(self) -> object:
        # A copy would share the memory of the kernel with this one.
        raise TypeError("a detector is not copied or pickled; make another of the same model")

    def __repr__(self) -> str:
        return f"Detector of {', '.join(self._plan.fingers)}"

    @property
    def n_fingers(self) -> int:
        """Number of fingers of the model, on which the state of the hand depends."""
        return int(self._settings["n_model_fingers"][0])

    def baselines(self) -> dict[str, Array]:
        """Return (n_taxels, 3) the tare of each finger whose tare is complete [its unit]."""
        baseline = np.empty_like(self._readings)
        complete = self._kernel.baselines(baseline)
        slices = self._plan.slices.items()
        return {
            f: baseline[taxels] for (f, taxels), done in zip(slices, complete, strict=True) if done
        }

    def reset(self, *, in_contact: bool | None = None) -> None:
        """Discard all samples, events and the tare.

        Args:
            in_contact: whether the next samples are load; None for as before.
        """
        if in_contact is not None:
            start = replace(self._plan.start, loaded=in_contact)
            self._plan = replace(self._plan, start=start)
            # The start decides which slip head is used; thresholds that were set stay.
            thresholds = dict(enumerate(stable_thresholds(self._rules)))
            self._settings, rules, self._weights = self._model.config(self._plan)
            self._rules = with_thresholds(rules, thresholds)
        self._begin()

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
        fingers = self._plan.fingers
        if unknown := thresholds.keys() - set(fingers):
            raise ValueError(
                f"threshold of {', '.join(sorted(unknown))} given; "
                f"the detector has {', '.join(fingers)}"
            )
        rules = with_thresholds(
            self._rules, {fingers.index(finger): t for finger, t in thresholds.items()}
        )
        self._kernel.set_rules(rules.tobytes(), self._weights.tobytes())
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
        events = [
            ContactEvent(name, STATE_BY_CODE[new], STATE_BY_CODE[old], time)
            for time, before, after in self._transitions
            for name, new, old in zip(self._names, after, before, strict=True)
            if new != old
        ]
        self._transitions.clear()
        return events[-MAX_EVENTS:]

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
        fingers = self._plan.fingers
        modules = {f: recording.modules[f] for f in fingers if f in recording.modules}
        if not any(module.n_samples for module in modules.values()):
            raise StreamError(
                f"recording {recording.name!r} has samples of {', '.join(recording.modules)}; "
                f"the model is for {', '.join(fingers)}"
            )
        for finger, module in modules.items():
            self._check_shape(finger, module.readings.shape[1:])
        self._check_time(min(float(m.times[0]) for m in modules.values() if m.n_samples))
        return detection_of(recording, fingers, self._rules, self._estimates(recording))

    def _estimates(self, recording: Recording) -> Iterator[Chunk]:
        """Yield the estimates of all samples of a recording, in chunks."""
        for times, present, readings in self._plan.samples_of(recording):
            estimates = np.zeros(present.shape, struct_type("holdfast_finger_estimate"))
            hand = np.empty(len(times))
            self._kernel.run(readings, present, times, estimates.view(np.float64), hand)
            yield Chunk(times, present, estimates, hand)

    def _check_time(self, time: float) -> None:
        last = self._kernel.last_time()
        if not last < time < inf:
            after = "" if last == -inf else f" after {last:.15g} s"
            raise StreamError(f"time {time:.15g} s given{after}; finite, increasing times expected")

    def _check_shape(self, finger: str, shape: tuple[int, ...]) -> None:
        sensor = self._plan.sensors[finger]
        if shape != (sensor.n_taxels, 3):
            raise StreamError(
                f"{finger}: a sample of shape {shape} given, {(sensor.n_taxels, 3)} expected "
                f"({sensor.name})"
            )

    def _store(self, samples: Mapping[str, npt.ArrayLike]) -> None:
        """Copy samples of any type for the kernel."""
        fingers = self._plan.fingers
        self._present[:] = False
        for finger, sample in samples.items():
            if finger not in fingers:
                raise StreamError(f"finger {finger!r} given; the model is for {', '.join(fingers)}")
            target = self._readings[self._plan.slices[finger]]
            try:
                values = sample if isinstance(sample, ndarray) else np.asarray(sample)
                self._check_shape(finger, values.shape)
                target[...] = values
            except (ValueError, TypeError, OverflowError) as cause:
                # Of objects, or of rows of different lengths.
                raise StreamError(f"{finger}: {target.shape} numbers expected; {cause}") from cause
            self._present[fingers.index(finger)] = True


def detect(
    model: Model | str | Path, recording: Recording, *, in_contact: bool | None = None
) -> Detection:
    """Return the estimates of a whole recording, the same as `Detector.update` gives.

    Args:
        model: features, classifiers and decision rule; or its file, or the name of a built-in one.
        recording: that has some of the model's fingers. Of a sample-and-hold sensor its true
            updates are used. It is resampled first, if its rate is not within 20 % of the model's.
        in_contact: the first samples are load; None if the metadata say it (`starts_loaded`).

    Returns:
        The trace of each finger that the recording has, and of the hand.

    Raises:
        ModelError: the recording has none of the model's fingers, or another sensor.
        RecordingError: it is no recording.
        ValueError: a tare by interval finds no samples.

    Example:
        >>> from holdfast.synthetic import synthetic_recording
        >>> recording = synthetic_recording("made", seed=0)
        >>> found = detect("builtin:noise-floor", recording)
        >>> sorted(found.fingers), len(found.fingers["index"]), found.hand.shape
        (['index', 'middle', 'thumb'], 1725, (1725,))
    """
    if not isinstance(recording, Recording):
        raise RecordingError(
            f"a Recording expected, {type(recording).__name__} given: "
            'Recording("mine", {"index": Tactile("uskin-4x4", times, readings)}), or of a file '
            "load_recording(path)"
        )
    model = Model.of(model)
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
