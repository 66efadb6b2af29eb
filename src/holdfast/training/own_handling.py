"""Own handling: the held samples of recordings of ordinary use, which need no labels.

What is held follows from the model's own rule of contact. Labels of slip, if any, refuse it.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import msgspec
import numpy as np

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE, Cause, Reason, faults_of
from holdfast.detection import ANY_FINGER, Debounce, FingerTrace, Model, detect
from holdfast.detection.features import extract
from holdfast.errors import TrainingError
from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_truth import sample_durations
from holdfast.recordings import BASELINES, Recording, shown_origin
from holdfast.resampling import at_rate
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Flags

MIN_HANDLING = 5.0
"""Least held time of own handling [s]."""
ENOUGH_HANDLING = 30.0
"""Held time of own handling below which the user is warned [s]."""
MAX_HANDLING = 1800.0
"""Held time of all fingers after which further recordings are not used [s]."""
MIN_TOUCH = 0.25
"""A finger holds something if it touches for this time without a break [s]. A clip of 0.5 s has
as much after the first samples, which have no features."""
EDGE_SECONDS = 0.5
"""Time after closing and before opening that is not handling [s]."""
MAX_EDGE_SHARE = 0.25
"""It is at most this share of the time from closing to opening."""
MAX_FAULTY_SHARE = 0.1
"""Own handling is refused if a finger is UNKNOWN by faults in more than this share of it."""
MAX_SLIP_SHARE = 0.01
"""Own handling is refused if its labels call more than this share of the held time a slip."""
MAX_SLIPS_SHOWN = 3
CHANGE_SECONDS = 0.5
"""Interval over which the change of the load is measured [s]."""
MIN_SCALE = 0.3
"""Least scale of a feature: a hand that holds still has next to none."""
CLIP_DEVIATIONS = 1.5
"""Values further from the location than this many scales count as at this distance."""
MAX_CLIP_STEPS = 50
"""Maximum number of steps in which location and scale are found."""
FAULT_CODE = tuple(Reason).index(Reason.FAULT)
"""Code of the reason fault."""


def check_shear(recording: Recording) -> None:
    """Check that no module reads normal forces alone: features of slips need the shear.

    Raises:
        TrainingError: in one, x and y of all taxels never change, while z does.
    """
    for name, module in recording.modules.items():
        changes = (module.readings != module.readings[:1]).any(axis=(0, 1))
        if changes.tolist() == [False, False, True]:
            raise TrainingError(
                f"{name}: normal force alone of {module.sensor.name} in {recording.name} (x and y "
                "of its taxels never change); three axes expected, as slips show in the shear"
            )


class HandlingKey(NamedTuple):
    """Where own handling stands in a model: a finger of the model (or `"*"`), and a sensor."""

    finger: str
    sensor: str

    @classmethod
    def of(cls, model: Model, finger: str, sensor: Sensor) -> "HandlingKey":
        """Return the key for a finger of a hand."""
        return cls(ANY_FINGER if ANY_FINGER in model.fingers else finger, sensor.name)

    def __str__(self) -> str:
        return self.sensor if self.finger == ANY_FINGER else f"{self.finger} ({self.sensor})"


@dataclass(frozen=True, eq=False)
class GraspedSamples:
    """Held samples of one finger of one recording.

    Attributes:
        finger: its name.
        sensor: its sensor.
        features: (n, n_features) of `stable`, finite.
        load_changes: (m,) change of the force within `CHANGE_SECONDS`, as a share of it; NaN if
            the load is not known: of counts of a recording that begins in contact.
        seconds: held time, with closing and opening [s].
    """

    finger: str
    sensor: Sensor
    features: Array
    load_changes: Array
    seconds: float


class _Faults(NamedTuple):
    n_faulty: int
    n: int
    mask: int


@dataclass
class OwnHandling:
    """Held samples of recordings, which are added one by one.

    Attributes:
        model: whose rule of contact and features are used.
        samples: by key.
        digests: content digest of each recording that is used, by name.
        n_left_out: number of recordings that were not needed.
    """

    model: Model
    samples: dict[HandlingKey, list[GraspedSamples]] = field(default_factory=dict)
    digests: dict[str, str] = field(default_factory=dict)
    n_left_out: int = 0
    _faults: dict[str, _Faults] = field(default_factory=dict)
    # Of all fingers: held time and the part of it that is labelled as slip [s], and these labels.
    _held_seconds: float = 0.0
    _slip_seconds: float = 0.0
    _slips: list[str] = field(default_factory=list)

    def add(self, recording: Recording) -> None:
        """Add a recording; leave it out if the held time is long enough already.

        Raises:
            ModelError: the recording has other fingers or sensors.
            TrainingError: a sensor differs from that of the same name in an earlier recording, or
                has no shear, which a slip rule needs.
        """
        if self.model.has_slip_rule:
            check_shear(recording)
        totals = [sum(self.fingers(key).values()) for key in self.samples]
        if totals and min(totals) > MAX_HANDLING:
            self.n_left_out += 1
            return
        self.digests[recording.name] = recording.digest
        recording = at_rate(recording, self.model.rate)
        # Without debouncing: hold and hysteresis would stretch or shorten what is held.
        raw = msgspec.structs.replace(self.model, debounce=Debounce())
        traces = detect(raw, recording).fingers
        sensors = {name: recording.modules[name].sensor for name in traces}
        rows = extract(self.model.plan(sensors, recording.rate), recording)
        loaded = recording.starts_loaded and BASELINES not in recording.metadata
        for name, trace in traces.items():
            before = self._faults.get(name, _Faults(0, 0, 0))
            faulty = trace.reason == FAULT_CODE
            mask = int(np.bitwise_or.reduce(trace.faults[faulty].astype(np.int64), initial=0))
            self._faults[name] = _Faults(
                before.n_faulty + int(faulty.sum()), before.n + len(trace), before.mask | mask
            )
            n_features = len(self.model.finger(name).stable.features)  # those that come first
            features = rows[name].features[:, :n_features]
            self._add_finger(name, sensors[name], trace, features, loaded=loaded)
            self._add_slips(recording, name, trace)

    def fingers(self, key: HandlingKey) -> dict[str, float]:
        """Return the held time of each finger of a key [s]."""
        totals: dict[str, float] = {}
        for part in self.samples[key]:
            totals[part.finger] = totals.get(part.finger, 0.0) + part.seconds
        return totals

    def seconds(self, key: HandlingKey) -> float:
        """Return the held time of the finger of a key that holds longest [s]."""
        return max(self.fingers(key).values())

    def features(self, key: HandlingKey) -> Array:
        """Return (n, n_features) the features of all held samples of a key."""
        return np.concatenate([part.features for part in self.samples[key]])

    def load_change(self, key: HandlingKey) -> float:
        """Return the median change of the force of a key, as a share of it.

        It is 0 if no hold is long enough, and NaN if no load is known.
        """
        changes = np.concatenate([part.load_changes for part in self.samples[key]])
        known = changes[np.isfinite(changes)]
        if len(known):
            return float(np.median(known))
        return math.nan if len(changes) else 0.0

    def check(self) -> None:
        """Check that the fingers have few faults and slips, and that one holds long enough.

        Raises:
            TrainingError: they have too many, or none does.
        """
        if self._slip_seconds > MAX_SLIP_SHARE * self._held_seconds:
            share = 100 * self._slip_seconds / self._held_seconds
            more = ", ..." if len(self._slips) > MAX_SLIPS_SHOWN else ""
            raise TrainingError(
                f"{share:.2g} % of the held time is labelled as slip, at most "
                f"{100 * MAX_SLIP_SHARE:g} % expected: {', '.join(self._slips[:MAX_SLIPS_SHOWN])}"
                f"{more}; ordinary handling without slip expected, pushes and pulls that hold "
                "included"
            )
        for finger, (n_faulty, n, mask) in self._faults.items():
            if n_faulty > MAX_FAULTY_SHARE * n:
                names = ", ".join(fault.value for fault in faults_of(mask))
                raise TrainingError(
                    f"{finger}: {100 * n_faulty / n:.0f} % of the handling has faults ({names}); "
                    f"at most {100 * MAX_FAULTY_SHARE:.0f} % expected, see holdfast info"
                )
        longest = max(map(self.seconds, self.samples), default=0.0)
        if longest == 0:
            n = len(self.digests)
            raise TrainingError(
                f"nothing is held in {n} recording{'s' * (n != 1)}; at least {MIN_HANDLING:g} s of "
                "ordinary handling expected, in recordings that begin with an open hand"
            )
        if longest < MIN_HANDLING:
            rounded = math.floor(10 * longest) / 10
            raise TrainingError(
                f"{rounded:.1f} s of holding given, at least {MIN_HANDLING:g} s expected "
                f"({ENOUGH_HANDLING:g} s or more are better)"
            )

    def _add_slips(self, recording: Recording, finger: str, trace: FingerTrace) -> None:
        """Add the held time of a finger, and the labels of slip within it."""
        touching = grasped_samples(trace.times, trace.state, edge_seconds=0.0)
        durations = grasped_durations(trace.times) * touching
        self._held_seconds += float(durations.sum())
        for label in recording.modules[finger].labels:
            inside = (trace.times >= label.start) & (trace.times < label.end)
            if label.cause is Cause.SLIP and (inside & touching).any():
                self._slip_seconds += float(durations[inside].sum())
                start, end = (t - shown_origin(recording.start) for t in (label.start, label.end))
                self._slips.append(f"{finger} {start:.2f} to {end:.2f} s of {recording.name}")

    def _add_finger(
        self, name: str, sensor: Sensor, trace: FingerTrace, features: Array, *, loaded: bool
    ) -> None:
        key = HandlingKey.of(self.model, name, sensor)
        known = self.samples.setdefault(key, [])
        if known and (known[0].sensor.n_taxels, known[0].sensor.unit) != (
            sensor.n_taxels, sensor.unit
        ):  # fmt: skip
            raise TrainingError(
                f"{sensor.name}: {sensor.n_taxels} taxels in {sensor.unit} given after "
                f"{known[0].sensor.n_taxels} in {known[0].sensor.unit}; one sensor of a name "
                "expected"
            )
        # Features are taken while something is held; its duration counts closing and opening, too.
        grasped = grasped_samples(trace.times, trace.state) & np.isfinite(features).all(axis=1)
        touching = grasped_samples(trace.times, trace.state, edge_seconds=0.0)
        seconds = float(grasped_durations(trace.times)[touching].sum())
        # The change of the force within `CHANGE_SECONDS`, as a share of it, of samples that were
        # held for that time.
        changes, step = np.empty(0), max(1, round(CHANGE_SECONDS / _period(trace.times)))
        if len(trace) > step:
            n_grasped = np.cumsum(np.append(0, grasped))
            kept = n_grasped[step + 1 :] - n_grasped[: -step - 1] == step + 1
            moved = np.linalg.norm(trace.force[step:] - trace.force[:-step], axis=1)[kept]
            load = np.linalg.norm(trace.force[step:], axis=1)[kept]
            changes = moved[load > 0] / load[load > 0]
        if loaded and sensor.unit == "count":  # newtons have a zero
            changes = np.full_like(changes, np.nan)
        known.append(GraspedSamples(name, sensor, features[grasped], changes, seconds))


def location_and_scale(features: Array) -> tuple[Array, Array]:
    """Return location and scale of features over samples of ordinary handling.

    They are mean and standard deviation of the values clipped to the location plus and minus
    `CLIP_DEVIATIONS` scales, the scale divided by that of clipped normal values (Huber's second
    proposal), so that a tenth of the samples may be slip. The scale is at least `MIN_SCALE`.

    Args:
        features: (n, n_features) finite.

    Returns:
        (n_features,) each.
    """
    # E min(z^2, c^2) of a normal z: 1 - 2 (1 - Phi(c)) (1 - c^2) - 2 c phi(c).
    c = CLIP_DEVIATIONS
    tails = math.erfc(c / math.sqrt(2))
    density = math.exp(-0.5 * c * c) / math.sqrt(2 * math.pi)
    shrinkage = math.sqrt(1 - tails * (1 - c * c) - 2 * c * density)
    # From the median, which few samples cannot move, and a scale that they make too large.
    location, scale = np.median(features, axis=0), features.std(axis=0)
    for _ in range(MAX_CLIP_STEPS):
        before = location, scale
        clipped = np.clip(features, location - c * scale, location + c * scale)
        location, scale = clipped.mean(axis=0), clipped.std(axis=0) / shrinkage
        if np.allclose(before, (location, scale), rtol=1e-9, atol=1e-9):
            break
    return location, np.maximum(scale, MIN_SCALE)


def grasped_samples(times: Array, states: Codes, *, edge_seconds: float = EDGE_SECONDS) -> Flags:
    """Return (n,) where a finger holds something for at least `MIN_TOUCH`.

    While it closes and opens it does not hold: the samples next to those without contact are left
    out.

    Args:
        times: (n,) [s].
        states: (n,) codes of its states, without debouncing.
        edge_seconds: time that is left out [s], but at most `MAX_EDGE_SHARE` of a touch.
    """
    period = _period(times)
    touching = np.asarray((states == STABLE) | (states == UNSTABLE))
    grasped = np.zeros_like(touching)
    for start, end in runs(touching):
        # Only towards no contact is an edge closing or opening: at the end of a recording, or at a
        # fault, the object is held as before.
        edge = min(round(edge_seconds / period), int(MAX_EDGE_SHARE * (end - start)))
        closes = start > 0 and states[start - 1] == NO_CONTACT
        opens = end < len(states) and states[end] == NO_CONTACT
        if end - start >= MIN_TOUCH / period:
            grasped[start + closes * edge : end - opens * edge] = True
    return grasped


def grasped_durations(times: Array) -> Array:
    """Return (n,) the duration of each sample, which is a period before a gap [s]."""
    return np.minimum(sample_durations(times), 1.5 * _period(times))


def _period(times: Array) -> float:
    """Return the median step in time [s]; `MIN_TOUCH` for a single sample."""
    return float(np.median(np.diff(times))) if len(times) > 1 else MIN_TOUCH
