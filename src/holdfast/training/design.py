"""From recordings to training samples, one recording at a time."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Samples
from holdfast.contact import STABLE, UNKNOWN
from holdfast.errors import TrainingError
from holdfast.features import FeatureSpec, Tare
from holdfast.features.force import rest_amplitude
from holdfast.features.stream import StreamPlan, extract
from holdfast.model import ANY_FINGER, RATE_TOLERANCE
from holdfast.recordings import Recording, Tactile, label_states
from holdfast.resampling import resample
from holdfast.sensors import Sensor
from holdfast.training.setting import Setting
from holdfast.training.splits import Division, Integers
from holdfast.training.survey import Survey

CONTACT_DEVIATIONS = 5.0
"""Standard deviations of F_a over the mean of the tare stretches, from which on is contact."""


@dataclass(frozen=True)
class FingerDesign:
    """What one classifier is trained from.

    Attributes:
        sensor: of the finger.
        samples: labelled, with features; groups are those of the division.
        units: (n,) what each sample is held out with.
        at_rest: (n_recordings, 3) number, sum and sum of squares of F_a in each tare stretch.
    """

    sensor: Sensor
    samples: Samples
    units: Integers
    at_rest: npt.NDArray[np.float64]

    def without(self, held: Collection[int]) -> Samples:
        """The samples that those units leave to train from."""
        return self.samples.take(~np.isin(self.units, list(held)))

    def judged(self, n_units: int) -> npt.NDArray[np.bool_]:
        """(n_units,) whether it has samples there, and both classes without them."""
        counts = self._class_counts(n_units)
        left = counts.sum(axis=1, keepdims=True) - counts
        found: npt.NDArray[np.bool_] = self.present(n_units) & (left > 0).all(axis=0)
        return found

    def present(self, n_units: int) -> npt.NDArray[np.bool_]:
        """(n_units,) whether it has samples there."""
        found: npt.NDArray[np.bool_] = self._class_counts(n_units).sum(axis=0) > 0
        return found

    def _class_counts(self, n_units: int) -> Integers:
        """(2, n_units) samples of class 0 and class 1 in each unit."""
        stable = self.samples.stable
        parts = (self.units[stable == kind] for kind in (False, True))
        return np.array([np.bincount(part, minlength=n_units) for part in parts])

    def contact_threshold(self, recordings: Sequence[int]) -> float | None:
        """Mean + 5 standard deviations of F_a over those recordings' tare stretches."""
        return contact_threshold(self.at_rest[list(recordings)])


def gather(
    recordings: Iterable[Recording], found: Survey, setting: Setting, division: Division
) -> dict[str, FingerDesign]:
    """The training samples of every finger, or of all together under `"*"`.

    Args:
        recordings: the same that were surveyed.
        found: by the survey.
        setting: which features, tare and so on.
        division: of the recordings.

    Returns:
        By finger; at most `setting.max_samples` each, every n-th of larger data.

    Raises:
        RecordingError: a recording cannot be read.
        TrainingError: one classifier is asked for fingers with different sensors.
    """
    step = thinning_step(found.n_labelled, setting.max_samples)
    piles: dict[str, list[Samples]] = {finger: [] for finger in found.sensors}
    units: dict[str, list[Integers]] = {finger: [] for finger in found.sensors}
    at_rest = {finger: np.zeros((len(found.entries), 3)) for finger in found.sensors}
    n_seen = dict.fromkeys(found.sensors, 0)
    for place, given in enumerate(recordings):
        if not found.entries[place].n_labelled:
            continue
        recording = at_rate(given, found.rate)
        sensors = {f: s for f, s in found.sensors.items() if _has(recording, f, s)}
        plan = stream_plan(sensors, setting.features, setting, found.rate)
        for finger, rows in extract(plan, recording).items():
            module = recording.modules[finger]
            states = label_states(module.labels, module.times)
            usable = usable_rows(rows.features, states)
            kept = usable[-n_seen[finger] % step :: step]
            n_seen[finger] += len(usable)
            group = int(division.group_of[place])
            piles[finger].append(labelled_samples(rows.features, states, kept, group))
            units[finger].append(division.units_of(place, module.n_samples)[kept])
            if plan.tare.without_contact:
                at_rest[finger][place] = rest_moments(module, plan.tare, found.rate)
    designs = {
        finger: FingerDesign(
            found.sensors[finger], concatenate(pile), np.concatenate(units[finger]), at_rest[finger]
        )
        for finger, pile in piles.items()
    }
    return {ANY_FINGER: _pool(designs)} if setting.shared else designs


