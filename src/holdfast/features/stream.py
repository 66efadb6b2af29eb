"""The feature stream of a hand: its plan, arrays and memory, for detectors and recordings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

from holdfast.features import arrays as at
from holdfast.features import untrue
from holdfast.features.arrays import Layout, Memory, Output
from holdfast.features.faults import WEIGHT_Y, WEIGHT_Z
from holdfast.features.haar import N_SUMS, n_levels
from holdfast.features.loaded_start import begins_in_contact, declared_baselines, loaded_tare
from holdfast.features.motion import (
    AVERAGE_SECONDS,
    GAP_LIMIT_PERIODS,
    MAX_BRIDGED_SECONDS,
)
from holdfast.features.specs import (
    FEATURE_KINDS,
    LAG_KINDS,
    MEAN_SECOND_KINDS,
    OF_COMPONENTS,
    RATIO_KINDS,
    RELATIVE_KINDS,
    SECOND_KINDS,
    FeatureSpec,
    spec_codes,
)
from holdfast.features.tables import c_stream
from holdfast.features.tare import Tare, baseline_of
from holdfast.features.untrue import END_SHARE, OFFSET_SHARE
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Flags, Integers

TARE_KINDS = {
    "seconds": at.TARE_SECONDS,
    "first": at.TARE_FIRST,
    "none": at.TARE_NONE,
    "interval": at.TARE_INTERVAL,
}
COUNT_NOISE = float(1 / np.sqrt(12))
"""Standard deviation of rounding to whole counts: the least noise of a reading [count]."""
NOISE_SECONDS, LOADED_NOISE_SECONDS = 0.5, 0.2
"""Time over which the noise of a sensor is measured, where the tare takes no time; and where the
stream begins in contact [s]."""
NEWTON_NOISE = 1e-6
"""Least noise of a reading in newtons, whose step is not known [N]."""
RING_SPARE = 2
"""Samples that the history of relative features holds, as a multiple of those of its longest lag:
for bursts, and for a rate that rises."""
CHUNK_SAMPLES = 2048
"""Instants that are packed at a time: bounds the memory of offline work."""


@dataclass(frozen=True)
class StreamPlan:
    """Fingers, features, tare and rate of a feature stream.

    Attributes:
        sensors: sensor of each finger, in the order of the arrays.
        features: features of each finger.
        window: N_w of the sigma that is reported [samples].
        tare: how the baseline is found.
        rate: samples per second [Hz].
        ignore: indices by finger, from 0, of taxels that contribute nothing and cause no fault.
        in_contact: whether the first samples are load; None for a recording whose metadata say it.
        baselines: (n_taxels, 3) readings without contact, by finger, for a stream that begins in
            contact [unit of the readings].
    """

    sensors: Mapping[str, Sensor]
    features: Mapping[str, Sequence[FeatureSpec]]
    window: int
    tare: Tare
    rate: float
    ignore: Mapping[str, Sequence[int]] = field(default_factory=dict)
    in_contact: bool | None = None
    baselines: Mapping[str, Array] = field(default_factory=dict)

    @property
    def used_tare(self) -> Tare:
        """The tare, or what takes its place in a stream that begins in contact."""
        if not self.in_contact:
            return self.tare
        return loaded_tare(self.tare, self.sensors, tuple(self.baselines))

    @property
    def fingers(self) -> tuple[str, ...]:
        """Names of the fingers, in the order of the arrays."""
        return tuple(self.sensors)


class FingerFeatures(NamedTuple):
    """Features of one finger over a recording.

    Attributes:
        features: (n, n_features); NaN where there are none.
        amplitude: (n,) F_a [unit of the readings]; NaN where there is no force.
    """

    features: Array
    amplitude: Array


class HandSamples(NamedTuple):
    """Samples of several fingers at successive instants.

    Attributes:
        times: (n,) [s].
        present: (n, n_fingers) True for each finger with a sample at that instant.
        readings: (n, n_taxels, 3) of all fingers, one after the other.
    """

    times: Array
    present: Flags
    readings: Array


class FeatureStream:
    """Feature stream of a hand: its plan as arrays, for `kernel.advance` and for the C kernel.

    Args:
        plan: fingers, features, tare and rate.

    Attributes:
        plan: the same.
        layout: the plan as constant arrays.
        memory: of the stream, before the first sample.
        output: of the stream, before the first sample.
        slices: taxels of each finger in the arrays of all taxels.
    """

    def __init__(self, plan: StreamPlan) -> None:
        self.plan = plan
        self.layout = _layout(plan)
        self.memory = _memory(self.layout)
        self.output = _output(self.layout)
        bounds = pairwise(self.layout.offsets.tolist())
        self.slices = dict(zip(plan.fingers, map(slice, *zip(*bounds, strict=True)), strict=True))
        if plan.in_contact and plan.used_tare.kind == "none":
            for finger, baseline in plan.baselines.items():
                self.memory.baseline[self.slices[finger]] = baseline

    @classmethod
    def for_recording(cls, plan: StreamPlan, recording: Recording) -> Self:
        """Return the stream for a recording, from which a tare by interval is taken.

        A finger that the recording lacks has no baseline then. The metadata of the recording say
        whether it begins in contact, unless the plan does.

        Raises:
            ValueError: a finger has no finite sample in the interval, or the metadata declare a
                baseline of another shape.
        """
        if begins_in_contact(recording.metadata, plan.in_contact):
            baselines = dict(plan.baselines) or declared_baselines(recording.metadata, plan.sensors)
            plan = replace(plan, in_contact=True, baselines=baselines)
        stream = cls(plan)
        if plan.tare.kind == "interval":
            stream._take_baseline(recording)
        return stream

    def baselines(self) -> dict[str, Array]:
        """Return (n_taxels, 3) the tare of each finger that has it [unit of the readings]."""
        complete = self.memory.counts[:, at.N_TARED] < 0
        return {
            finger: self.memory.baseline[taxels].copy()
            for (finger, taxels), done in zip(self.slices.items(), complete, strict=True)
            if done
        }

    def samples_of(self, recording: Recording) -> Iterator[HandSamples]:
        """Yield the samples of the plan's fingers in order of time, in chunks.

        Fingers that have a sample at the same time share an instant. A finger that the
        recording lacks is never present.

        Args:
            recording: that has at least one of the fingers.

        Yields:
            At most `CHUNK_SAMPLES` instants at a time.
        """
        modules = [
            (place, taxels, recording.modules[finger])
            for place, (finger, taxels) in enumerate(self.slices.items())
            if finger in recording.modules
        ]
        times = reduce(_union, (module.times for _, _, module in modules))
        for start in range(0, len(times), CHUNK_SAMPLES):
            chunk = np.ascontiguousarray(times[start : start + CHUNK_SAMPLES])
            present = np.zeros((len(chunk), len(self.slices)), dtype=np.bool_)
            readings = np.zeros((len(chunk), len(self.layout.rotations), 3))
            for place, taxels, module in modules:
                first = np.searchsorted(module.times, chunk[0], side="left")
                last = np.searchsorted(module.times, chunk[-1], side="right")
                rows = np.searchsorted(chunk, module.times[first:last])
                present[rows, place] = True
                readings[rows, taxels] = module.readings[first:last]
            yield HandSamples(chunk, present, readings)

    def _take_baseline(self, recording: Recording) -> None:
        plan = self.plan
        for finger, taxels in self.slices.items():
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
            self.memory.baseline[taxels] = baseline


def extract(plan: StreamPlan, recording: Recording) -> dict[str, FingerFeatures]:
    """Return the features of every finger of the plan, at each of its samples.

    Args:
        plan: fingers, features, tare and rate.
        recording: that has all fingers of the plan.

    Returns:
        By finger, one row for each sample of its module.

    Raises:
        ValueError: a tare by interval finds no samples.
    """
    stream = FeatureStream.for_recording(plan, recording)
    kernel = c_stream(stream.layout, stream.memory)
    width = stream.layout.specs.shape[1]
    chunks: dict[str, list[FingerFeatures]] = {finger: [] for finger in plan.fingers}
    for times, present, readings in stream.samples_of(recording):
        features = np.full((*present.shape, width), np.nan)
        amplitude = np.full(present.shape, np.nan)
        kernel.advance(readings, present, times, features, amplitude)
        for place, finger in enumerate(plan.fingers):
            rows, n_features = present[:, place], len(plan.features[finger])
            own = FingerFeatures(features[rows, place, :n_features], amplitude[rows, place])
            chunks[finger].append(own)
    return {
        finger: FingerFeatures(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
        for finger, found in chunks.items()
    }


def _layout(plan: StreamPlan) -> Layout:
    sensors = list(plan.sensors.values())
    features = [plan.features[finger] for finger in plan.fingers]
    width = max(1, *(len(specs) for specs in features))
    longest = [max([plan.window, *(spec.window for spec in specs)]) for specs in features]
    lags = sorted({spec.seconds for specs in features for spec in specs if spec.seconds})
    families = _families([spec for specs in features for spec in specs], lags)
    ready = [
        2 if all(spec.seconds for spec in specs) else most
        for specs, most in zip(features, longest, strict=True)
    ]
    floors = np.zeros((len(sensors), width))
    for row, specs in zip(floors, features, strict=True):
        row[: len(specs)] = [spec.floor for spec in specs]
    tare, ignored = plan.used_tare, [_ignored(plan, finger) for finger in plan.fingers]
    rotations = [
        np.where(i[:, None, None], 0, s.rotations) for i, s in zip(ignored, sensors, strict=True)
    ]
    bridges = [all(spec.seconds for spec in specs) and bool(specs) for specs in features]
    steps = [_max_step(plan.rate, bridged=bridged) for bridged in bridges]
    constants = [
        (*_constants(s, int((~i).sum())), step)
        for i, s, step in zip(ignored, sensors, steps, strict=True)
    ]
    return Layout(
        offsets=np.cumsum([0, *(sensor.n_taxels for sensor in sensors)]),
        n_taxels=np.array([sensor.n_taxels for sensor in sensors], dtype=np.int64),
        rotations=np.concatenate(rotations),
        constants=np.array(constants),
        specs=np.stack([spec_codes(specs, width, lags) for specs in features]),
        floors=floors,
        windows=np.array(
            [(plan.window, *parts) for parts in zip(longest, ready, bridges, strict=True)],
            dtype=np.int64,
        ),
        ignored=np.concatenate(ignored),
        alike=len({tuple(specs) for specs in features}) == 1,
        tare_kind=TARE_KINDS[tare.kind],
        tare_seconds=tare.seconds,
        noise_seconds=_noise_seconds(plan),
        zero_unknown=plan.in_contact is True and tare.kind == "first",
        period=1.0 / plan.rate,
        lags=np.array([max(1, round(lag * plan.rate)) for lag in lags], dtype=np.int64),
        lag_seconds=np.array(lags, dtype=np.float64),
        average_gain=-float(np.expm1(-1.0 / (plan.rate * AVERAGE_SECONDS))),
        has_centres=bool(families[:, at.LAGS].any()),
        has_ratios=bool(families[:, at.RATIOS].any()),
        families=families,
        places=np.concatenate([_places(s, i) for s, i in zip(sensors, ignored, strict=True)]),
        normals=np.array([sensor.normal for sensor in sensors], dtype=np.float64),
        normal_axes=np.array([_axis_of(sensor.normal) for sensor in sensors], dtype=np.int64),
        n_levels=n_levels(max(longest)),
    )


def _families(specs: Sequence[FeatureSpec], lags: Sequence[float]) -> Integers:
    """Return `Layout.families` for the lags of some features [s]."""
    seconds = (*SECOND_KINDS, *MEAN_SECOND_KINDS)
    families = (LAG_KINDS, seconds, MEAN_SECOND_KINDS, RATIO_KINDS)
    needed = [
        [any(x.kind in kinds and x.seconds == lag for x in specs) for kinds in families]
        for lag in lags
    ]
    return np.array(needed, dtype=np.int64).reshape(len(lags), len(families))


def _places(sensor: Sensor, ignored: Flags) -> Array:
    """Return the taxels' places about their centroid, in root mean square distances from it."""
    used = sensor.positions[~ignored]
    if not len(used):
        return np.zeros_like(sensor.positions)
    places = sensor.positions - used.mean(axis=0)
    radius = float(np.sqrt((places[~ignored] ** 2).sum(axis=1).mean()))
    return places / radius if radius > 0 else np.zeros_like(places)


