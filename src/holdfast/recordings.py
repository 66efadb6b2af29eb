"""Recordings: continuous captures of a hand. Values only, no files and no clock."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from holdfast.blocks import Digests, module_blocks
from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.sensors import Sensor, as_sensor
from holdfast.sensors.types import Array, Flags, Unit, rebuilt

GAP_PERIODS = 3.0
"""A step in time of more sample periods is a gap."""
STARTS_LOADED = "starts_loaded"
"""Field of the metadata: true if the object is held at the first sample."""
BASELINES = "baselines"
"""Field of the metadata: readings without contact by module, for each taxel and axis."""
HASHED_SAMPLES = 4096
"""Number of samples that are hashed or compared at a time: bounds the memory."""
MAX_SHOWN_CLOCK = 1e5
"""If a recording starts later than this, times are shown since its start [s]."""


@dataclass(frozen=True, slots=True)
class Label:
    """Contact state over the interval [start, end), with its evidence.

    Attributes:
        start: first instant, on the clock of the recording [s].
        end: first instant after the interval [s].
        state: STABLE, UNSTABLE or NO_CONTACT.
        cause: cause of a contact that is not stable; None if unknown.
        evidence: evidence for the label ("hand", "slip measured by marker", ...).
        confidence: from 0 to 1.
        author: name of a person or of a rule.

    Raises:
        ValueError: the interval does not end after its start, or a field is out of range.

    Example:
        >>> Label(0.5, 1.0, "UNSTABLE", "slip").cause
        <Cause.SLIP: 'slip'>
    """

    start: float
    end: float
    state: ContactState
    cause: Cause | None = None
    evidence: str = ""
    confidence: float = 1.0
    author: str = ""

    def __post_init__(self) -> None:
        if not -math.inf < self.start < self.end < math.inf:
            raise ValueError(f"a label ends after its start; [{self.start}, {self.end}) s given")
        object.__setattr__(self, "state", ContactState(self.state))
        object.__setattr__(self, "cause", None if self.cause is None else Cause(self.cause))
        if self.state is ContactState.UNKNOWN:
            raise ValueError("a label is STABLE, UNSTABLE or NO_CONTACT; UNKNOWN given")
        if not 0 <= self.confidence <= 1:
            raise ValueError(f"confidence from 0 to 1 expected, {self.confidence} given")


@dataclass(frozen=True, eq=False)
class Tactile:
    """Readings of one sensor over time, and their labels.

    The arrays are read-only. Readings keep their number type.

    Attributes:
        sensor: the sensor that gave the readings, or the name of a built-in one.
        times: (n,) strictly increasing, on the clock of the recording [s].
        readings: (n, n_taxels, 3) in taxel frames [unit]; NaN where a value is missing.
        unit: `count` or `N`; by default the unit of the sensor. Another unit means that the
            readings are calibrated.
        labels: intervals in order of time, without overlap, within the recording.

    Raises:
        RecordingError: shapes, times or labels contradict each other.

    Example:
        >>> Tactile("uskin-4x4", np.arange(3) / 100, np.zeros((3, 16, 3)))
        Tactile('uskin-4x4', 3 samples of 16 taxels, 100 Hz, count, 0 labels)
    """

    sensor: Sensor
    times: Array
    readings: npt.NDArray[Any]
    unit: Unit | None = None
    labels: tuple[Label, ...] = ()

    def __post_init__(self) -> None:
        times = _read_only(np.asarray(self.times, dtype=np.float64))
        readings = _read_only(np.asarray(self.readings))
        sensor = as_sensor(self.sensor)
        object.__setattr__(self, "sensor", sensor)
        if times.ndim != 1:
            raise RecordingError(f"times of shape (n,) expected, {times.shape} given")
        if readings.ndim != 3 or readings.shape[2] != 3:
            raise RecordingError(
                f"readings of shape (n, {sensor.n_taxels}, 3) expected for {sensor.name}, "
                f"{readings.shape} given"
            )
        if readings.shape[1] != sensor.n_taxels:
            raise RecordingError(
                f"{readings.shape[1]} taxels given, {sensor.n_taxels} expected ({sensor.name})"
            )
        if len(readings) != len(times):
            raise RecordingError(f"{len(readings)} samples given with {len(times)} times")
        if not (
            np.issubdtype(readings.dtype, np.integer) or np.issubdtype(readings.dtype, np.floating)
        ):
            raise RecordingError(f"readings must be numbers; {readings.dtype} given")
        if not np.isfinite(times).all():
            raise RecordingError("a time is not finite; seconds expected")
        steps = np.diff(times)
        if (steps <= 0).any():  # windows by time, and the search for a sample, rest on their order
            k = int(np.flatnonzero(steps <= 0)[0])
            what = "stand still" if steps[k] == 0 else "go back"
            raise RecordingError(
                f"times {what} at sample {k + 1}: {times[k + 1]:.15g} s after {times[k]:.15g} s; "
                "strictly increasing times expected"
            )
        labels = tuple(sorted(self.labels, key=lambda label: label.start))
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "readings", readings)
        unit = self.unit or sensor.unit
        if unit != sensor.unit:  # calibrated: range, step and rest hold for raw readings
            raw = replace(sensor, unit=unit, range=None, step=None, rests_at_zero=False)
            object.__setattr__(self, "sensor", raw)
        object.__setattr__(self, "unit", unit)
        object.__setattr__(self, "labels", labels)
        if labels:
            _check_labels(labels, times, self.period)

    def __repr__(self) -> str:
        return (
            f"Tactile({self.sensor.name!r}, {self.n_samples} samples of {self.sensor.n_taxels} "
            f"taxels, {self.rate:.4g} Hz, {self.unit}, {len(self.labels)} labels)"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return len(self.times)

    @cached_property
    def readings_digest(self) -> str:
        """Hash of the readings alone, whatever their times, number type and file format."""
        # In parts: as float64, counts of 16 bits take four times their memory.
        state = hashlib.blake2b(repr(self.readings.shape).encode(), digest_size=16)
        for first in range(0, self.n_samples, HASHED_SAMPLES):
            part = self.readings[first : first + HASHED_SAMPLES]
            state.update(np.ascontiguousarray(part, dtype=np.float64).data)
        return state.hexdigest()

    @cached_property
    def period(self) -> float:
        """Mean step in time [s]; the period of the sensor if there is no step.

        Steps over three times the median are gaps and are left out. The mean is more exact than
        the median: with times in whole milliseconds, the median of a 149.5 Hz stream gives 143
        or 167 Hz.
        """
        steps = np.diff(self.times)
        if not len(steps):
            return 1 / self.sensor.rate
        return float(steps[steps <= GAP_PERIODS * np.median(steps)].mean())

    @property
    def rate(self) -> float:
        """Samples per second, from the mean step in time [Hz]."""
        return 1 / self.period

    @property
    def n_gaps(self) -> int:
        """Number of steps in time that are longer than three periods."""
        return int((np.diff(self.times) > GAP_PERIODS * self.period).sum())

    @property
    def n_repeats(self) -> int:
        """Number of samples that repeat the readings of the sample before."""
        return int(self.repeats().sum())

    def repeats(self) -> Flags:
        """Return (n - 1,) whether each sample after the first repeats the one before."""
        same = np.ones(max(self.n_samples - 1, 0), dtype=np.bool_)
        for first in range(0, len(same), HASHED_SAMPLES):
            part = self.readings[first : first + HASHED_SAMPLES + 1]
            same[first : first + HASHED_SAMPLES] = (part[1:] == part[:-1]).all(axis=(1, 2))
        return same

    @property
    def label_states(self) -> npt.NDArray[np.int8]:
        """(n,) code of the labelled state at each sample; UNKNOWN without a label."""
        return label_states(self.labels, self.times)

    def slice(self, start: int, stop: int) -> Self:
        """Return the samples from index `start` up to `stop`, with the labels cut to them."""
        part = replace(
            self, times=self.times[start:stop], readings=self.readings[start:stop], labels=()
        )
        if not part.n_samples:
            return part
        return replace(part, labels=cut_labels(self.labels, part))


def cut_labels(labels: Sequence[Label], module: Tactile) -> tuple[Label, ...]:
    """Return the labels that overlap the samples of a module, cut to them."""
    if module.n_samples == 0:
        return ()
    first, last = float(module.times[0]), float(module.times[-1]) + module.period
    return tuple(
        label
        if first <= label.start and label.end <= last
        else replace(label, start=max(label.start, first), end=min(label.end, last))
        for label in labels
        if label.start < last and label.end > first
    )


@dataclass(frozen=True, eq=False)
class Truth:
    """Ground truth of a recording, on the clock of its modules.

    Attributes:
        times: (n,) [s].
        hand: arrays with first axis n: `phase`, `outside_force` (n, 3) in the world [N],
            `object_pose` (n, 7) position [m] and quaternion w x y z in the world, `joints`
            (n, n_joints) [rad], and further arrays of a source. The twin adds
            `set_point_error` (n,), the largest error of a joint's set point [rad], which is not
            0 in a glitch of the controller.
        fingers: such arrays of each finger: `contact_force` (n, 3) on the object in the world
            [N], `slip_speed` (n,) [m/s], `slipping_share` (n,), `tip_pose` (n, 7).

    Raises:
        RecordingError: an array does not have n rows.

    Example:
        >>> truth = Truth(np.arange(2) / 100, {"phase": ["free", "closing"]})
        >>> truth.hand["phase"].tolist()
        ['free', 'closing']
    """

    times: Array
    hand: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    fingers: Mapping[str, Mapping[str, npt.NDArray[Any]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.times)
        fingers = {finger: _locked_arrays(arrays, n) for finger, arrays in self.fingers.items()}
        object.__setattr__(self, "times", _read_only(np.asarray(self.times, dtype=np.float64)))
        object.__setattr__(self, "hand", _locked_arrays(self.hand, n))
        object.__setattr__(self, "fingers", MappingProxyType(fingers))

    def __repr__(self) -> str:
        return f"Truth({len(self.times)} samples of the hand and {', '.join(self.fingers)})"

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)

    def slice(self, start: int, stop: int) -> Self:
        """Return the truth of the samples from index `start` up to `stop`."""
        part = slice(start, stop)
        fingers = {
            finger: {name: array[part] for name, array in arrays.items()}
            for finger, arrays in self.fingers.items()
        }
        hand = {name: array[part] for name, array in self.hand.items()}
        return replace(self, times=self.times[part], hand=hand, fingers=fingers)


@dataclass(frozen=True, eq=False)
class Recording:
    """One continuous capture of a hand.

    Attributes:
        name: name of its file without the suffix.
        modules: readings of each sensor. Fingertips are named `thumb`, `index`, `middle`,
            `ring`; pads `index/1`, the palm `palm/1`. Modules without known names are
            `finger1`, `finger2`, ... in the order of the device.
        metadata: `object`, `object_mass` [kg], `case`, `repeat`, `profile`, `seed`, `hand`,
            `source` and further plain JSON values.
        truth: ground truth, or None.
        markers: (time [s], text) of each marker that was set while recording.
        media: (path of a video, offset [s] of its start on the clock of the recording).
        complete: False if the end of the file was cut off and the rest was recovered.

    Raises:
        RecordingError: there is no module, or no module has a sample.

    Example:
        >>> module = Tactile("uskin-4x4", np.arange(3) / 100, np.zeros((3, 16, 3)))
        >>> Recording("made", {"index": module})
        Recording('made', 0.02 s of index)
    """

    name: str
    modules: Mapping[str, Tactile]
    metadata: Mapping[str, Any] = field(default_factory=dict)
    truth: Truth | None = None
    markers: tuple[tuple[float, str], ...] = ()
    media: tuple[tuple[str, float], ...] = ()
    complete: bool = True

    def __post_init__(self) -> None:
        modules = self.modules.values() if isinstance(self.modules, Mapping) else [self.modules]
        for module in modules:
            if not isinstance(module, Tactile):
                raise RecordingError(
                    f"recording {self.name!r}: modules by name expected, as "
                    '{"index": Tactile("uskin-4x4", times, readings)}; '
                    f"{type(module).__name__} given"
                )
        if not any(module.n_samples for module in modules):
            raise RecordingError(f"recording {self.name!r} has no samples; at least one expected")
        object.__setattr__(self, "modules", MappingProxyType(dict(self.modules)))
        object.__setattr__(self, "metadata", MappingProxyType(dict(self.metadata)))
        object.__setattr__(self, "markers", tuple((float(t), str(x)) for t, x in self.markers))
        object.__setattr__(self, "media", tuple((str(p), float(t)) for p, t in self.media))

    def __repr__(self) -> str:
        return f"Recording({self.name!r}, {self.duration:.4g} s of {', '.join(self.modules)})"

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)

    @property
    def start(self) -> float:
        """Time of the first sample of any module [s]."""
        return min(float(m.times[0]) for m in self.modules.values() if m.n_samples)

    @property
    def end(self) -> float:
        """Time of the last sample of any module [s]."""
        return max(float(m.times[-1]) for m in self.modules.values() if m.n_samples)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return self.end - self.start

    @property
    def rate(self) -> float:
        """Samples per second, the median of its modules [Hz]."""
        return float(np.median([m.rate for m in self.modules.values() if m.n_samples]))

    @cached_property
    def digest(self) -> str:
        """Hash of the times, readings and sensors, the same in every file format.

        The name, labels and metadata do not count, so a recording with other labels keeps its
        digest.
        """
        state = hashlib.blake2b(digest_size=16)
        for name in sorted(self.modules):
            module = self.modules[name]
            readings = np.ascontiguousarray(module.readings)
            # Shapes and types too: the same bytes in another shape are another recording.
            head = (name, module.sensor.name, module.unit, readings.dtype.str, readings.shape)
            state.update(repr(head).encode())
            state.update(np.ascontiguousarray(module.times).data)
            state.update(readings.data)
        return state.hexdigest()

    @cached_property
    def readings_digest(self) -> str:
        """Hash of the readings of all modules, without times and names: copies have the same."""
        parts = sorted(module.readings_digest for module in self.modules.values())
        return hashlib.blake2b("".join(parts).encode(), digest_size=16).hexdigest()

    @cached_property
    def blocks(self) -> Digests:
        """Digests of the blocks of all modules, in order of time: parts of it have some of them.

        Times, labels and names of modules do not count, see `holdfast.blocks`.
        """
        modules = [module_blocks(module.readings) for module in self.modules.values()]
        shares = [np.arange(len(blocks)) / max(len(blocks), 1) for blocks in modules]
        return np.concatenate(modules)[np.argsort(np.concatenate(shares), kind="stable")]

    def check_modules_differ(self) -> None:
        """Check that no two modules have the same readings, unless these never change.

        Raises:
            RecordingError: two modules have the same readings.
        """
        names: dict[str, str] = {}
        for name, module in self.modules.items():
            first = names.setdefault(module.readings_digest, name)
            if first != name and not module.repeats().all():
                raise RecordingError(
                    f"recording {self.name!r}: {first} and {name} have the same readings; those "
                    "of different sensors expected"
                )

    @property
    def starts_loaded(self) -> bool:
        """Whether the metadata declare that the first samples are load, and not an open hand."""
        return self.metadata.get(STARTS_LOADED) is True

    def with_start(self, *, loaded: bool | None) -> Self:
        """Return it with the declaration whether its first samples are load; None for its own."""
        if loaded is None:
            return self
        return replace(self, metadata={**self.metadata, STARTS_LOADED: loaded})

    def with_labels(self, labels: Mapping[str, Sequence[Label]]) -> Self:
        """Return the same recording with these labels in place of its own.

        Args:
            labels: by module; a module that is not named gets none.

        Raises:
            RecordingError: the recording lacks a module, or a label lies outside its time.
        """
        if unknown := sorted(set(labels) - set(self.modules)):
            raise RecordingError(
                f"labels for {', '.join(unknown)} given; recording {self.name!r} "
                f"has {', '.join(self.modules)}"
            )
        modules = {
            name: replace(module, labels=tuple(labels.get(name, ())))
            for name, module in self.modules.items()
        }
        return replace(self, modules=modules)


def shown_origin(start: float) -> float:
    """Return the time that is shown to a person as 0 [s].

    It is the start of a recording whose clock counts from 1970, and 0 for any other.

    Args:
        start: time of the first sample [s].

    Example:
        >>> shown_origin(12.5), shown_origin(1795364053.99)
        (0.0, 1795364053.99)
    """
    return start if abs(start) > MAX_SHOWN_CLOCK else 0.0


def label_states(labels: Sequence[Label], times: Array) -> npt.NDArray[np.int8]:
    """Return the code of the labelled state at each time; UNKNOWN without a label.

    Args:
        labels: in order of time, without overlap.
        times: (n,) [s].

    Returns:
        (n,) codes as in `holdfast.contact`.
    """
    # 0 is the code of UNKNOWN.
    codes = np.zeros(len(times), dtype=np.int8)
    for label in labels:
        first, last = np.searchsorted(times, (label.start, label.end))
        codes[first:last] = label.state.code
    return codes


def labels_from_samples(
    times: Array,
    states: Sequence[tuple[ContactState, Cause | None] | None],
    *,
    period: float,
    evidence: str = "",
    author: str = "",
) -> tuple[Label, ...]:
    """Return labels over the runs of equal state in a state for each sample.

    Args:
        times: (n,) [s].
        states: n pairs of state and cause; None for a sample without a label.
        period: duration of the last sample [s].
        evidence: of every label.
        author: of every label.

    Raises:
        ValueError: the number of states differs from the number of times.
    """
    if len(states) != len(times):
        raise ValueError(f"{len(states)} states given for {len(times)} times")
    labels: list[Label] = []
    ends = [*times[1:].tolist(), float(times[-1]) + period] if len(times) else []
    first = 0
    for k, state in enumerate(states):
        if k + 1 < len(states) and states[k + 1] == state:
            continue
        if state is not None:
            span = (float(times[first]), float(ends[k]))
            labels.append(Label(*span, *state, evidence=evidence, author=author))
        first = k + 1
    return tuple(labels)


def _check_labels(labels: tuple[Label, ...], times: Array, period: float) -> None:
    if len(times) == 0:
        raise RecordingError(f"{len(labels)} labels given for a module without samples")
    # The last sample lasts for a period; half of one more allows for edges from another time grid.
    start, end = float(times[0]), float(times[-1]) + 1.5 * period
    tolerance = 1e-6
    for label in labels:
        if label.start < start - tolerance or label.end > end + tolerance:
            raise RecordingError(
                f"label {_span(label)} lies outside the recording, "
                f"which runs from {start:.15g} to {end:.15g} s"
            )
    for label, following in pairwise(labels):
        if following.start < label.end - tolerance:
            raise RecordingError(f"labels overlap: {_span(label)} and {_span(following)}")


def _span(label: Label) -> str:
    return f"[{label.start:.15g}, {label.end:.15g}) s"


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    # A view, so that the array of the caller stays writable.
    view = array.view()
    view.flags.writeable = False
    return view


def _locked_arrays(
    arrays: Mapping[str, npt.NDArray[Any]], n: int
) -> Mapping[str, npt.NDArray[Any]]:
    locked = {name: _read_only(np.asarray(array)) for name, array in arrays.items()}
    for name, array in locked.items():
        if len(array) != n:
            raise RecordingError(f"truth {name!r} has {len(array)} rows for {n} times")
    return MappingProxyType(locked)
