"""Bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap): their topics and messages, and poses in them.

The package rosbags reads the containers only. Messages stay bytes until `holdfast.ros` decodes
them by the definitions in the bag, which are data: nothing from a bag is executed.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from holdfast.errors import MissingExtra, RecordingError
from holdfast.io.importers.table import natural_order
from holdfast.ros.definitions import Definition, parse_definition, short_name
from holdfast.ros.pose_messages import PoseDecoder, has_poses, known_pose_definition
from holdfast.ros.sensor_messages import known_definition
from holdfast.sensors.types import Array

METADATA = "metadata.yaml"
"""File in the folder of a ROS 2 bag."""
MAGICS = {
    ".bag": re.compile(rb"#ROSBAG V"),
    ".db3": re.compile(rb"SQLite format 3\x00"),
    ".mcap": re.compile(rb"\x89MCAP0\r\n\x01.{8}\x04\x00\x00\x00ros2", re.DOTALL),
}
"""First bytes of the files of bags, by suffix. MCAP has the profile of ROS 2."""
MAX_CAUSE_LENGTH = 200
"""Number of characters of an error of rosbags that are shown."""


class BagTopic(NamedTuple):
    """A topic of a bag.

    Attributes:
        name: name of the topic.
        kind: type of its messages, as ROS 1 writes it: `package/Type`.
        definition: definition of its messages; None if it is missing or cannot be parsed.
        n_messages: number of messages that the bag lists.
        connection: connection of rosbags; a topic has one for each of its publishers.
    """

    name: str
    kind: str
    definition: Definition | None
    n_messages: int
    connection: Any


class Bag:
    """An open bag; see `open_bag`.

    Attributes:
        ros2: whether it is a bag of ROS 2.
        topics: its topics, in the order of their names.
    """

    def __init__(self, reader: Any, *, ros2: bool) -> None:  # noqa: ANN401 (class of rosbags)
        self._reader = reader
        self.ros2 = ros2
        connections = sorted(reader.connections, key=lambda one: str(one.topic))
        self.topics = [self._topic(connection) for connection in connections]

    def messages(self, topics: Iterable[BagTopic]) -> Iterator[tuple[BagTopic, float, bytes]]:
        """Yield topic, time of recording [s] and bytes of each message, in the order of time."""
        by_connection = {topic.connection.id: topic for topic in topics}
        if not by_connection:
            return
        wanted = [topic.connection for topic in by_connection.values()]
        for connection, nanoseconds, data in self._reader.messages(wanted):
            yield by_connection[connection.id], nanoseconds * 1e-9, bytes(data)

    def _topic(self, connection: Any) -> BagTopic:  # noqa: ANN401 (rosbags.interfaces.Connection)
        return BagTopic(
            connection.topic,
            short_name(connection.msgtype),
            self._definition(connection),
            connection.msgcount,
            connection,
        )

    def _definition(self, connection: Any) -> Definition | None:  # noqa: ANN401
        """Return the definition in the bag; if there is none, the one of a known type."""
        stored = connection.msgdef
        try:
            if stored.format.name == "MSG" and stored.data.strip():
                return parse_definition(connection.msgtype, stored.data)
        except ValueError:
            return None
        kind = connection.msgtype
        return known_definition(kind, ros2=self.ros2) or known_pose_definition(kind, ros2=self.ros2)


def find_bags(path: Path) -> list[Path]:
    """Return the bag at `path`, or the bags in that folder in natural order."""
    if _is_bag(path):
        return [path]
    return sorted((inside for inside in path.glob("*") if _is_bag(inside)), key=natural_order)


def check_rosbags() -> None:
    """Check that the package rosbags is installed.

    Raises:
        MissingExtra: it is not.
    """
    try:
        import rosbags.rosbag1
        import rosbags.rosbag2  # noqa: F401
    except ImportError as cause:
        raise MissingExtra("rosbags", "bags") from cause


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag for reading; errors of rosbags inside the block become `RecordingError`.

    Raises:
        RecordingError: the bag cannot be read, is cut or damaged.
        MissingExtra: rosbags is not installed.
    """
    check_rosbags()
    ros2 = path.suffix != ".bag" or path.is_dir()
    try:
        with _reader(path, ros2=ros2) as reader:
            yield Bag(reader, ros2=ros2)
    except RecordingError:
        raise
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror or cause}") from cause
    except Exception as cause:  # rosbags raises errors of any type for a damaged bag
        text = " ".join(str(cause).split())[:MAX_CAUSE_LENGTH] or type(cause).__name__
        raise RecordingError(f"{path} is cut or damaged: {text}") from cause


def read_poses(path: Path, wanted: Mapping[str, str]) -> dict[str, Array]:
    """Read the poses of bodies from a bag.

    Args:
        path: path of the bag.
        wanted: for each body a topic of `geometry_msgs/PoseStamped` (with a slash at its
            beginning) or a child frame in messages of `tf2_msgs/TFMessage`.

    Returns:
        For each body (n, 8): time [s], position [m], quaternion w x y z.

    Raises:
        RecordingError: the bag cannot be read, a topic or frame is missing, or the poses are
            in different frames.
        MissingExtra: rosbags is not installed.
    """
    check_rosbags()
    bags = find_bags(path)
    if len(bags) != 1:
        raise RecordingError(
            f"one bag of ROS expected at {path}, {len(bags)} found; a .bag, .db3 or .mcap file, "
            f"or a folder with {METADATA}"
        )
    rows: dict[str, list[tuple[float, ...]]] = {}
    frames: dict[str, str] = {}
    for name, frame, row in _poses(bags[0]):
        rows.setdefault(name, []).append(row)
        frames[name] = frame
    if missing := [name for name in wanted.values() if name not in rows]:
        found = ", ".join(sorted(rows)) or "none"
        raise RecordingError(f"{path} has no pose of {', '.join(missing)}; it has {found}")
    parents = sorted({frames[name] for name in wanted.values()})
    if len(parents) > 1:
        raise RecordingError(f"{path}: poses in one frame expected, {' and '.join(parents)} given")
    return {body: np.array(rows[name]) for body, name in wanted.items()}


def _poses(path: Path) -> Iterator[tuple[str, str, tuple[float, ...]]]:
    """Yield topic or child frame, parent frame, and time and pose, of each pose in a bag."""
    with open_bag(path) as bag:
        decoders = {
            topic.connection.id: PoseDecoder(topic.definition, ros2=bag.ros2)
            for topic in bag.topics
            if topic.definition is not None and has_poses(topic.definition)
        }
        topics = [topic for topic in bag.topics if topic.connection.id in decoders]
        for topic, _, data in bag.messages(topics):
            for pose in decoders[topic.connection.id](data):
                row = (pose.time, *pose.position, *pose.quaternion)
                yield pose.body or topic.name, pose.frame, row


def _is_bag(path: Path) -> bool:
    if path.is_dir():
        return (path / METADATA).is_file()
    if path.suffix not in MAGICS or not path.is_file():
        return False
    with path.open("rb") as file:
        return MAGICS[path.suffix].match(file.read(64)) is not None


def _reader(path: Path, *, ros2: bool) -> Any:  # noqa: ANN401 (one of two classes of rosbags)
    if ros2:
        from rosbags.rosbag2 import Reader

        return Reader(path)
    from rosbags.rosbag1 import Reader as Reader1

    return Reader1(path)
