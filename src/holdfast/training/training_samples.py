"""Training samples: labelled samples with features, from recordings that are read one by one."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Samples
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN
from holdfast.errors import TrainingError
from holdfast.features import Tare
from holdfast.features.force import rest_amplitude
from holdfast.features.loaded_start import begins_in_contact
from holdfast.features.stream import StreamPlan, extract
from holdfast.model import ANY_FINGER, RATE_TOLERANCE
from holdfast.parallel import Engine
from holdfast.recordings import Recording, Tactile, label_states
from holdfast.resampling import resample, true_updates
from holdfast.sensors import Sensor
from holdfast.sensors.types import Integers
from holdfast.training.dataset_scan import DatasetScan, OneRecording, Progress, show_nothing
from holdfast.training.setting import Setting
from holdfast.training.splits import DataSplit

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
        n_usable: number of samples from which these were taken.
    """

    sensor: Sensor | None
    samples: Samples
    units: Integers
    recordings: Integers
    times: npt.NDArray[np.float64]
    at_rest: npt.NDArray[np.float64]
    n_usable: int = 0

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
        can: npt.NDArray[np.bool_] = self.present(n_units) & (left > 0).all(axis=0)
        return can

    def present(self, n_units: int) -> npt.NDArray[np.bool_]:
        """Return (n_units,) whether a unit has samples."""
        present: npt.NDArray[np.bool_] = self._class_counts(n_units).sum(axis=0) > 0
        return present

    def _class_counts(self, n_units: int) -> Integers:
        """Return (2, n_units) number of samples of class 0 and class 1 in each unit."""
        stable, whole = self.samples.stable, self.units >= 0
        parts = (self.units[whole & (stable == kind)] for kind in (False, True))
        return np.array([np.bincount(part, minlength=n_units) for part in parts])

    def contact_threshold(self, recordings: Sequence[int]) -> float | None:
        """Return the contact threshold from the tare intervals of some recordings."""
        return contact_threshold(self.at_rest[list(recordings)])


@dataclass(frozen=True)
class SamplesPlan:
    """What the training samples of any recording of a dataset depend on.

    Attributes:
        scan: of the dataset.
        setting: of the training: features, tare and so on.
        data_split: of the dataset.
    """

    scan: DatasetScan
    setting: Setting
    data_split: DataSplit

    @property
    def step(self) -> int:
        """Every step-th usable sample of a finger is kept."""
        return thinning_step(self.scan.n_labelled, self.setting.max_samples)

    @property
    def places(self) -> list[int]:
        """Indices of the recordings with labels."""
        scanned = enumerate(self.scan.recordings)
        return [place for place, recording in scanned if recording.n_labelled]


def gather_samples(
    recordings: Sequence[Recording],
    scan: DatasetScan,
    setting: Setting,
    data_split: DataSplit,
    engine: Engine = Engine(),  # noqa: B008 (a tuple: it cannot change)
    progress: Progress = show_nothing,
) -> dict[str, FingerSamples]:
    """Return the training samples of every finger, or of all fingers together under `"*"`.

    Args:
        recordings: the same that were scanned.
        scan: of the recordings.
        setting: of the training: features, tare and so on.
        data_split: of the recordings.
        engine: that reads the recordings.
        progress: iterates over the recordings.

    Returns:
        By finger. Each has at most `setting.max_samples`; of larger data every n-th sample, so
        that each recording has its share.

    Raises:
        RecordingError: a recording cannot be read.
        TrainingError: one classifier of all fingers is required, but their sensors differ.
    """
    plan = SamplesPlan(scan, setting, data_split)
    parts: dict[str, list[FingerSamples]] = {finger: [] for finger in scan.sensors}
    at_rest = {finger: np.zeros((len(scan.recordings), 3)) for finger in scan.sensors}
    read = progress(_read(recordings, plan, engine), "features", len(plan.places))
    for place, samples_of_fingers in zip(plan.places, read, strict=True):
        for finger, samples in samples_of_fingers.items():
            parts[finger].append(samples)
            at_rest[finger][place] = samples.at_rest[0]
    fingers = {
        finger: join_samples(part, at_rest[finger]) for finger, part in parts.items() if part
    }
    return {ANY_FINGER: pool_fingers(fingers)} if setting.is_shared else fingers


