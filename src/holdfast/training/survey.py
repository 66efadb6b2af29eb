"""One pass over the recordings before training: what is there, and whether it fits together."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from holdfast.errors import TrainingError
from holdfast.recordings import Recording
from holdfast.sensors import Sensor


@dataclass(frozen=True)
class Entry:
    """What training has to know of a recording without keeping it.

    Attributes:
        name: of the recording.
        digest: of its samples.
        object: that was held; None where the metadata do not say.
        rate: samples per second [Hz].
        n_labelled: labelled samples of each finger that has any.
    """

    name: str
    digest: str
    object: str | None
    rate: float
    n_labelled: dict[str, int]


@dataclass(frozen=True)
class Survey:
    """What is in a dataset.

    Attributes:
        entries: one for each recording, in order.
        sensors: of each finger that has labels.
        asked_rate: that the model is to have [Hz]; None for that of the recordings.
    """

    entries: tuple[Entry, ...]
    sensors: dict[str, Sensor]
    asked_rate: float | None = None

    @property
    def rate(self) -> float:
        """The rate asked for, else the median rate of the recordings [Hz]."""
        if self.asked_rate is not None:
            return self.asked_rate
        return float(np.median([entry.rate for entry in self.entries]))

    @property
    def n_labelled(self) -> int:
        """Labelled samples of the finger that has most."""
        return max(
            sum(entry.n_labelled.get(finger, 0) for entry in self.entries)
            for finger in self.sensors
        )


def survey(recordings: Iterable[Recording], rate: float | None = None) -> Survey:
    """Looks at every recording once, one at a time.

    Args:
        recordings: labelled.
        rate: that the model is to have [Hz]; None for the median rate of the recordings.

    Raises:
        TrainingError: there is none, none has labels, two have the same samples or name, or
            one finger has different sensors.
    """
    entries: list[Entry] = []
    sensors: dict[str, Sensor] = {}
    for recording in recordings:
        entries.append(_entry(recording))
        for finger in entries[-1].n_labelled:
            found = recording.modules[finger].sensor
            known = sensors.setdefault(finger, found)
            _refuse_unlike(f"{finger} of {recording.name!r}", found, known)
    if not entries:
        raise TrainingError("no recordings given; at least one expected")
    if not sensors:
        raise TrainingError(f"none of the {len(entries)} recordings has labels to train from")
    _refuse_copies(entries)
    return Survey(tuple(entries), sensors, rate)


def _entry(recording: Recording) -> Entry:
    counts = {
        name: int((module.label_states > 0).sum())
        for name, module in recording.modules.items()
        if module.labels
    }
    thing = recording.metadata.get("object")
    return Entry(
        name=recording.name,
        digest=recording.digest,
        object=None if thing is None else str(thing),
        rate=recording.rate,
        n_labelled={name: count for name, count in counts.items() if count},
    )


def _refuse_unlike(what: str, sensor: Sensor, known: Sensor) -> None:
    if sensor != known:
        given, expected = (f"{s.name} ({s.n_taxels} taxels, {s.unit})" for s in (sensor, known))
        where = "" if given != expected else ", laid out in another way"
        raise TrainingError(f"{what} has the sensor {given}, that of others {expected}{where}")


def _refuse_copies(entries: list[Entry]) -> None:
    seen: dict[str, str] = {}
    names: set[str] = set()
    for entry in entries:
        if entry.name in names:
            raise TrainingError(f"two recordings are called {entry.name!r}; each needs its own")
        names.add(entry.name)
        if entry.digest in seen:
            raise TrainingError(
                f"recordings {seen[entry.digest]!r} and {entry.name!r} hold the same samples: "
                "one would test what the other trained"
            )
        seen[entry.digest] = entry.name
