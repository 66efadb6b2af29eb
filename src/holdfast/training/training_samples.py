"""Training samples: labelled samples with features, from recordings that are read one by one."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Samples
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN
from holdfast.errors import TrainingError
from holdfast.features import FeatureSpec, Tare
from holdfast.features.force import rest_amplitude
from holdfast.features.stream import StreamPlan, extract
from holdfast.model import ANY_FINGER, RATE_TOLERANCE
from holdfast.recordings import Recording, Tactile, label_states
from holdfast.resampling import resample
from holdfast.sensors import Sensor
from holdfast.training.dataset_scan import DatasetScan
from holdfast.training.setting import Setting
from holdfast.training.splits import DataSplit, Integers

CONTACT_DEVIATIONS = 5.0
"""Contact threshold: number of standard deviations of F_a at rest above its mean."""


@dataclass(frozen=True)
class FingerSamples:
    """Training samples of one classifier.

    Attributes:
        sensor: of the finger; None for any sensor.
        samples: labelled, with features; the groups are those of the split.
        units: (n,) unit of each sample, with which it is held out; -1 if it is held out with
            every unit.
        recordings: (n,) index of the recording of each sample.
        times: (n,) time of each sample since the start of its recording [s].
        at_rest: (n_recordings, 3) number, sum and sum of squares of F_a in each tare interval.
    """

    sensor: Sensor | None
    samples: Samples
    units: Integers
    recordings: Integers
    times: npt.NDArray[np.float64]
    at_rest: npt.NDArray[np.float64]

    def without(self, held: Collection[int]) -> Samples:
        """Return the samples that are not in held units."""
        return self.samples.take(self.kept(held))

    def kept(self, held: Collection[int]) -> npt.NDArray[np.bool_]:
        """Return (n,) whether a sample is not in held units."""
        return ~np.isin(self.units, [-1, *held] if held else [])

    def can_evaluate(self, n_units: int) -> npt.NDArray[np.bool_]:
        """Return (n_units,) whether a unit has samples, and both classes are left without it."""
        counts = self._class_counts(n_units)
        left = counts.sum(axis=1, keepdims=True) - counts
        found: npt.NDArray[np.bool_] = self.present(n_units) & (left > 0).all(axis=0)
        return found

    def present(self, n_units: int) -> npt.NDArray[np.bool_]:
        """Return (n_units,) whether a unit has samples."""
        found: npt.NDArray[np.bool_] = self._class_counts(n_units).sum(axis=0) > 0
        return found

    def _class_counts(self, n_units: int) -> Integers:
        """Return (2, n_units) number of samples of class 0 and class 1 in each unit."""
        stable, whole = self.samples.stable, self.units >= 0
        parts = (self.units[whole & (stable == kind)] for kind in (False, True))
        return np.array([np.bincount(part, minlength=n_units) for part in parts])

    def contact_threshold(self, recordings: Sequence[int]) -> float | None:
        """Return the contact threshold from the tare intervals of some recordings."""
        return contact_threshold(self.at_rest[list(recordings)])


def gather_samples(
    recordings: Iterable[Recording], scan: DatasetScan, setting: Setting, data_split: DataSplit
) -> dict[str, FingerSamples]:
    """Return the training samples of every finger, or of all fingers together under `"*"`.

    Args:
        recordings: the same that were scanned.
        scan: of the recordings.
        setting: of the training: features, tare and so on.
        data_split: of the recordings.

    Returns:
        By finger. Each has at most `setting.max_samples`; of larger data every n-th sample.

    Raises:
        RecordingError: a recording cannot be read.
        TrainingError: one classifier of all fingers is required, but their sensors differ.
    """
    step = thinning_step(scan.n_labelled, setting.max_samples)
    parts: dict[str, list[FingerSamples]] = {finger: [] for finger in scan.sensors}
    n_seen = dict.fromkeys(scan.sensors, 0)
    for place, given in enumerate(recordings):
        scanned = scan.recordings[place]
        if not scanned.n_labelled:
            continue
        recording = given if scan.relative else resample_if_needed(given, scan.rate)
        rate = scan.model_rate or recording.rate
        plan = stream_plan(_sensors_of(recording, scan), setting.features, setting, rate)
        for finger, rows in extract(plan, recording).items():
            module = recording.modules[finger]
            states = _states_to_learn(module, scan.relative)
            usable = usable_rows(rows.features, states)[:: scanned.step]
            kept = usable[-n_seen[finger] % step :: step]
            n_seen[finger] += len(usable)
            at_rest = np.zeros((len(scan.recordings), 3))
            if plan.tare.without_contact and not scan.relative:
                at_rest[place] = rest_moments(module, plan.tare, rate)
            group = int(data_split.group_of[place])
            parts[finger].append(
                FingerSamples(
                    None if scan.relative else module.sensor,
                    labelled_samples(rows.features, states, kept, group),
                    data_split.units_of(place, module.n_samples)[kept],
                    np.full(len(kept), place),
                    module.times[kept] - recording.start,
                    at_rest,
                )
            )
    fingers = {finger: _join(own) for finger, own in parts.items()}
    return {ANY_FINGER: _pool(fingers)} if setting.is_shared else fingers


def _sensors_of(recording: Recording, scan: DatasetScan) -> dict[str, Sensor]:
    """Return the sensor of each finger that has samples, and the sensor of the scan."""
    modules = {f: recording.modules[f] for f in scan.sensors if f in recording.modules}
    return {
        finger: module.sensor
        for finger, module in modules.items()
        if module.n_samples and (scan.relative or module.sensor == scan.sensors[finger])
    }


def _states_to_learn(module: Tactile, relative: bool) -> npt.NDArray[np.int8]:
    """Return (n,) the labels, without those of no contact if the load separates them."""
    states = label_states(module.labels, module.times)
    return np.where(states == NO_CONTACT, UNKNOWN, states).astype(np.int8) if relative else states


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


def resample_if_needed(recording: Recording, rate: float) -> Recording:
    """Return a recording for a model of a rate [Hz]: unchanged within 20 %, else resampled."""
    if abs(recording.rate / rate - 1) <= RATE_TOLERANCE:
        return recording
    return resample(recording, rate)


def stream_plan(
    sensors: dict[str, Sensor],
    features: tuple[FeatureSpec, ...],
    setting: Setting,
    rate: float,
) -> StreamPlan:
    """Return the plan of the feature stream of some fingers, with a setting's window and tare."""
    tare = Tare.parse(setting.used_tare)
    return StreamPlan(sensors, dict.fromkeys(sensors, features), setting.window, tare, rate)


