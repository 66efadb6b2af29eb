"""Bags of ROS 1 and ROS 2 with topics of tactile sensors: XELA's uSkin, Contactile's PapillArray.

A bag's messages are decoded by the definitions in it, as data. Topics of other types are left
out.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import MissingExtra, RecordingError
from holdfast.io.importers.table import natural
from holdfast.recordings import Recording, Tactile
from holdfast.ros.definitions import Definition, parse_definition, short_name
from holdfast.ros.messages import (
    DeviceSample,
    SampleDecoder,
    known_definition,
    module_name,
    readings_of,
    sensors_of,
)
from holdfast.sensors import xela_models
from holdfast.sensors.types import Array

METADATA = "metadata.yaml"
MAGICS = {
    ".bag": re.compile(rb"#ROSBAG V"),
    ".db3": re.compile(rb"SQLite format 3\x00"),
    ".mcap": re.compile(rb"\x89MCAP0\r\n\x01.{8}\x04\x00\x00\x00ros2", re.DOTALL),
}
"""How the files of bags begin; MCAP with the profile of ROS 2, which is not ours."""
CLOCKS = ("device", "header", "bag")
"""Whose stamps the times of a recording are, the best first."""
APART = 1.0
"""Clocks of two topics that run so far apart, as seen by the bag's, are two clocks [s]."""


def sniff(path: Path) -> bool:
    """Whether it is a bag, or a folder that holds some."""
    return bool(_bags(path))


def read(path: Path) -> Iterator[Recording]:
    """The recording in a bag, or those in the bags of a folder.

    Raises:
        RecordingError: there is no bag, or one is damaged or has no topic that we know.
        MissingExtra: rosbags is not installed.
    """
    bags = _bags(path)
    if not bags and path.is_file():
        what = "is no bag of ROS" if path.stat().st_size else "is empty"
        raise RecordingError(f"{path} {what}; a .bag, .db3 or .mcap file of ROS expected")
    if not bags:
        raise RecordingError(f"no bag of ROS in {path}; a folder with {METADATA} or .bag expected")
    try:
        import rosbags.rosbag1
        import rosbags.rosbag2  # noqa: F401 (what is missing is told before the first is read)
    except ImportError as cause:
        raise MissingExtra("rosbags", "bags") from cause
    return (_recording(bag) for bag in bags)


def _bags(path: Path) -> list[Path]:
    if _is_bag(path):
        return [path]
    return sorted((inside for inside in path.glob("*") if _is_bag(inside)), key=natural)


def _is_bag(path: Path) -> bool:
    if path.is_dir():
        return (path / METADATA).is_file()
    if path.suffix not in MAGICS or not path.is_file():
        return False
    with path.open("rb") as file:
        return MAGICS[path.suffix].match(file.read(64)) is not None


def _recording(path: Path) -> Recording:
    try:
        return _Bag(path).recording()
    except RecordingError:
        raise
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror or cause}") from cause
    except Exception as cause:  # what rosbags raises on damage is its own affair
        text = " ".join(str(cause).split())[:200] or type(cause).__name__
        raise RecordingError(f"{path} is cut or damaged: {text}") from cause


class _Topic(NamedTuple):
    """A topic of the bag, and how its messages are read."""

    name: str
    kind: str
    unpack: SampleDecoder
    connections: list[Any]


@dataclass
class _Track:
    """What one device said in one topic, message by message."""

    first: DeviceSample
    readings: list[npt.NDArray[Any]] = field(default_factory=list)
    stamps: list[tuple[float | None, float | None, float]] = field(default_factory=list)
    n_refused: int = 0
    last: DeviceSample | None = None

    def add(self, message: DeviceSample, time: float) -> None:
        """Takes a message that came at a time of the bag [s]; one that came twice, once."""
        given = readings_of(message, "count")
        if given.shape != readings_of(self.first, "count").shape:
            self.n_refused += 1
        elif self.last is None or not _same(self.last, message):
            self.readings.append(given)
            self.stamps.append((message.time, message.stamp, time))
        self.last = message

    def times(self, clock: str) -> Array | None:
        """By one of `CLOCKS` [s]; None where it misses one or does not go forward."""
        column = [stamps[CLOCKS.index(clock)] for stamps in self.stamps]
        if None in column:
            return None
        times = np.array(column, dtype=np.float64)
        return times if (np.diff(times) > 0).all() else None

    def offset(self, clock: str) -> float:
        """How far the bag's clock is ahead of that clock [s]."""
        times = self.times(clock)
        bag = np.array([stamps[-1] for stamps in self.stamps])
        return np.nan if times is None else float(np.median(bag - times))


def _same(one: DeviceSample, two: DeviceSample) -> bool:
    """Whether a packet was sent again."""
    return (
        two.time is not None
        and (one.time, one.sequence) == (two.time, two.sequence)
        and np.array_equal(readings_of(one, "count"), readings_of(two, "count"))
    )


