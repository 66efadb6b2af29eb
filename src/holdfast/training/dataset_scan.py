"""Reading of a dataset, with progress, and its scan: names, sensors, and checks that they agree."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from holdfast.blocks import Digests
from holdfast.detection import EXACT_RATE, RELATIVE_RATES
from holdfast.errors import TrainingError
from holdfast.recordings import Recording
from holdfast.resampling import true_updates
from holdfast.sensors import Sensor

T = TypeVar("T")

RELATIVE_SAMPLE_RATE = 20.0
"""Approximate number of samples per second that train a model of any rate [Hz].

So a fast sensor counts no more than a slow one. Neighbouring samples are nearly copies."""


class Progress(Protocol):
    """Iteration over items that may show a progress bar."""

    def __call__(self, items: Iterable[T], what: str, total: int) -> Iterator[T]:
        """Yield the items.

        Args:
            items: to yield.
            what: is done with them, in one word.
            total: number of items.
        """
        ...


def show_nothing(items: Iterable[T], what: str, total: int) -> Iterator[T]:
    """Yield the items without a progress bar."""
    del what, total
    return iter(items)


class OneRecording(Sequence[Recording]):
    """One recording of a dataset, which is read when it is accessed.

    Another process gets a slice of the dataset, so that it reads the recording itself.

    Args:
        recordings: a dataset, or any sequence; one without slices stays in this process.
        index: of the recording.
    """

    def __init__(self, recordings: Sequence[Recording], index: int) -> None:
        self._recordings, self._index = recordings, index

    def __len__(self) -> int:
        return 1

    def __getitem__(self, index: Any) -> Any:  # noqa: ANN401 (an index, or a slice)
        return self._recordings[range(self._index, self._index + 1)[index]]

    def __reduce__(self) -> tuple[Any, ...]:
        return _unchanged, (self._recordings[self._index : self._index + 1],)


def _unchanged(part: Sequence[Recording]) -> Sequence[Recording]:
    return part


@dataclass(frozen=True)
class ScannedRecording:
    """Facts about a recording that training needs after the recording is released.

    Attributes:
        name: of the recording.
        digest: of its samples.
        readings_digest: of its readings alone, which a copy with other times shares.
        blocks: of its readings, of which a part of it has some.
        object: object that was held; None if the metadata do not name it.
        rate: samples per second [Hz].
        n_labelled: number of labelled samples of each finger that has any.
        step: every step-th of them is used.
    """

    name: str
    digest: str
    readings_digest: str
    object: str | None
    rate: float
    n_labelled: dict[str, int]
    blocks: Digests = field(compare=False)
    step: int = 1


class RecordingScan(NamedTuple):
    """Facts about a recording, and the sensor of each finger that has labels."""

    recording: ScannedRecording
    sensors: dict[str, Sensor]


@dataclass(frozen=True)
class DatasetScan:
    """Recordings and sensors of a dataset.

    Attributes:
        recordings: in the order of the dataset.
        sensors: sensor of each finger that has labels; the first one, if they differ.
        smallest: the sensor with the fewest taxels of all of them.
        requested_rate: rate of the model [Hz]; None for that of the recordings.
        relative: whether the model is for any sensor and rate.
    """

    recordings: tuple[ScannedRecording, ...]
    sensors: dict[str, Sensor]
    smallest: Sensor
    requested_rate: float | None = None
    relative: bool = False

    @property
    def model_rate(self) -> float | None:
        """Rate to which recordings are resampled [Hz]; None if the model is for any rate."""
        return None if self.relative else self.rate

    @property
    def rate(self) -> float:
        """The requested rate, else the median rate of the recordings [Hz]."""
        if self.requested_rate is not None:
            return self.requested_rate
        return float(np.median([recording.rate for recording in self.recordings]))

    @property
    def n_labelled(self) -> int:
        """Number of labelled samples that are used of the finger that has most."""
        return max(
            sum(
                -(-recording.n_labelled.get(finger, 0) // recording.step)
                for recording in self.recordings
            )
            for finger in self.sensors
        )


def scan_dataset(
    recordings: Iterable[Recording], rate: float | None = None, *, relative: bool = False
) -> DatasetScan:
    """Read every recording once, one at a time, and check that all fit together.

    Args:
        recordings: labelled.
        rate: rate of the model [Hz]; None for the median rate of the recordings.
        relative: the features are relative, so that sensors, units and rates may differ.

    Raises:
        TrainingError: there are no recordings or no labels, two recordings have the same
            readings or name, a finger has different sensors, or relative features are not
            made for the rate of a recording.
    """
    scans = (scan_recording(recording, relative=relative) for recording in recordings)
    return combine_scans(scans, rate, relative=relative)


def scan_recording(recording: Recording, *, relative: bool = False) -> RecordingScan:
    """Return the facts about a recording, and the sensors of its labelled fingers.

    Raises:
        TrainingError: relative features are not made for its rate.
        RecordingError: two fingers have the same readings.
    """
    recording.check_modules_differ()
    # Of the file as it is, before repeats are left out: a model names what it was trained on.
    digest, readings_digest, blocks = recording.digest, recording.readings_digest, recording.blocks
    recording = true_updates(recording)
    modules = {name: module for name, module in recording.modules.items() if module.labels}
    counts = {name: int((module.label_states > 0).sum()) for name, module in modules.items()}
    counts = {name: count for name, count in counts.items() if count}
    step = 1
    if relative and counts:
        low, high = RELATIVE_RATES
        if not low * (1 - EXACT_RATE) <= recording.rate <= high * (1 + EXACT_RATE):
            raise TrainingError(
                f"recording {recording.name!r} has {recording.rate:.4g} Hz, relative features "
                f"expect {low:g} to {high:g} Hz"
            )
        step = max(1, round(recording.rate / RELATIVE_SAMPLE_RATE))
    held_object = recording.metadata.get("object")
    scanned = ScannedRecording(
        name=recording.name,
        digest=digest,
        readings_digest=readings_digest,
        object=None if held_object is None else str(held_object),
        rate=recording.rate,
        n_labelled=counts,
        blocks=blocks,
        step=step,
    )
    return RecordingScan(scanned, {name: modules[name].sensor for name in counts})


def combine_scans(
    scans: Iterable[RecordingScan], rate: float | None = None, *, relative: bool = False
) -> DatasetScan:
    """Return the scan of a dataset from those of its recordings; see `scan_dataset`."""
    scanned: list[ScannedRecording] = []
    sensors: dict[str, Sensor] = {}
    smallest: Sensor | None = None
    for recording, sensors_of_recording in scans:
        scanned.append(recording)
        for finger, sensor in sensors_of_recording.items():
            first_sensor = sensors.setdefault(finger, sensor)
            smallest = min(smallest or sensor, sensor, key=lambda x: x.n_taxels)
            # Relative features carry over between sensors; the others are numbers of one sensor.
            if not relative and sensor != first_sensor:
                texts = [
                    f"{s.name} ({s.n_taxels} taxels, {s.unit})" for s in (sensor, first_sensor)
                ]
                layout = "" if texts[0] != texts[1] else " with another layout or rate"
                raise TrainingError(
                    f"{finger} of {recording.name!r} has the sensor {texts[0]}, other recordings "
                    f"have {texts[1]}{layout}"
                )
    if not scanned:
        raise TrainingError("no recordings given; at least one expected")
    if smallest is None:
        raise TrainingError(f"none of the {len(scanned)} recordings has labels to train from")
    # By the readings alone, so that a copy with other times is found, too.
    name_of_digest: dict[str, str] = {}
    names: set[str] = set()
    for recording in scanned:
        if recording.name in names:
            raise TrainingError(
                f"two recordings are called {recording.name!r}; different names expected"
            )
        names.add(recording.name)
        first = name_of_digest.setdefault(recording.readings_digest, recording.name)
        if first != recording.name:
            raise TrainingError(
                f"recordings {first!r} and {recording.name!r} hold the same readings: one would "
                "be tested by a model that was trained on the other"
            )
    return DatasetScan(tuple(scanned), sensors, smallest, rate, relative)
