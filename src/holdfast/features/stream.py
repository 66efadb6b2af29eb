"""A stream of samples of a hand on its way to features: layout, memory, and their feeding."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.features.arrays import (
    FIRST,
    LAST,
    LONGEST,
    N_COUNTS,
    N_LEVELS,
    N_STATUS,
    N_VALUES,
    NOISE,
    REASON,
    TARE,
    TARE_FIRST,
    TARE_GIVEN,
    TARE_NONE,
    TARE_SECONDS,
    WARM_UP,
    Array,
    Layout,
    Memory,
    Output,
)
from holdfast.features.faults import CHANGED_AT, N_TAXEL
from holdfast.features.specs import FeatureSpec, spec_codes
from holdfast.features.tare import Tare, baseline_of
from holdfast.recordings import Recording
from holdfast.sensors import Sensor

TARE_KINDS = {
    "seconds": TARE_SECONDS,
    "first": TARE_FIRST,
    "none": TARE_NONE,
    "interval": TARE_GIVEN,
}
COUNT_STEP_NOISE = float(1 / np.sqrt(12))
"""Standard deviation of rounding to whole counts: no sensor in counts is more quiet."""
NEWTON_NOISE = 1e-6
"""The same for readings in newtons, whose step nobody knows [N]."""
CHUNK = 2048
"""Instants that are packed at a time: bounds the memory of offline work."""


@dataclass(frozen=True)
class StreamPlan:
    """What a stream has to know before its first sample.

    Attributes:
        sensors: of each finger, in the order of the kernel's arrays.
        features: of each finger.
        window: N_w of the sigma that is reported [samples].
        tare: how the baseline is found.
        rate: samples per second [Hz].
        ignore: taxels by finger, from 0, that contribute nothing and cause no fault.
    """

    sensors: Mapping[str, Sensor]
    features: Mapping[str, Sequence[FeatureSpec]]
    window: int
    tare: Tare
    rate: float
    ignore: Mapping[str, Sequence[int]] = field(default_factory=dict)

    @property
    def fingers(self) -> tuple[str, ...]:
        """Names of the fingers, in the order of the kernel's arrays."""
        return tuple(self.sensors)

    def layout(self) -> Layout:
        """The plan as the kernel's constant arrays."""
        sensors = list(self.sensors.values())
        features = [self.features[finger] for finger in self.fingers]
        width = max(1, *(len(specs) for specs in features))
        longest = [max([self.window, *(spec.window for spec in specs)]) for specs in features]
        floors = np.zeros((len(sensors), width))
        for row, specs in zip(floors, features, strict=True):
            row[: len(specs)] = [spec.floor for spec in specs]
        ignored = [self._ignored(finger) for finger in self.fingers]
        rotations = [
            np.where(i[:, None, None], 0, s.rotations)
            for i, s in zip(ignored, sensors, strict=True)
        ]
        return Layout(
            offsets=np.cumsum([0, *(sensor.n_taxels for sensor in sensors)]),
            rotations=np.concatenate(rotations),
            constants=np.array(
                [_constants(s, int((~i).sum())) for i, s in zip(ignored, sensors, strict=True)]
            ),
            specs=np.stack([spec_codes(specs, width) for specs in features]),
            floors=floors,
            windows=np.array([(self.window, most) for most in longest], dtype=np.int64),
            ignored=np.concatenate(ignored),
            alike=len({tuple(specs) for specs in features}) == 1,
            tare_kind=TARE_KINDS[self.tare.kind],
            tare_seconds=self.tare.seconds,
            period=1.0 / self.rate,
        )

    def _ignored(self, finger: str) -> npt.NDArray[np.bool_]:
        flags = np.zeros(self.sensors[finger].n_taxels, dtype=np.bool_)
        flags[list(self.ignore.get(finger, ()))] = True
        return flags


def new_memory(layout: Layout) -> Memory:
    """The memory of a stream that has seen nothing."""
    n_fingers = len(layout.windows)
    n_taxels = len(layout.rotations)
    longest = int(layout.windows[:, LONGEST].max())
    levels = np.zeros((n_fingers, N_LEVELS))
    taxels = np.zeros((n_taxels, N_TAXEL))
    taxels[layout.ignored, CHANGED_AT] = np.inf  # never long ago
    levels[:, [FIRST, LAST, NOISE]] = np.nan
    return Memory(
        baseline=np.zeros((n_taxels, 3)),
        previous=np.zeros((n_taxels, 3)),
        taxels=taxels,
        history=np.zeros((n_fingers, 4, 2 * longest)),
        counts=np.zeros((n_fingers, N_COUNTS), dtype=np.int64),
        levels=levels,
        own=np.full((n_fingers, layout.specs.shape[1]), np.nan),
    )


