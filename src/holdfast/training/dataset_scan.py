"""Scan of a dataset before training: names, sensors, labels, and checks that they agree."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from holdfast.errors import TrainingError
from holdfast.recordings import Recording
from holdfast.sensors import Sensor


@dataclass(frozen=True)
class ScannedRecording:
    """Facts about a recording that training needs after the recording is released.

    Attributes:
        name: of the recording.
        digest: of its samples.
        object: object that was held; None if the metadata do not name it.
        rate: samples per second [Hz].
        n_labelled: number of labelled samples of each finger that has any.
    """

    name: str
    digest: str
    object: str | None
    rate: float
    n_labelled: dict[str, int]


@dataclass(frozen=True)
class DatasetScan:
    """Recordings and sensors of a dataset.

    Attributes:
        recordings: in the order of the dataset.
        sensors: sensor of each finger that has labels.
        requested_rate: rate of the model [Hz]; None for that of the recordings.
    """

    recordings: tuple[ScannedRecording, ...]
    sensors: dict[str, Sensor]
    requested_rate: float | None = None

    @property
    def rate(self) -> float:
        """The requested rate, else the median rate of the recordings [Hz]."""
        if self.requested_rate is not None:
            return self.requested_rate
        return float(np.median([recording.rate for recording in self.recordings]))

    @property
    def n_labelled(self) -> int:
        """Number of labelled samples of the finger that has most."""
        return max(
            sum(recording.n_labelled.get(finger, 0) for recording in self.recordings)
            for finger in self.sensors
        )


def scan_dataset(recordings: Iterable[Recording], rate: float | None = None) -> DatasetScan:
    """Read every recording once, one at a time, and check that all fit together.

    Args:
        recordings: labelled.
        rate: rate of the model [Hz]; None for the median rate of the recordings.

    Raises:
        TrainingError: there are no recordings or no labels, two recordings have the same
            samples or name, or a finger has different sensors.
    """
    scanned: list[ScannedRecording] = []
    sensors: dict[str, Sensor] = {}
    for recording in recordings:
        scanned.append(_scan(recording))
        for finger in scanned[-1].n_labelled:
            found = recording.modules[finger].sensor
            known = sensors.setdefault(finger, found)
            _check_same_sensor(f"{finger} of {recording.name!r}", found, known)
    if not scanned:
        raise TrainingError("no recordings given; at least one expected")
    if not sensors:
        raise TrainingError(f"none of the {len(scanned)} recordings has labels to train from")
    _check_no_duplicates(scanned)
    return DatasetScan(tuple(scanned), sensors, rate)


def _scan(recording: Recording) -> ScannedRecording:
    counts = {
        name: int((module.label_states > 0).sum())
        for name, module in recording.modules.items()
        if module.labels
    }
    held_object = recording.metadata.get("object")
    return ScannedRecording(
        name=recording.name,
        digest=recording.digest,
        object=None if held_object is None else str(held_object),
        rate=recording.rate,
        n_labelled={name: count for name, count in counts.items() if count},
    )


def _check_same_sensor(what: str, sensor: Sensor, known: Sensor) -> None:
    if sensor != known:
        given, expected = (f"{s.name} ({s.n_taxels} taxels, {s.unit})" for s in (sensor, known))
        layout = "" if given != expected else " with another layout or rate"
        raise TrainingError(
            f"{what} has the sensor {given}, other recordings have {expected}{layout}"
        )


def _check_no_duplicates(recordings: list[ScannedRecording]) -> None:
    name_of_digest: dict[str, str] = {}
    names: set[str] = set()
    for recording in recordings:
        if recording.name in names:
            raise TrainingError(
                f"two recordings are called {recording.name!r}; different names expected"
            )
        names.add(recording.name)
        if recording.digest in name_of_digest:
            raise TrainingError(
                f"recordings {name_of_digest[recording.digest]!r} and {recording.name!r} hold "
                "the same samples: one would be tested by a model that was trained on the other"
            )
        name_of_digest[recording.digest] = recording.name
