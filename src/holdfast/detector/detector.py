"""The detector: samples of a hand in, estimates out. No I/O, no clock, no growth of memory.

Offline detection is the same detector fed with a recording: one kernel computes the features,
one the probability, one rule turns it into a state.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf
from typing import Self

import numpy as np
import numpy.typing as npt
from numpy import ndarray

from holdfast.contact import (
    ContactEstimate,
    ContactEvent,
    HandEstimate,
    StateChanges,
    taxels_of,
)
from holdfast.detector.rule import N_REPORT, Live, Traces, new_decision, rule_of, run, step_live
from holdfast.detector.traces import STATES, VERDICTS, Detection, detection_of
from holdfast.errors import ModelError, StreamError
from holdfast.features.arrays import TARED, TAXELS, Array
from holdfast.features.stream import StreamPlan, give_baseline, new_memory, new_output, samples_of
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.resampling import resample
from holdfast.sensors import Sensor

Ignored = Mapping[str, Sequence[int]]
HAND = "hand"
"""Name of the hand as a whole among the fingers of events and metrics."""
MAX_EVENTS = 1000
"""Events that a detector keeps until they are fetched; the oldest go first."""


class Detector:
    """Judges a hand, sample by sample.

    Args:
        model: that judges.
        fingers: sensor of each finger, for a model that serves any finger; by default all
            fingers that the model names.
        rate: of the source [Hz], for a model that takes any.
        ignore: taxels by finger, from 0, that contribute nothing and cause no fault.

    Raises:
        ModelError: the model serves any finger and `fingers` is missing, one of them has
            another sensor, or the model's tare is an interval, which nobody can know live.
        ValueError: `ignore` names a finger or a taxel that there is not.

    Example:
        >>> from holdfast.sensors import sensor
        >>> detector = Detector(Model.load("builtin:noise-floor"), {"index": sensor("uskin-4x4")})
        >>> estimate = detector.update({"index": np.zeros((16, 3))}, time=0.0)
        >>> estimate.fingers["index"].state, estimate.fingers["index"].reason
        (<ContactState.UNKNOWN: 'UNKNOWN'>, <Reason.TARE: 'tare'>)
    """

    def __init__(
        self,
        model: Model,
        fingers: Mapping[str, Sensor] | None = None,
        rate: float | None = None,
        *,
        ignore: Ignored | None = None,
    ) -> None:
        sensors = model.fingers_of(fingers) if fingers is not None else _own_fingers(model)
        first = next(iter(sensors.values()))
        plan = _without(model.plan(sensors, rate or first.rate), ignore)
        if plan.tare.kind == "interval":
            raise ModelError(
                f"the model's tare is the interval {model.tare} s of a recording; "
                "seconds, 'first' or 'none' expected where samples come one by one"
            )
        self._start(model, plan)

    @classmethod
    def for_recording(
        cls, model: Model, recording: Recording, *, ignore: Ignored | None = None
    ) -> Self:
        """The detector for a recording, whose tare may be an interval of it.

        Args:
            model: that judges.
            recording: whose fingers and rate it is for; or its first piece, where `run` gets
                it in pieces (a tare by interval then needs that interval in the first).
            ignore: taxels by finger, from 0, that contribute nothing and cause no fault.

        Raises:
            ModelError: the recording has none of the model's fingers, or another sensor.
            ValueError: a tare by interval finds no samples, or `ignore` names a finger or a
                taxel that there is not.
        """
        detector = cls.__new__(cls)
        sensors = model.fingers_of({name: m.sensor for name, m in recording.modules.items()})
        detector._start(model, _without(model.plan(sensors, recording.rate), ignore))
        if detector._plan.tare.kind == "interval":
            give_baseline(detector._plan, detector._memory, recording)
        return detector

    def _start(self, model: Model, plan: StreamPlan) -> None:
        self._plan = plan
        self._names = (*plan.fingers, HAND)
        self._layout = plan.layout()
        self._rule = rule_of(model, plan)
        n_fingers, n_taxels = len(plan.fingers), int(self._layout.offsets[-1])
        self._readings = np.zeros((n_taxels, 3))
        self._flags = bytearray(n_fingers)  # which are present: an array is slower to write to
        self._present = np.frombuffer(self._flags, dtype=np.bool_)
        self._report = np.zeros((n_fingers, N_REPORT))
        bounds = pairwise(self._layout.offsets.tolist())
        self._slots = {
            finger: (place, self._readings[start:stop], (stop - start, 3))
            for place, (finger, (start, stop)) in enumerate(zip(plan.fingers, bounds, strict=True))
        }
        self.reset()
        # Compiles, and changes nothing: no finger is present.
        step_live(self._table, 0.0)

    def __getstate__(self) -> object:
        # A copy would share memory with this one, by address.
        raise TypeError("a detector is not copied or pickled; make another of the same model")

    @property
    def n_fingers(self) -> int:
        """How many fingers the model has: the hand's state depends on it."""
        return self._rule.n_fingers

    def baselines(self) -> dict[str, Array]:
        """(n_taxels, 3) the tare of each finger [unit of the readings], once it is complete."""
        bounds = pairwise(self._layout.offsets.tolist())
        return {
            finger: self._memory.baseline[start:stop].copy()
            for finger, (start, stop), n in zip(
                self._plan.fingers, bounds, self._memory.counts[:, TARED], strict=True
            )
            if n < 0
        }

    def reset(self) -> None:
        """Forgets everything, the tare included."""
        n_fingers = len(self._plan.fingers)
        self._memory = new_memory(self._layout)
        self._output = new_output(self._layout)
        self._decision = new_decision(n_fingers)
        live = Live(
            self._layout, self._memory, self._output, self._rule, self._decision,
            self._readings, self._present, self._report,
        )  # fmt: skip
        self._table, self._arrays = live.table()
        self._changes = StateChanges(self._names)
        self._last = -inf
        self._events: list[ContactEvent] = []

    def update(self, samples: Mapping[str, npt.ArrayLike], time: float) -> HandEstimate:
        """Takes one sample of some or all fingers, and says how the hand is.

        Args:
            samples: (n_taxels, 3) by finger, in taxel frames, in the unit of the training.
            time: of the samples, later than the last [s].

        Returns:
            The latest estimate of every finger; fingers without a sample keep theirs until the
            time since is a gap.

        Raises:
            StreamError: an unknown finger, another number of taxels or axes, or a time that
                does not go forward. The detector is as it was before.
        """
        time = float(time)
        if not self._last < time < inf:
            self._refuse_time(time)
        self._place(samples)
        self._last = time
        return self._tell(time, step_live(self._table, time))

    def events(self) -> list[ContactEvent]:
        """The changes of state since the last call, at most `MAX_EVENTS`, oldest first."""
        events, self._events = self._events, []
        return events

    def run(self, recording: Recording) -> Detection:
        """Takes all samples of a recording, from where the detector stands.

        Args:
            recording: that has some of the fingers. A long one may be given in pieces.

        Returns:
            What `update` would have said, sample by sample.
        """
        self._check_recording(recording)
        pieces = []
        for times, present, readings in samples_of(self._plan, recording):
            traces = Traces.empty(len(times), present.shape[1])
            run(
                self._layout, self._memory, self._output, self._rule, self._decision,
                readings, present, times, traces,
            )  # fmt: skip
            codes = np.column_stack([traces.state, traces.hand])
            self._keep_events(self._changes.update_chunk(times, codes))
            self._last = float(times[-1])
            pieces.append((times, present, traces))
        return detection_of(recording.name, self._plan.fingers, pieces)

    def _refuse_time(self, time: float) -> None:
        after = "" if self._last == -inf else f" after {self._last:.15g} s"
        raise StreamError(f"time {time:.15g} s given{after}; finite times that go forward expected")

    def _check_recording(self, recording: Recording) -> None:
        modules = {f: recording.modules[f] for f in self._slots if f in recording.modules}
        if not any(module.n_samples for module in modules.values()):
            raise StreamError(
                f"recording {recording.name!r} has samples of {', '.join(recording.modules)}; "
                f"the model judges {', '.join(self._slots)}"
            )
        for finger, module in modules.items():
            self._check_shape(finger, module.readings.shape[1:])
        start = min(float(m.times[0]) for m in modules.values() if m.n_samples)
        if not self._last < start < inf:
            self._refuse_time(start)

    def _check_shape(self, finger: str, shape: tuple[int, ...]) -> None:
        expected = self._slots[finger][2]
        if shape != expected:
            raise StreamError(
                f"{finger}: a sample of shape {shape} given, {expected} expected "
                f"({self._plan.sensors[finger].name})"
            )

    def _place(self, samples: Mapping[str, npt.ArrayLike]) -> None:
        slots, flags = self._slots, self._flags
        if len(samples) != len(slots):
            flags[:] = bytes(len(flags))
        for finger, sample in samples.items():
            if finger not in slots:
                raise StreamError(f"finger {finger!r} given; the model judges {', '.join(slots)}")
            place, slot, shape = slots[finger]
            values = sample if isinstance(sample, ndarray) else np.asarray(sample)
            if values.shape != shape:
                self._check_shape(finger, values.shape)
            slot[...] = values
            flags[place] = 1

    def _tell(self, time: float, hand_code: int) -> HandEstimate:
        fingers, states = {}, []
        for place, row in enumerate(self._report.tolist()):
            seen, code, probability, sigma, x, y, z = row
            state, reason, faults = VERDICTS[code]
            taxels = taxels_of(int(self._output.status[place, TAXELS])) if faults else ()
            states.append(state)
            fingers[self._names[place]] = ContactEstimate(
                seen, state, reason, probability, sigma, (x, y, z), faults, taxels
            )
        hand = STATES[hand_code]
        states.append(hand)
        if events := self._changes.update(states, time):
            self._keep_events(events)
        return HandEstimate(time, hand, fingers)

    def _keep_events(self, events: list[ContactEvent]) -> None:
        self._events += events
        del self._events[:-MAX_EVENTS]