def new_output(layout: Layout) -> Output:
    """An output to be filled, as before the first sample."""
    n_fingers = len(layout.windows)
    status = np.zeros((n_fingers, N_STATUS), dtype=np.int64)
    taring = layout.tare_kind == TARE_SECONDS
    status[:, REASON] = TARE if taring else WARM_UP
    return Output(
        features=np.full((n_fingers, layout.specs.shape[1]), np.nan),
        values=np.full((n_fingers, N_VALUES), np.nan),
        status=status,
    )


class Samples(NamedTuple):
    """Samples of several fingers at successive instants.

    Attributes:
        times: (n,) [s].
        present: (n, n_fingers) which finger has a sample then.
        readings: (n, n_taxels, 3) of all fingers, one after the other.
    """

    times: Array
    present: npt.NDArray[np.bool_]
    readings: Array


def samples_of(plan: StreamPlan, recording: Recording) -> Iterator[Samples]:
    """The samples of the plan's fingers in order of time, a bounded number at a time.

    Fingers that have a sample at the same time share an instant; one that the recording lacks
    is never present.

    Args:
        plan: of which fingers.
        recording: that has some of them.

    Yields:
        At most `CHUNK` instants at a time.
    """
    offsets = np.cumsum([0, *(sensor.n_taxels for sensor in plan.sensors.values())])
    modules = [
        (place, slice(offsets[place], offsets[place + 1]), recording.modules[finger])
        for place, finger in enumerate(plan.fingers)
        if finger in recording.modules
    ]
    times = reduce(_union, (module.times for _, _, module in modules))
    for start in range(0, len(times), CHUNK):
        chunk = times[start : start + CHUNK]
        present = np.zeros((len(chunk), len(plan.sensors)), dtype=np.bool_)
        readings = np.zeros((len(chunk), int(offsets[-1]), 3))
        for place, taxels, module in modules:
            first = np.searchsorted(module.times, chunk[0], side="left")
            last = np.searchsorted(module.times, chunk[-1], side="right")
            rows = np.searchsorted(chunk, module.times[first:last])
            present[rows, place] = True
            readings[rows, taxels] = module.readings[first:last]
        yield Samples(chunk, present, readings)


def _union(one: Array, two: Array) -> Array:
    return one if np.array_equal(one, two) else np.union1d(one, two)


def give_baseline(plan: StreamPlan, memory: Memory, recording: Recording) -> None:
    """Puts the mean over the plan's interval into the memory, for a tare by interval.

    A finger that the recording lacks keeps the baseline that it has.

    Raises:
        ValueError: a finger has no finite sample in that interval.
    """
    ends = np.cumsum([sensor.n_taxels for sensor in plan.sensors.values()])
    for (finger, sensor), end in zip(plan.sensors.items(), ends, strict=True):
        if finger not in recording.modules:
            continue
        module = recording.modules[finger]
        rows = slice(*np.searchsorted(module.times, plan.tare.interval))
        readings = np.array(module.readings[rows], dtype=np.float64)
        readings[:, list(plan.ignore.get(finger, ()))] = 0.0
        try:
            baseline, _ = baseline_of(readings, module.times[rows], plan.tare, 1 / plan.rate)
        except ValueError as cause:
            raise ValueError(
                f"{finger} of {recording.name!r}, which runs from {recording.start:.15g} to "
                f"{recording.end:.15g} s: {cause}"
            ) from cause
        memory.baseline[end - sensor.n_taxels : end] = baseline


def _constants(sensor: Sensor, n_used: int) -> tuple[float, ...]:
    """A row of `Layout.constants`; the taxels that are used round their readings each."""
    low, high = sensor.limits or (-np.inf, np.inf)
    step = COUNT_STEP_NOISE if sensor.unit == "count" else NEWTON_NOISE
    known = step if sensor.unit == "count" else np.nan
    return low, high, float(step * np.sqrt(n_used)), known, n_used