def _read(
    recordings: Sequence[Recording], plan: SamplesPlan, engine: Engine
) -> Iterator[dict[str, FingerSamples]]:
    """Yield the samples of each recording with labels, by finger.

    Which samples are kept depends on the number of usable samples in all recordings before.
    Other processes read a recording twice if samples are left out: first these numbers.
    """
    n_seen = Counter[str]()
    parts = [(place, OneRecording(recordings, place)) for place in plan.places]
    counts: Iterator[Mapping[str, int]] | None = None
    if plan.step > 1 and not engine.in_this_process:
        counts = iter(list(engine.map_ordered(_count_usable, parts, shared=(plan,))))

    def calls() -> Iterator[tuple[object, ...]]:
        for place, part in parts:
            yield place, part, dict(n_seen)
            if counts is not None:
                n_seen.update(next(counts))

    for fingers in engine.map_ordered(_samples_of_part, calls(), shared=(plan,)):
        if counts is None:
            n_seen.update({name: samples.n_usable for name, samples in fingers.items()})
        yield fingers


def _count_usable(plan: SamplesPlan, place: int, part: Sequence[Recording]) -> dict[str, int]:
    fingers = _samples_of_part(plan, place, part, {})
    return {name: samples.n_usable for name, samples in fingers.items()}


def _samples_of_part(
    plan: SamplesPlan, place: int, part: Sequence[Recording], n_seen: Mapping[str, int]
) -> dict[str, FingerSamples]:
    """Return the samples of one recording by finger; `at_rest` has only its own row.

    Args:
        plan: of the dataset.
        place: index of the recording.
        part: only this recording.
        n_seen: usable samples of each finger in all recordings before.
    """
    scan, setting, step = plan.scan, plan.setting, plan.step
    recording = true_updates(part[0])
    if not scan.relative:
        recording = resample_if_needed(recording, scan.rate)
    rate, tare = scan.model_rate or recording.rate, setting.used_tare
    sensors = sensors_of(recording, scan)
    features = dict.fromkeys(sensors, setting.features)
    stream = StreamPlan(sensors, features, setting.window, tare, rate)
    loaded, fingers = begins_in_contact(recording.metadata), {}
    for finger, rows in extract(stream, recording).items():
        module = recording.modules[finger]
        states = _states_to_learn(module, scan.relative)
        usable = usable_rows(rows.features, states)[:: scan.recordings[place].step]
        kept = usable[-n_seen.get(finger, 0) % step :: step]
        has_rest = tare.without_contact and not scan.relative and not loaded
        fingers[finger] = FingerSamples(
            None if scan.relative else module.sensor,
            labelled_samples(rows.features, states, kept, int(plan.data_split.group_of[place])),
            plan.data_split.units_of(place, module.n_samples)[kept],
            np.full(len(kept), place),
            module.times[kept] - recording.start,
            np.array([rest_moments(module, tare, rate) if has_rest else (0.0, 0.0, 0.0)]),
            len(usable),
        )
    return fingers


def sensors_of(recording: Recording, scan: DatasetScan) -> dict[str, Sensor]:
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
    """Return the true updates of a recording, resampled unless their rate [Hz] is within 20 %."""
    recording = true_updates(recording)
    if abs(recording.rate / rate - 1) <= RATE_TOLERANCE:
        return recording
    return resample(recording, rate)


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


def pool_fingers(fingers: Mapping[str, FingerSamples]) -> FingerSamples:
    """Return the samples of all fingers together."""
    parts = list(fingers.values())
    if len({part.sensor for part in parts}) > 1:
        raise TrainingError(
            "one classifier for all fingers needs one sensor; given are "
            + ", ".join(
                f"{name} ({part.sensor.name})" for name, part in fingers.items() if part.sensor
            )
        )
    return join_samples(parts, np.sum([part.at_rest for part in parts], axis=0))


def join_samples(parts: Sequence[FingerSamples], at_rest: npt.NDArray[np.float64]) -> FingerSamples:
    """Return the samples of at least one part, in order, with the moments of the result."""
    return FingerSamples(
        parts[0].sensor,
        concatenate([part.samples for part in parts]),
        np.concatenate([part.units for part in parts]),
        np.concatenate([part.recordings for part in parts]),
        np.concatenate([part.times for part in parts]),
        at_rest,
        sum(part.n_usable for part in parts),
    )