def detect(model: Model, recording: Recording) -> Detection:
    """What the model says of a recording: what a detector says when fed sample by sample.

    Args:
        model: that judges.
        recording: that has some of its fingers. One whose rate is not within 20 % of the
            model's is resampled to it first.

    Returns:
        The traces of the fingers that the recording has, and of the hand.

    Raises:
        ModelError: the recording has none of the model's fingers, or another sensor.
        ValueError: a tare by interval finds no samples.
    """
    if model.rate is not None and not model.rate_fits(recording.rate):
        recording = resample(recording, model.rate)
    return Detector.for_recording(model, recording).run(recording)


def _own_fingers(model: Model) -> dict[str, Sensor]:
    if any(finger == "*" or part.sensor is None for finger, part in model.fingers.items()):
        raise ModelError(
            f"the model {model.name or 'given'} serves any finger: say which fingers the hand "
            "has, and with which sensors"
        )
    return {name: model.sensors[str(part.sensor)] for name, part in model.fingers.items()}


def _without(plan: StreamPlan, ignore: Ignored | None) -> StreamPlan:
    """The plan without those taxels."""
    for finger, taxels in (ignore or {}).items():
        if finger not in plan.sensors:
            raise ValueError(
                f"taxels of {finger!r} to be ignored; the model judges {', '.join(plan.fingers)}"
            )
        n_taxels = plan.sensors[finger].n_taxels
        for taxel in taxels:
            if not 0 <= taxel < n_taxels:
                raise ValueError(
                    f"{finger}: taxel {taxel} to be ignored; it has the taxels 0 to {n_taxels - 1}"
                )
    return replace(plan, ignore=ignore or {})