def contact_threshold(moments: npt.NDArray[np.float64]) -> float | None:
    """Return the mean + 5 standard deviations of F_a at rest.

    Args:
        moments: (n_recordings, 3) number, sum and sum of squares of F_a in each tare interval.

    Returns:
        F_a from which on there is contact [unit of the readings]; None with fewer than two
        samples.
    """
    n, total, squares = moments.sum(axis=0)
    if n < 2:
        return None
    mean = total / n
    return float(mean + CONTACT_DEVIATIONS * np.sqrt(max(squares / n - mean**2, 0.0)))


def rest_moments(module: Tactile, tare: Tare, rate: float) -> tuple[int, float, float]:
    """Return number, sum and sum of squares of F_a in the tare interval.

    All are 0 if no sample in the tare interval is finite.
    """
    try:
        amplitude = rest_amplitude(module, tare, rate)
    except ValueError:  # no finite sample in the tare interval
        return 0, 0.0, 0.0
    return len(amplitude), float(amplitude.sum()), float((amplitude**2).sum())


def _pool(fingers: Mapping[str, FingerSamples]) -> FingerSamples:
    """Return the samples of all fingers together."""
    each = list(fingers.values())
    if len({own.sensor for own in each}) > 1:
        raise TrainingError(
            "one classifier for all fingers needs one sensor; given are "
            + ", ".join(f"{f} ({own.sensor.name})" for f, own in fingers.items() if own.sensor)
        )
    return _join(each)


def _join(parts: Sequence[FingerSamples]) -> FingerSamples:
    """Return the samples of all parts, in order."""
    return FingerSamples(
        parts[0].sensor,
        concatenate([own.samples for own in parts]),
        np.concatenate([own.units for own in parts]),
        np.concatenate([own.recordings for own in parts]),
        np.concatenate([own.times for own in parts]),
        np.sum([own.at_rest for own in parts], axis=0),
    )
