"""Samples of recordings for a feature stream, and its features over a recording."""

from collections.abc import Iterator
from dataclasses import replace
from functools import reduce
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

from holdfast.detection.kernel_config import StreamTables, stream_tables
from holdfast.detection.plan import Start, StreamPlan, baseline_of
from holdfast.kernel import _extension
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Flags

CHUNK_SAMPLES = 2048
"""Instants that are packed at a time: bounds the memory of offline work."""


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
    """The start of a feature stream: its plan, and the readings that are its zero.

    Args:
        plan: fingers, features, tare and rate.

    Attributes:
        plan: the same.
        baseline: (n_taxels, 3) of all fingers, with which the stream begins: 0 where the tare finds
            it later [unit of the readings].
        slices: taxels of each finger in the arrays of all taxels.
    """

    def __init__(self, plan: StreamPlan) -> None:
        self.plan = plan
        ends = np.cumsum([0, *(sensor.n_taxels for sensor in plan.sensors.values())]).tolist()
        self.baseline = np.zeros((ends[-1], 3))
        self.slices = {
            finger: slice(*bounds)
            for finger, bounds in zip(plan.fingers, pairwise(ends), strict=True)
        }
        if plan.start.loaded and plan.used_tare.kind == "none":
            for finger, baseline in plan.start.baselines.items():
                self.baseline[self.slices[finger]] = baseline

    @classmethod
    def for_recording(cls, plan: StreamPlan, recording: Recording) -> Self:
        """Return the stream for a recording, from which a tare by interval is taken.

        A finger that the recording lacks has no baseline then. The start is that of the recording,
        whatever the plan has.

        Raises:
            ValueError: a finger has no finite sample in the interval, or the metadata declare a
                baseline of another shape.
        """
        stream = cls(replace(plan, start=Start.of(recording.metadata, plan.sensors)))
        if plan.tare.kind != "interval":
            return stream
        for finger, taxels in stream.slices.items():
            if finger not in recording.modules:
                continue
            module = recording.modules[finger]
            rows = slice(*np.searchsorted(module.times, plan.tare.interval))
            readings = np.array(module.readings[rows], dtype=np.float64)
            # An ignored taxel may be broken: its readings must not make the samples not finite.
            readings[:, list(plan.ignore.get(finger, ()))] = 0.0
            try:
                baseline, _ = baseline_of(readings, module.times[rows], plan.tare, 1 / plan.rate)
            except ValueError as cause:
                raise ValueError(
                    f"{finger} of {recording.name!r}, which runs from {recording.start:.15g} to "
                    f"{recording.end:.15g} s: {cause}"
                ) from cause
            stream.baseline[taxels] = baseline
        return stream

    def tables(self) -> tuple[*StreamTables, Array]:
        """Return the tables of the C kernel, and the baseline."""
        return (*stream_tables(self.plan), self.baseline)

    def start(self) -> _extension.Stream:
        """Return the stream before its first sample, for features alone."""
        return _extension.Stream(*self.tables())

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
        # Fingers of one device have the same times, as a rule: no sorting then.
        times = reduce(
            lambda times, more: times if np.array_equal(times, more) else np.union1d(times, more),
            (module.times for _, _, module in modules),
        )
        for start in range(0, len(times), CHUNK_SAMPLES):
            chunk = np.ascontiguousarray(times[start : start + CHUNK_SAMPLES])
            present = np.zeros((len(chunk), len(self.slices)), dtype=np.bool_)
            readings = np.zeros((len(chunk), *self.baseline.shape))
            for place, taxels, module in modules:
                # Both ends of the chunk are instants, and no time lies between two instants.
                first = np.searchsorted(module.times, chunk[0], side="left")
                last = np.searchsorted(module.times, chunk[-1], side="right")
                rows = np.searchsorted(chunk, module.times[first:last])
                present[rows, place] = True
                readings[rows, taxels] = module.readings[first:last]
            yield HandSamples(chunk, present, readings)


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
    kernel = stream.start()
    chunks: dict[str, list[FingerFeatures]] = {finger: [] for finger in plan.fingers}
    for times, present, readings in stream.samples_of(recording):
        features = np.full((*present.shape, plan.width), np.nan)
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