def _axis_of(normal: Array) -> int:
    """Return the axis that a normal is, or 3 if it is between axes."""
    axes = [axis for axis in range(3) if normal.tolist() == np.eye(3)[axis].tolist()]
    return axes[0] if axes else 3


def _max_step(rate: float, *, bridged: bool) -> float:
    """Return the longest step in time between samples that is no gap of a finger [s]."""
    longest = GAP_LIMIT_PERIODS / rate
    return max(longest, MAX_BRIDGED_SECONDS) if bridged else longest


def _noise_seconds(plan: StreamPlan) -> float:
    if plan.in_contact:
        return LOADED_NOISE_SECONDS
    return plan.tare.seconds if plan.tare.kind == "seconds" else NOISE_SECONDS


def _ignored(plan: StreamPlan, finger: str) -> Flags:
    flags = np.zeros(plan.sensors[finger].n_taxels, dtype=np.bool_)
    flags[list(plan.ignore.get(finger, ()))] = True
    return flags


def _constants(sensor: Sensor, n_used: int) -> tuple[float, ...]:
    """Return the first columns of `Layout.constants`; each used taxel rounds its readings."""
    low, high = sensor.range or (-np.inf, np.inf)
    end, offset = END_SHARE * (high - low), OFFSET_SHARE * (high - low)
    max_offset = offset * n_used * (1.0 + WEIGHT_Y + WEIGHT_Z)
    noise = COUNT_NOISE if sensor.unit == "count" else NEWTON_NOISE
    rounding = noise if sensor.unit == "count" else np.nan
    ends = (low + end, high - end) if sensor.range else (low, high)
    return low, high, *ends, max_offset, float(noise * np.sqrt(n_used)), rounding, n_used