def usable_rows(features: npt.NDArray[np.floating[Any]], states: npt.NDArray[np.int8]) -> Integers:
    """Return the rows that have a label and finite features.

    Args:
        features: (n, n_features).
        states: (n,) state codes of the labels.
    """
    return np.flatnonzero((states != UNKNOWN) & np.isfinite(features).all(axis=1))


def labelled_samples(
    features: npt.NDArray[Any], states: npt.NDArray[np.int8], rows: Integers, group: int
) -> Samples:
    """Return the samples in some rows of one recording, all of the same group."""
    return Samples(features[rows], states[rows] == STABLE, np.full(len(rows), group))


def concatenate(parts: Sequence[Samples]) -> Samples:
    """Return all samples of at least one part, in order."""
    return Samples(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def thinning_step(n: int, n_max: int) -> int:
    """Return the smallest step at which every step-th of n samples makes at most `n_max`.

    Example:
        >>> thinning_step(10, 4), thinning_step(3, 4)
        (3, 1)
    """
    return max(1, -(-n // n_max))


def thin(samples: Samples, n_max: int) -> Samples:
    """Return at most `n_max` of the samples, at even steps."""
    step = thinning_step(len(samples.stable), n_max)
    return Samples(samples.features[::step], samples.stable[::step], samples.groups[::step])


def at_rate(recording: Recording, rate: float) -> Recording:
    """The recording as a model of that rate takes it: as it is within 20 %, else resampled."""
    if abs(recording.rate / rate - 1) <= RATE_TOLERANCE:
        return recording
    return resample(recording, rate)


def stream_plan(
    sensors: dict[str, Sensor],
    features: tuple[FeatureSpec, ...],
    setting: Setting,
    rate: float,
) -> StreamPlan:
    """The stream of features that the setting asks of those fingers."""
    tare = Tare.parse(setting.tare)
    return StreamPlan(sensors, dict.fromkeys(sensors, features), setting.window, tare, rate)


def _has(recording: Recording, finger: str, sensor: Sensor) -> bool:
    """Whether the recording has samples of that finger, by that sensor."""
    module = recording.modules.get(finger)
    return module is not None and module.n_samples > 0 and module.sensor == sensor


def contact_threshold(moments: npt.NDArray[np.float64]) -> float | None:
    """Mean + 5 standard deviations of F_a at rest.

    Args:
        moments: (n_recordings, 3) number, sum and sum of squares of F_a in each tare stretch.

    Returns:
        F_a from which on there is contact [unit of the readings]; None where nothing is known.
    """
    n, total, squares = moments.sum(axis=0)
    if n < 2:
        return None
    mean = total / n
    return float(mean + CONTACT_DEVIATIONS * np.sqrt(max(squares / n - mean**2, 0.0)))


def rest_moments(module: Tactile, tare: Tare, rate: float) -> tuple[int, float, float]:
    """Number, sum and sum of squares of F_a in the tare stretch; none of a dead finger."""
    try:
        amplitude = rest_amplitude(module, tare, rate)
    except ValueError:  # no finite sample in that time
        return 0, 0.0, 0.0
    return len(amplitude), float(amplitude.sum()), float((amplitude**2).sum())


def _pool(designs: Mapping[str, FingerDesign]) -> FingerDesign:
    if len({design.sensor for design in designs.values()}) > 1:
        raise TrainingError(
            "one classifier for all fingers needs one sensor; given are "
            + ", ".join(f"{finger} ({each.sensor.name})" for finger, each in designs.items())
        )
    each = list(designs.values())
    return FingerDesign(
        each[0].sensor,
        concatenate([design.samples for design in each]),
        np.concatenate([design.units for design in each]),
        np.sum([design.at_rest for design in each], axis=0),
    )
