"""Import of bags of ROS 1 and ROS 2 with topics of tactile sensors.

The topics are those of XELA's uSkin and of Contactile's PapillArray. Topics of other types are
ignored.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.io.importers import IF_IN_CONTACT
from holdfast.io.importers.columns import Columns
from holdfast.io.importers.reading import ANY_MODULE, ForeignFile, recordings_of
from holdfast.io.importers.table import first_texts
from holdfast.io.proposals import ProposalError
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor, xela_models
from holdfast.sensors.types import Array
from holdfast_ros.bags import METADATA, Bag, BagTopic, find_bags, open_bag, poses_of, refusal
from holdfast_ros.sensor_messages import (
    DeviceSample,
    SampleDecoder,
    module_name,
    readings_of,
    sensors_of,
)
from holdfast_ros.topic_arrays import arrays_of_topics

TAKES_SENSORS = True
HINT = f"{IF_IN_CONTACT}; bias a PapillArray before, without load"
"""Option that helps with the recordings, for the person who imports them."""
MIN_DRIFT = 1e-3
"""Smallest relative difference of the clocks of a device and a bag that is noted."""
CLOCKS = ("device", "header", "bag")
"""Clocks that the times of a recording can come from, best first."""
MAX_PROPOSAL_MESSAGES = 300_000
"""Bags with more messages are not read for a proposal alone."""
ONE_CLOCK_DIFFERENCE = 1.0
"""Topics whose clocks differ by more, compared with the bag's clock, have two clocks [s]."""


def can_read(path: Path) -> bool:
    """Return whether `path` is a bag, or a folder with bags."""
    return bool(find_bags(path))


def parts(path: Path) -> list[Path]:
    """Return the bag, or the bags of a folder.

    Raises:
        RecordingError: there is none.
    """
    bags = find_bags(path)
    if not bags and path.is_file():
        problem = "is no bag of ROS" if path.stat().st_size else "is empty"
        raise RecordingError(f"{path} {problem}; a .bag, .db3 or .mcap file of ROS expected")
    if not bags:
        raise RecordingError(f"no bag of ROS in {path}; a folder with {METADATA} or .bag expected")
    return bags


def read(
    path: Path,
    sensors: Mapping[str, Sensor] | None = None,
    columns: Columns | None = None,
    report: Callable[[str], None] = lambda _: None,
    *,
    accept: bool = False,
) -> Iterator[Recording]:
    """Yield the recording in a bag.

    Args:
        path: path of the bag.
        sensors: sensor by topic, or by `TOPIC.FIELD`: any numbers in its messages are read.
        columns: as in `recordings_of`.
        report: as in `recordings_of`.
        accept: as in `recordings_of`.

    Raises:
        RecordingError: it is damaged or has no known topic.
    """
    with open_bag(path) as bag:
        bag_import = None if sensors or columns else _BagImport(path, bag)
        if bag_import is not None:
            if bag_import.topics:
                yield bag_import.recording(report)
                return
            if sum(topic.n_messages for topic in bag.topics) > MAX_PROPOSAL_MESSAGES:
                raise bag_import.no_topic()
        wanted = {name.replace(".", "/"): skin for name, skin in (sensors or {}).items()}
        arrays = arrays_of_topics(path, bag, wanted.keys() - {ANY_MODULE})
    source = ForeignFile(path, arrays, "--topic")
    try:
        yield from recordings_of(source, wanted, columns, report, accept=accept)
    except ProposalError:
        raise
    except RecordingError as cause:
        if bag_import is None:
            raise
        raise bag_import.no_topic() from cause


def poses(path: Path, bodies: Mapping[str, str]) -> dict[str, Array]:
    """Return the poses of bodies in a bag.

    Args:
        path: path of the bag, or of a folder with one bag.
        bodies: for each body a topic of `geometry_msgs/PoseStamped` (with a slash at its
            beginning) or a child frame in messages of `tf2_msgs/TFMessage`.

    Returns:
        For each body (n, 8): time [s], position [m], quaternion w x y z.

    Raises:
        RecordingError: the bag cannot be read, a topic or frame is missing, or the poses are
            in different frames.
    """
    bags = find_bags(path)
    if len(bags) != 1:
        raise RecordingError(
            f"one bag of ROS expected at {path}, {len(bags)} found; a .bag, .db3 or .mcap file, "
            f"or a folder with {METADATA}"
        )
    return poses_of(bags[0], bodies)