def _memory(layout: Layout) -> Memory:
    n_fingers, n_taxels = len(layout.windows), len(layout.rotations)
    longest = int(layout.windows[:, at.LONGEST_WINDOW].max())
    levels = np.zeros((n_fingers, at.LEVELS_WIDTH))
    levels[:, [at.FIRST_TIME, at.LAST_TIME, at.NOISE, at.REST_SUM]] = np.nan
    # A second difference looks back by two lags.
    reaches = layout.lags * (1 + layout.families[:, at.SECONDS])
    length = RING_SPARE * int(reaches.max()) + 1 if len(reaches) else 1
    motion = np.zeros((n_fingers, at.MOTION_WIDTH))
    motion[:, [at.LEAST_NOISE, at.LEAST_TAXEL_NOISE]] = np.inf
    motion[:, at.BLOCK_START] = np.nan
    motion[:, at.MOVED_AT] = -np.inf
    of_components = [FEATURE_KINDS.index(kind) for kind in OF_COMPONENTS]
    n_channels = at.N_CHANNELS if np.isin(layout.specs[:, :, at.KIND], of_components).any() else 1
    taxels = np.zeros((n_taxels, at.TAXELS_WIDTH))
    taxels[layout.ignored, at.CHANGED_AT] = np.inf  # never long ago
    return Memory(
        baseline=np.zeros((n_taxels, 3)),
        previous=np.zeros((n_taxels, 3)),
        taxels=taxels,
        masks=np.zeros((n_taxels, at.MASKS_WIDTH)),
        history=np.zeros((n_fingers, at.N_CHANNELS, 2 * longest)),
        counts=np.zeros((n_fingers, at.COUNTS_WIDTH), dtype=np.int64),
        levels=levels,
        own=np.full((n_fingers, layout.specs.shape[1]), np.nan),
        hand=np.full(layout.specs.shape[1], np.nan),
        taxel_forces=np.zeros((length, n_taxels, 3)),
        reference=np.zeros((n_taxels, 3)),
        track=np.zeros((n_fingers, at.TRACK_WIDTH, length)),
        motion=motion,
        relative=np.full((n_fingers, len(RELATIVE_KINDS), len(layout.lags)), np.nan),
        pressed=np.zeros(n_taxels),
        averages=np.full((n_fingers, at.N_SECONDS, len(layout.lags)), np.nan),
        blocks=np.zeros((n_fingers, longest, n_channels * layout.n_levels * N_SUMS)),
        sums=np.full((n_fingers, untrue.N_RING_SUMS), np.nan),
        rings=np.zeros((n_taxels, at.RINGS_WIDTH)),
    )


def _output(layout: Layout) -> Output:
    n_fingers = len(layout.windows)
    status = np.zeros((n_fingers, at.STATUS_WIDTH), dtype=np.int64)
    status[:, at.REASON] = at.TARE if layout.tare_kind == at.TARE_SECONDS else at.WARM_UP
    return Output(
        features=np.full((n_fingers, layout.specs.shape[1]), np.nan),
        values=np.full((n_fingers, at.VALUES_WIDTH), np.nan),
        status=status,
    )


def _union(one: Array, two: Array) -> Array:
    return one if np.array_equal(one, two) else np.union1d(one, two)
