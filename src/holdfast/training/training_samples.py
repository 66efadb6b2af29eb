"""Training samples of all heads, from recordings that are read one by one, once each."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from holdfast.contact import NO_CONTACT, UNKNOWN
from holdfast.detection import ANY_FINGER, FeatureSpec, HeadName, Tare
from holdfast.detection.features import extract, rest_amplitude
from holdfast.detection.plan import StreamPlan
from holdfast.metrics.slip_truth import slip_truth
from holdfast.parallel import Engine
from holdfast.recordings import Recording, Tactile, label_states
from holdfast.resampling import at_rate
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array
from holdfast.training.dataset_scan import DatasetScan, OneRecording, Progress, show_nothing
from holdfast.training.finger_samples import (
    FingerSamples,
    join_samples,
    labelled_samples,
    pool_fingers,
    thinning_step,
    usable_rows,
)
from holdfast.training.setting import Setting
from holdfast.training.splits import DataSplit
from holdfast.training.targets import TARGETS, TargetInput, TargetSamples


@dataclass(frozen=True)
class SamplesPlan:
    """Settings by which the training samples of a recording are gathered.

    Attributes:
        scan: of the dataset.
        setting: of the training: features, tare and so on.
        data_split: of the dataset.
        slip_features: of the heads of a slip.
        only_stable: leave out the samples of all other heads.
    """

    scan: DatasetScan
    setting: Setting
    data_split: DataSplit
    slip_features: tuple[FeatureSpec, ...] = ()
    only_stable: bool = False

    @property
    def step(self) -> int:
        """Every step-th usable sample of a finger is kept."""
        return thinning_step(self.scan.n_labelled, self.setting.max_samples)

    @property
    def indices(self) -> list[int]:
        """Indices of the recordings with labels."""
        scanned = enumerate(self.scan.recordings)
        return [index for index, recording in scanned if recording.n_labelled]


class PartSamples(NamedTuple):
    """Training samples of one finger in one recording: of stability, and of the other heads."""

    stable: FingerSamples
    others: Mapping[HeadName, TargetSamples]


@dataclass(frozen=True)
class HeadSamples:
    """Training samples of each head, by finger, or of all fingers together under `"*"`.

    Attributes:
        stable: of every finger that has labels.
        others: of the other heads, by head: of the fingers of which a truth or labels name slips,
            true speeds or causes.
    """

    stable: Mapping[str, FingerSamples]
    others: Mapping[HeadName, Mapping[str, TargetSamples]] = field(default_factory=dict)

    def of(self, head: HeadName) -> Mapping[str, TargetSamples]:
        """Return the samples of a head beside `stable`, by finger."""
        return self.others.get(head, {})


def gather_samples(
    recordings: Sequence[Recording],
    plan: SamplesPlan,
    engine: Engine = Engine(),  # noqa: B008 (a tuple: it cannot change)
    progress: Progress = show_nothing,
) -> HeadSamples:
    """Return the training samples of every head.

    Args:
        recordings: the same that were scanned.
        plan: of the dataset.
        engine: that reads the recordings.
        progress: iterates over the recordings.

    Returns:
        Those of `stable` are at most `setting.max_samples` of each finger; of larger data every
        n-th sample, so that each recording has its share.

    Raises:
        RecordingError: a recording cannot be read.
        TrainingError: one classifier of all fingers is required, but their sensors differ.
    """
    parts: dict[str, list[PartSamples]] = {finger: [] for finger in plan.scan.sensors}
    at_rest = {finger: np.zeros((len(plan.scan.recordings), 3)) for finger in parts}
    read = progress(_read(recordings, plan, engine), "features", len(plan.indices))
    for index, samples_of_fingers in zip(plan.indices, read, strict=True):
        for finger, samples in samples_of_fingers.items():
            parts[finger].append(samples)
            at_rest[finger][index] = samples.stable.at_rest[0]
    stable = {
        finger: join_samples([part.stable for part in of_finger], at_rest[finger])
        for finger, of_finger in parts.items()
        if of_finger
    }
    if plan.setting.is_shared:
        stable = {ANY_FINGER: pool_fingers(stable)}
        parts = {ANY_FINGER: [part for of_finger in parts.values() for part in of_finger]}
    others: dict[HeadName, dict[str, TargetSamples]] = {}
    for finger, of_finger in parts.items():
        for head in TARGETS:
            of_head = [part.others[head] for part in of_finger if head in part.others]
            if of_head and (joined := TargetSamples.joined(of_head)).n_positive:
                others.setdefault(head, {})[finger] = joined
    return HeadSamples(stable, others)


def _read(
    recordings: Sequence[Recording], plan: SamplesPlan, engine: Engine
) -> Iterator[dict[str, PartSamples]]:
    """Yield the samples of each recording with labels, by finger.

    Which samples are kept depends on the number of usable samples in all recordings before.
    Other processes read a recording twice if samples are left out: first these numbers.
    """
    n_seen = Counter[str]()
    parts = [(index, OneRecording(recordings, index)) for index in plan.indices]
    # In this process the number is known from the recordings before; other processes work ahead.
    counts: Iterator[Mapping[str, int]] | None = None
    if plan.step > 1 and not engine.in_this_process:
        counts = iter(list(engine.map_ordered(_count_usable, parts, shared=(plan,))))

    def calls() -> Iterator[tuple[object, ...]]:
        for index, part in parts:
            yield index, part, dict(n_seen)
            if counts is not None:
                n_seen.update(next(counts))

    for fingers in engine.map_ordered(_samples_of_part, calls(), shared=(plan,)):
        if counts is None:
            n_seen.update({name: samples.stable.n_usable for name, samples in fingers.items()})
        yield fingers


def _count_usable(plan: SamplesPlan, index: int, part: Sequence[Recording]) -> dict[str, int]:
    fingers = _samples_of_part(replace(plan, only_stable=True), index, part, {})
    return {name: samples.stable.n_usable for name, samples in fingers.items()}


def _samples_of_part(
    plan: SamplesPlan, index: int, part: Sequence[Recording], n_seen: Mapping[str, int]
) -> dict[str, PartSamples]:
    """Return the samples of one recording by finger; `at_rest` has only its own row.

    Args:
        plan: of the dataset.
        index: of the recording.
        part: only this recording.
        n_seen: usable samples of each finger in all recordings before.
    """
    scan, setting, step = plan.scan, plan.setting, plan.step
    recording = at_rate(part[0], None if scan.relative else scan.rate)
    rate, tare = scan.model_rate or recording.rate, setting.used_tare
    sensors = sensors_of(recording, scan)

    def extracted(features: tuple[FeatureSpec, ...]) -> dict[str, Array]:
        specs = dict.fromkeys(sensors, features)
        stream = StreamPlan(sensors, specs, setting.window, tare, rate)
        return {finger: rows.features for finger, rows in extract(stream, recording).items()}

    # Heads of other features have a stream of their own: rows are ready once the longest window of
    # their features is filled.
    stable_rows = extracted(setting.features)
    with_others = not plan.only_stable
    is_same = plan.slip_features == setting.features
    slip_rows = stable_rows if is_same or not with_others else extracted(plan.slip_features)
    fingers = {}
    recording_step = scan.recordings[index].step
    group = int(plan.data_split.group_of[index])
    for finger, rows in stable_rows.items():
        module = recording.modules[finger]
        states = label_states(module.labels, module.times)
        if scan.relative:
            # The load separates no contact there, so those labels would teach what is known.
            states = np.where(states == NO_CONTACT, UNKNOWN, states).astype(np.int8)
        units = plan.data_split.units_of(index, module.n_samples)
        usable = usable_rows(rows, states)[::recording_step]
        # Every step-th of all recordings one after the other: the first one here is due once the
        # samples before are a multiple of the step.
        kept = usable[-n_seen.get(finger, 0) % step :: step]
        # F_a at rest says where contact begins. A loaded start shows no rest, and a model for any
        # unit has a threshold on the load instead.
        has_rest = tare.without_contact and not scan.relative and not recording.starts_loaded
        stable = FingerSamples(
            None if scan.relative else module.sensor,
            labelled_samples(rows, states, kept, group),
            units[kept],
            np.full(len(kept), index),
            module.times[kept] - recording.start,
            np.array([rest_moments(module, tare, rate) if has_rest else (0.0, 0.0, 0.0)]),
            len(usable),
        )
        others: dict[HeadName, TargetSamples] = {}
        truth = slip_truth(recording, finger, module.times) if with_others else None
        if truth is not None:
            step_of_rows = recording_step * step
            source = TargetInput(
                recording, finger, truth, units, index, step_of_rows, is_any=scan.relative
            )
            for head, target in TARGETS.items():
                columns = rows if head == "cause" else slip_rows[finger]
                if (made := target(source, columns)) is not None:
                    others[head] = made
        fingers[finger] = PartSamples(stable, others)
    return fingers


def sensors_of(recording: Recording, scan: DatasetScan) -> dict[str, Sensor]:
    """Return the sensor of each finger that has samples, and the sensor of the scan."""
    modules = {f: recording.modules[f] for f in scan.sensors if f in recording.modules}
    return {
        finger: module.sensor
        for finger, module in modules.items()
        if module.n_samples and (scan.relative or module.sensor == scan.sensors[finger])
    }


def rest_moments(module: Tactile, tare: Tare, rate: float) -> tuple[int, float, float]:
    """Return number, sum and sum of squares of F_a in the tare interval.

    All are 0 if no sample in the tare interval is finite.
    """
    try:
        amplitude = rest_amplitude(module, tare, rate)
    except ValueError:  # no finite sample in the tare interval
        return 0, 0.0, 0.0
    return len(amplitude), float(amplitude.sum()), float((amplitude**2).sum())