class _Bag:
    """A bag, read once from its beginning to its end."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._ros2 = path.suffix != ".bag" or path.is_dir()
        self._tracks: dict[tuple[str, int], _Track] = {}

    def recording(self) -> Recording:
        with self._reader() as reader:
            topics = self._topics(reader.connections)
            for topic in topics:
                self._read(reader, topic)
        if not any(track.readings for track in self._tracks.values()):
            names = ", ".join(topic.name for topic in topics)
            raise RecordingError(f"{self._path} has no messages on {names}; at least one expected")
        clock = self._clock()
        try:
            return Recording(self._name(), self._modules(clock), self._metadata(topics, clock))
        except (RecordingError, ValueError) as cause:
            raise RecordingError(f"{self._path}: {cause}") from cause

    def _reader(self) -> Any:  # noqa: ANN401 (one of two classes of rosbags)
        if self._ros2:
            from rosbags.rosbag2 import Reader

            return Reader(self._path)
        from rosbags.rosbag1 import Reader as Reader1

        return Reader1(self._path)

    def _topics(self, connections: Iterable[Any]) -> list[_Topic]:
        topics: dict[str, _Topic] = {}
        others: list[str] = []
        for one in sorted(connections, key=lambda one: str(one.topic)):
            kind = short_name(one.msgtype)
            unpack = self._unpacker(one)
            if unpack is None:
                others.append(f"{one.topic} ({kind})")
            else:
                topic = topics.setdefault(one.topic, _Topic(one.topic, kind, unpack, []))
                topic.connections.append(one)
        if not topics:
            raise RecordingError(
                f"{self._path} has no topic of a tactile sensor that holdfast knows; it has "
                f"{', '.join(others) or 'none'}"
            )
        return list(topics.values())

    def _unpacker(self, connection: Any) -> SampleDecoder | None:  # noqa: ANN401 (a Connection)
        """By the definition in the bag, or the one we know; None for any other topic."""
        try:
            definition = self._definition(connection)
            return None if definition is None else SampleDecoder(definition, ros2=self._ros2)
        except ValueError:
            return None

    def _definition(self, connection: Any) -> Definition | None:  # noqa: ANN401
        kept = connection.msgdef
        if kept.format.name == "MSG" and kept.data.strip():
            return parse_definition(connection.msgtype, kept.data)
        return known_definition(connection.msgtype, ros2=self._ros2)

    def _read(self, reader: Any, topic: _Topic) -> None:  # noqa: ANN401
        n_read = 0
        for _, nanoseconds, data in reader.messages(topic.connections):
            n_read += 1
            for message in topic.unpack(bytes(data)):
                self._add(topic.name, message, nanoseconds * 1e-9)
        n_expected = sum(one.msgcount for one in topic.connections)
        if n_read < n_expected:
            raise RecordingError(
                f"{self._path} is cut or damaged: {n_read} messages on {topic.name}, "
                f"{n_expected} expected"
            )

    def _add(self, topic: str, message: DeviceSample, time: float) -> None:
        if not len(readings_of(message, "count")):  # the server's word for a sensor that is off
            return
        number = 0 if message.number is None else message.number
        self._tracks.setdefault((topic, number), _Track(message)).add(message, time)

    def _clock(self) -> str:
        """The best clock that all tracks have, that goes forward, and is one clock."""
        tracks = [track for track in self._tracks.values() if track.readings]
        for clock in CLOCKS[:-1]:
            offsets = [track.offset(clock) for track in tracks]
            if np.ptp(offsets) <= APART:  # False where one is NaN
                return clock
        return CLOCKS[-1]

    def _modules(self, clock: str) -> dict[str, Tactile]:
        modules: dict[str, Tactile] = {}
        for (topic, finger), track in self._fingers().items():
            made = _modules_of(finger, track, clock)
            before = _free(modules, made, finger, topic.strip("/"))
            modules.update({f"{before}{name}": module for name, module in made.items()})
        return modules

    def _fingers(self) -> dict[tuple[str, str], _Track]:
        """Tracks by topic and finger; what has no number is counted, in order of the topics."""
        fingers: dict[tuple[str, str], _Track] = {}
        n_without = 0
        for (topic, number), track in sorted(self._tracks.items()):
            n_without += track.first.number is None
            place = n_without if track.first.number is None else number
            fingers[topic, f"finger{place}"] = track
        return fingers

    def _metadata(self, topics: list[_Topic], clock: str) -> dict[str, Any]:
        hands = [xela_models.whole_hand(track.first.model) for track in self._tracks.values()]
        names = sorted({hand.name for hand in hands if hand is not None})
        n_refused = sum(track.n_refused for track in self._tracks.values())
        return {
            "source": self._path.name,
            "topics": {topic.name: topic.kind for topic in topics},
            "clock": clock,
            **({"hand": names[0]} if len(names) == 1 else {}),
            **({"n_refused": n_refused} if n_refused else {}),
        }

    def _name(self) -> str:
        return self._path.name if self._path.is_dir() else self._path.stem


def _free(
    taken: Mapping[str, Tactile], made: Mapping[str, Tactile], finger: str, topic: str
) -> str:
    """What comes before the names of modules, where others are called so."""
    inner = [f"{topic}/"] if finger in made else [f"{finger}/", f"{topic}/", f"{topic}/{finger}/"]
    return next(
        (before for before in ("", *inner) if not any(f"{before}{name}" in taken for name in made)),
        inner[-1],
    )


def _modules_of(finger: str, track: _Track, clock: str) -> Mapping[str, Tactile]:
    times = track.times(clock)
    if times is None:  # the bag's own do not go forward either: let the check say where
        times = np.array([stamps[-1] for stamps in track.stamps])
    sensors = sensors_of(track.first, "count")
    parts = xela_models.split(track.first.model, np.array(track.readings))
    return {
        module_name(finger, part, named=False): Tactile(sensor, times, parts[part])
        for part, sensor in sensors.items()
    }