class _TactileTopic(NamedTuple):
    """A topic with samples: how to decode them, and its parts, one for each publisher."""

    name: str
    kind: str
    decode: SampleDecoder
    parts: list[BagTopic]


@dataclass
class _DeviceTrack:
    """All samples of one device in one topic.

    Attributes:
        first: the first sample.
        readings: (n_taxels, 3) of each sample.
        stamps: times of each sample by each of `CLOCKS` [s]; None if there is none.
        n_refused: number of samples with another number of taxels.
        last: the last sample.
    """

    first: DeviceSample
    readings: list[npt.NDArray[Any]] = field(default_factory=list)
    stamps: list[tuple[float | None, float | None, float]] = field(default_factory=list)
    n_refused: int = 0
    last: DeviceSample | None = None

    def add(self, sample: DeviceSample, time: float) -> None:
        """Append a sample that the bag has at `time` [s], unless it repeats the last one."""
        readings = readings_of(sample, "count")
        if readings.shape != readings_of(self.first, "count").shape:
            self.n_refused += 1
        # A sample with the number and the time of the last one is new if its readings are: the node
        # of a PapillArray may read while they change.
        elif (
            self.last is None
            or sample.time is None
            or (self.last.time, self.last.sequence) != (sample.time, sample.sequence)
            or not np.array_equal(readings_of(self.last, "count"), readings)
        ):
            self.readings.append(readings)
            self.stamps.append((sample.time, sample.stamp, time))
        self.last = sample

    def drop_undated(self) -> int:
        """Drop samples without a time of their own by the clock of the device.

        The node of the PapillArray sends what it has, at its own rate: zeros before the first
        packet, and a sample that changes while it is read, twice with one time. A clock that goes
        back, or stands still for more than half of the samples, is no clock, and all are kept.

        Returns:
            The number of samples that were dropped.
        """
        times = [time for time, _, _ in self.stamps]
        first = next((k for k, time in enumerate(times) if time is not None), len(times))
        dated = np.array(times[first:], dtype=np.float64)  # NaN for None
        steps = np.diff(dated)
        n_kept = 1 + int(np.count_nonzero(steps > 0))
        if not (steps >= 0).all() or not len(dated) or 2 * n_kept < len(times):
            return 0
        indices = first + np.flatnonzero(np.append(True, steps > 0))
        self.readings = [self.readings[index] for index in indices]
        self.stamps = [self.stamps[index] for index in indices]
        return len(times) - n_kept

    def times(self, clock: str) -> Array | None:
        """Return the times by a clock [s]; None if one is missing or they do not increase."""
        column = [stamps[CLOCKS.index(clock)] for stamps in self.stamps]
        if None in column:
            return None
        times = np.array(column, dtype=np.float64)
        return times if (np.diff(times) > 0).all() else None

    def offset(self, clock: str) -> float:
        """Return how far the bag's clock is ahead of another clock [s]; NaN if unknown."""
        times = self.times(clock)
        bag_times = np.array([stamps[-1] for stamps in self.stamps])
        return np.nan if times is None else float(np.median(bag_times - times))


