"""The plan of a feature stream: sensors, features, tare and start; samples of recordings for it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from itertools import pairwise
from typing import Any, Literal, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from holdfast.contact import MAX_TAXELS
from holdfast.detection.specs import FeatureSpec
from holdfast.errors import ModelError
from holdfast.recordings import BASELINES, STARTS_LOADED, Recording, Tactile
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Flags

TareArgument = float | str | tuple[float, float]
"""Seconds from the start, "first", "none", "START:END", or (start, end) in seconds."""

SEARCH_BLOCK = 1024
"""Samples in which the first finite one is searched at a time."""
CHUNK_SAMPLES = 2048
"""Instants that are packed at a time: bounds the memory of offline work."""


@dataclass(frozen=True)
class Tare:
    """How the baseline is found.

    Attributes:
        kind: `seconds` (the mean of the first `seconds`), `first` (the first sample, for
            recordings that begin in contact), `none`, or `interval` (offline only).
        seconds: duration, for `seconds` [s].
        interval: start and end on the clock of the recording, for `interval` [s].
    """

    kind: Literal["seconds", "first", "none", "interval"]
    seconds: float = 0.0
    interval: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def parse(cls, tare: "TareArgument | Tare") -> Self:
        """Return the tare that a number, a text or a pair of times describes.

        Raises:
            ValueError: it is none of the known forms.

        Example:
            >>> Tare.parse("0.5").seconds, Tare.parse("first").kind, Tare.parse("1:2").interval
            (0.5, 'first', (1.0, 2.0))
        """
        if isinstance(tare, Tare):
            return cls(tare.kind, tare.seconds, tare.interval)
        if tare in ("first", "none"):
            return cls(tare)  # type: ignore[arg-type]
        try:
            times = tare.split(":") if isinstance(tare, str) and ":" in tare else tare
            if isinstance(times, list | tuple):
                start, end = (float(time) for time in times)
                if not (math.isfinite(start) and math.isfinite(end) and start < end):
                    raise ValueError("an interval must end after its start")
                return cls("interval", interval=(start, end))
            seconds = float(times)
            if not (math.isfinite(seconds) and seconds > 0):
                raise ValueError("a duration above 0 s is needed")
            return cls("seconds", seconds)
        except (TypeError, ValueError) as cause:
            raise ValueError(
                f"tare: seconds above 0, 'first', 'none' or START:END expected, {tare!r} given"
            ) from cause

    @property
    def without_contact(self) -> bool:
        """Whether its samples show the noise of the sensor without contact."""
        return self.kind == "seconds"

    def __str__(self) -> str:
        # `repr` is the shortest text that is read back as the same number: a model file has it.
        numbers = {"seconds": (self.seconds,), "interval": self.interval}.get(self.kind)
        if numbers is None:
            return self.kind
        return ":".join(repr(number).removesuffix(".0") for number in numbers)


def baseline_of(
    readings: npt.NDArray[Any], times: Array, tare: Tare, period: float
) -> tuple[Array, int]:
    """Return the baseline of a recorded module.

    Times are compared with half a sample period of tolerance, so that their rounding does not
    move a sample into the tare or out of it.

    Args:
        readings: (n, n_taxels, 3) [count or N].
        times: (n,) [s].
        tare: how the baseline is found.
        period: of the samples [s].

    Returns:
        (n_taxels, 3) float64 in the unit of the readings, and the first sample from which it may
        be subtracted without looking ahead (0 for an interval).

    Raises:
        ValueError: no finite sample lies in the time of the tare.
    """
    if tare.kind == "none" or not (len(readings) or tare.kind == "interval"):
        return np.zeros(readings.shape[1:]), 0
    if tare.kind == "interval":
        inside = (times >= tare.interval[0]) & (times < tare.interval[1])
        return _mean(readings[inside], tare), 0
    start = first_finite(readings)
    if tare.kind == "first":
        return readings[start].astype(np.float64), start
    # From the first finite sample on, as in a stream.
    inside = times - times[start] + 0.5 * period < tare.seconds
    inside[: start + 1] = True  # one sample at least
    return _mean(readings[inside], tare), int(inside.sum())


def offline_tare(tare: TareArgument | Tare, module: Tactile) -> Tare:
    """Return the same tare for all samples of a module, those before it is complete included.

    A tare by seconds becomes the interval of those seconds from the first finite sample on.

    Raises:
        ValueError: the tare is unknown.
    """
    how = Tare.parse(tare)
    if how.kind != "seconds" or not module.n_samples:
        return how
    start = float(module.times[first_finite(module.readings)])
    return Tare("interval", interval=(start, start + max(how.seconds, module.period / 2)))


def first_finite(readings: npt.NDArray[Any]) -> int:
    """Return the index of the first sample without a reading that is not finite; 0 if none."""
    for row in range(0, len(readings), SEARCH_BLOCK):
        finite = np.isfinite(readings[row : row + SEARCH_BLOCK]).all(axis=(1, 2))
        if finite.any():
            return row + int(finite.argmax())
    return 0


def _mean(readings: npt.NDArray[Any], tare: Tare) -> Array:
    """Return the mean of the finite samples, added one after the other as in a stream."""
    values = readings[np.isfinite(readings).all(axis=(1, 2))].astype(np.float64)
    if not len(values):
        raise ValueError(f"tare {tare}: no finite sample in that time")
    # Not `mean`, which adds by pairs: a stream adds one sample after the other.
    return np.asarray(np.add.accumulate(values, axis=0)[-1] / len(values))


@dataclass(frozen=True)
class Start:
    """How the samples of a recording or a source begin.

    Attributes:
        loaded: whether the first samples are load, and not an open hand.
        baselines: (n_taxels, 3) readings without contact by finger, where they are known [unit of
            the readings].

    Example:
        >>> Start.of({"starts_loaded": True}, {}).loaded, Start.of({}, {}).loaded
        (True, False)
    """

    loaded: bool = False
    baselines: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, metadata: Mapping[str, Any], sensors: Mapping[str, Sensor]) -> Self:
        """Return the start that the metadata of a recording or a source declare.

        Args:
            metadata: `starts_loaded`, and `baselines` by finger.
            sensors: sensor of each finger.

        Raises:
            ValueError: the baselines are no finite numbers of the sensors' shapes.
        """
        if metadata.get(STARTS_LOADED) is not True:
            return cls()
        return cls(loaded=True, baselines=declared_baselines(metadata, sensors))

    def used_tare(self, tare: Tare, sensors: Mapping[str, Sensor]) -> Tare:
        """Return the tare of a model, or what takes its place if the first samples are load.

        It is none where the zero of every finger is known: it is declared, or the readings are in
        newtons. Counts have an offset that the readings do not show; they are counted from the
        first sample. A tare that does not rest on the first samples stays.

        Args:
            tare: of the model.
            sensors: sensor of each finger.
        """
        if not self.loaded or tare.kind in ("none", "interval"):
            return tare
        has_zero = all(name in self.baselines or s.unit == "N" for name, s in sensors.items())
        return Tare("none" if has_zero else "first")


OPEN_HAND = Start()
"""Start of a stream whose first samples are without contact."""


def declared_baselines(
    metadata: Mapping[str, Any], sensors: Mapping[str, Sensor]
) -> dict[str, Array]:
    """Return the readings without contact that the metadata declare, for some of the fingers.

    Args:
        metadata: of a recording or a source.
        sensors: sensor of each finger.

    Returns:
        (n_taxels, 3) by finger [unit of the readings].

    Raises:
        ValueError: they are no finite numbers of that shape.
    """
    stated = metadata.get(BASELINES)
    if stated is None:
        return {}
    if not isinstance(stated, Mapping):
        raise ValueError(f"metadata: {BASELINES} by finger expected, {type(stated).__name__} given")
    baselines = {}
    for finger in [finger for finger in sensors if finger in stated]:
        try:
            baseline = np.array(stated[finger], dtype=np.float64)
        except (TypeError, ValueError):
            baseline = np.empty(0)  # words, or rows of different lengths: refused by its shape
        n_taxels = sensors[finger].n_taxels
        if baseline.shape != (n_taxels, 3) or not np.isfinite(baseline).all():
            raise ValueError(
                f"metadata: {BASELINES} of {finger}: {n_taxels} taxels of 3 finite numbers "
                f"expected, an array of shape {baseline.shape} given"
            )
        baselines[finger] = baseline
    return baselines


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
        start: with an open hand, or in contact; for a tare by interval, with its baselines.

    Raises:
        ModelError: a sensor has more than `MAX_TAXELS`.
    """

    sensors: Mapping[str, Sensor]
    features: Mapping[str, Sequence[FeatureSpec]]
    window: int
    tare: Tare
    rate: float
    ignore: Mapping[str, Sequence[int]] = field(default_factory=dict)
    start: Start = OPEN_HAND

    def __post_init__(self) -> None:
        for name, sensor in self.sensors.items():
            if sensor.n_taxels > MAX_TAXELS:
                raise ModelError(
                    f"{name}: a sensor of {sensor.n_taxels} taxels given ({sensor.name}); "
                    f"at most {MAX_TAXELS} expected"
                )

    @property
    def used_tare(self) -> Tare:
        """The tare, or what takes its place in a stream that begins in contact."""
        return self.start.used_tare(self.tare, self.sensors)

    @property
    def fingers(self) -> tuple[str, ...]:
        """Names of the fingers, in the order of the arrays."""
        return tuple(self.sensors)

    @property
    def zero_unknown(self) -> bool:
        """Whether the stream begins in contact, and no readings without contact are known."""
        return self.start.loaded and self.used_tare.kind == "first"

    @property
    def width(self) -> int:
        """Number of features of the finger that has most; at least 1."""
        return max(1, *(len(specs) for specs in self.features.values()))

    def used(self, finger: str) -> Flags:
        """Return (n_taxels,) True for each taxel that is not ignored."""
        flags = np.ones(self.sensors[finger].n_taxels, dtype=np.bool_)
        flags[list(self.ignore.get(finger, ()))] = False
        return flags

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Taxels of each finger in the arrays of all taxels."""
        ends = np.cumsum([0, *(sensor.n_taxels for sensor in self.sensors.values())]).tolist()
        return {f: slice(*bounds) for f, bounds in zip(self.fingers, pairwise(ends), strict=True)}

    @property
    def baseline(self) -> Array:
        """(n_taxels, 3) readings without contact that are known at the start; 0 for others."""
        baseline = np.zeros((sum(sensor.n_taxels for sensor in self.sensors.values()), 3))
        kind = self.used_tare.kind
        if kind == "interval" or (kind == "none" and self.start.loaded):
            for finger, stated in self.start.baselines.items():
                baseline[self.slices[finger]] = stated
        return baseline

    def for_recording(self, recording: Recording) -> Self:
        """Return the plan with the start of a recording, and a tare by interval taken from it.

        Without a module in the recording, a finger has no baseline then.

        Raises:
            ValueError: a finger has no finite sample in the interval, or the metadata declare a
                baseline of another shape.
        """
        start = Start.of(recording.metadata, self.sensors)
        if self.tare.kind == "interval":
            modules = {f: recording.modules[f] for f in self.fingers if f in recording.modules}
            baselines = {f: self._baseline_of(f, m, recording) for f, m in modules.items()}
            start = replace(start, baselines=baselines)
        return replace(self, start=start)

    def _baseline_of(self, finger: str, module: Tactile, recording: Recording) -> Array:
        rows = slice(*np.searchsorted(module.times, self.tare.interval))
        readings = np.array(module.readings[rows], dtype=np.float64)
        # An ignored taxel may be broken: its readings must not make the samples not finite.
        readings[:, list(self.ignore.get(finger, ()))] = 0.0
        try:
            return baseline_of(readings, module.times[rows], self.tare, 1 / self.rate)[0]
        except ValueError as cause:
            raise ValueError(
                f"{finger} of {recording.name!r}, which runs from {recording.start:.15g} to "
                f"{recording.end:.15g} s: {cause}"
            ) from cause

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
            (index, taxels, recording.modules[finger])
            for index, (finger, taxels) in enumerate(self.slices.items())
            if finger in recording.modules
        ]
        # Fingers of one device have the same times, as a rule: no sorting then.
        times = reduce(
            lambda times, more: times if np.array_equal(times, more) else np.union1d(times, more),
            (module.times for _, _, module in modules),
        )
        n_taxels = max(taxels.stop for taxels in self.slices.values())
        for start in range(0, len(times), CHUNK_SAMPLES):
            chunk = np.ascontiguousarray(times[start : start + CHUNK_SAMPLES])
            present = np.zeros((len(chunk), len(self.slices)), dtype=np.bool_)
            readings = np.zeros((len(chunk), n_taxels, 3))
            for index, taxels, module in modules:
                # Both ends of the chunk are instants, and no time lies between two instants.
                first = np.searchsorted(module.times, chunk[0], side="left")
                last = np.searchsorted(module.times, chunk[-1], side="right")
                rows = np.searchsorted(chunk, module.times[first:last])
                present[rows, index] = True
                readings[rows, taxels] = module.readings[first:last]
            yield HandSamples(chunk, present, readings)