class _BagImport:
    """Import of one bag, which is read once from its beginning to its end."""

    def __init__(self, path: Path, bag: Bag) -> None:
        self._path = path
        self._bag = bag
        self._tracks: dict[tuple[str, int], _DeviceTrack] = {}
        self._n_undated = 0
        self._others: list[str] = []
        self.topics = self._tactile_topics()

    def recording(self, report: Callable[[str], None]) -> Recording:
        topics = self.topics
        for topic in topics:
            if topic.decode.note:
                report(f"{topic.name}: {topic.decode.note}")
        self._read(topics)
        self._n_undated = sum(track.drop_undated() for track in self._tracks.values())
        if not any(track.readings for track in self._tracks.values()):
            names = ", ".join(topic.name for topic in topics)
            raise RecordingError(f"{self._path} has no messages on {names}; at least one expected")
        # The best clock that all tracks have, that increases and that is one clock. The clock of
        # the bag needs no check: it is used where no other one fits.
        tracks, clock = [track for track in self._tracks.values() if track.readings], CLOCKS[-1]
        for candidate in reversed(CLOCKS[:-1]):
            offsets = [track.offset(candidate) for track in tracks]
            if np.ptp(offsets) <= ONE_CLOCK_DIFFERENCE:  # False if an offset is NaN
                clock = candidate
        name = self._path.name if self._path.is_dir() else self._path.stem
        try:
            modules, metadata = self._modules(clock), self._metadata(topics, clock)
            return Recording(name, modules, metadata)
        except (RecordingError, ValueError) as cause:
            raise RecordingError(f"{self._path}: {cause}") from cause

    def _tactile_topics(self) -> list[_TactileTopic]:
        topics: dict[str, _TactileTopic] = {}
        for part in self._bag.topics:
            decode = None
            if part.definition is not None:
                with suppress(ValueError):  # messages of another kind
                    decode = SampleDecoder(part.definition, ros2=self._bag.ros2)
            if decode is None:
                self._others.append(f"{part.name} ({part.kind})")
            else:
                topic = _TactileTopic(part.name, part.kind, decode, [])
                topics.setdefault(part.name, topic).parts.append(part)
        return list(topics.values())

    def no_topic(self) -> RecordingError:
        """Return the error of a bag without a topic of a known sensor."""
        return RecordingError(
            f"{self._path} has no topic of a supported tactile sensor; it has "
            f"{first_texts(self._others)}; for numbers x, y, z of any topic: --topic /TOPIC=SENSOR"
        )

    def _read(self, topics: list[_TactileTopic]) -> None:
        """Read the samples of all topics, in the order of time."""
        decoders = {topic.name: topic.decode for topic in topics}
        n_read = Counter[str]()
        for part, time, data in self._bag.messages(
            part for bag_topic in topics for part in bag_topic.parts
        ):
            n_read[part.name] += 1
            for sample in decoders[part.name](data):
                readings = readings_of(sample, "count")
                if not len(readings):  # XELA's server sends this for a sensor off
                    continue
                key = part.name, 0 if sample.number is None else sample.number
                self._tracks.setdefault(key, _DeviceTrack(sample)).add(sample, time)
        for topic in topics:
            n_expected = sum(part.n_messages for part in topic.parts)
            if n_read[topic.name] < n_expected:
                problem = f"{n_read[topic.name]} messages on {topic.name}, {n_expected} expected"
                raise refusal(self._path, problem)

    def _modules(self, clock: str) -> dict[str, Tactile]:
        modules: dict[str, Tactile] = {}
        n_without = 0  # devices without a number are counted over all topics
        for (topic, number), track in sorted(self._tracks.items()):
            n_without += track.first.number is None
            finger = f"finger{n_without if track.first.number is None else number}"
            times = track.times(clock)
            if times is None:  # the bag's times do not increase either: Tactile names the index
                times = np.array([stamps[-1] for stamps in track.stamps])
            sensors = sensors_of(track.first, "count")
            parts = xela_models.split(track.first.model, np.array(track.readings))
            new = {
                module_name(finger, part, named=False): Tactile(sensor, times, parts[part])
                for part, sensor in sensors.items()
            }
            # Two topics may have devices of one number: the shortest prefix that makes the names
            # of the modules different from all before.
            base = topic.strip("/")
            prefixes = ["", f"{finger}/", f"{base}/", f"{base}/{finger}/"]
            if finger in new:
                prefixes = ["", f"{base}/"]
            free = (x for x in prefixes if not any(f"{x}{name}" in modules for name in new))
            prefix = next(free, prefixes[-1])
            modules.update({f"{prefix}{name}": module for name, module in new.items()})
        return modules

    def _metadata(self, topics: list[_TactileTopic], clock: str) -> dict[str, Any]:
        hands = [xela_models.whole_hand(track.first.model) for track in self._tracks.values()]
        names = sorted({hand.name for hand in hands if hand is not None})
        n_refused = sum(track.n_refused for track in self._tracks.values())
        # How much faster the clock of the bag runs than that of the longest track.
        drift, track = 0.0, max(self._tracks.values(), key=lambda track: len(track.stamps))
        if len(track.stamps) > 2:
            pairs = [(row[CLOCKS.index(clock)], row[-1]) for row in track.stamps]
            stamps = np.array(pairs, dtype=np.float64)
            device, bag = (stamps - stamps[0]).T
            drift = round(float(np.polyfit(device, bag - device, 1)[0]), 6)
        return {
            "source": self._path.name,
            "topics": {topic.name: topic.kind for topic in topics},
            "clock": clock,
            **({"hand": names[0]} if len(names) == 1 else {}),
            **({"n_refused": n_refused} if n_refused else {}),
            **({"n_undated": self._n_undated} if self._n_undated else {}),
            **({"clock_drift": drift} if abs(drift) >= MIN_DRIFT else {}),
        }
