"""Bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap): their topics and messages, and poses in them.

rosbags reads the containers. Messages stay bytes until the core's codec decodes them by the
definitions in the bag, which are data: nothing from a bag is executed.
"""

import re
import shlex
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from holdfast.errors import RecordingError
from holdfast.io.cdr import MessageDecoder
from holdfast.io.definitions import Definition, field_paths, parse_definition, short_name
from holdfast.io.importers.table import natural_order
from holdfast.io.mcap_chunks import has_end
from holdfast.io.safe_reading import one_line
from holdfast.sensors.types import Array
from holdfast_ros.sensor_messages import known_definition

MAGICS = {
    ".bag": re.compile(rb"#ROSBAG V"),
    ".db3": re.compile(rb"SQLite format 3\x00"),
    ".mcap": re.compile(rb"\x89MCAP0\r\n\x01.{8}\x04\x00\x00\x00ros2", re.DOTALL),
}
"""First bytes of the files of bags, by suffix. MCAP has the profile of ROS 2."""
METADATA = "metadata.yaml"
"""File in the folder of a ROS 2 bag."""


class BagTopic(NamedTuple):
    """A topic of a bag.

    Attributes:
        name: name of the topic.
        kind: type of its messages, as ROS 1 writes it: `package/Type`.
        definition: definition of its messages; None if it is missing or cannot be parsed.
        n_messages: number of messages that the bag lists.
        number: number of its connection; a topic has one for each of its publishers.
    """

    name: str
    kind: str
    definition: Definition | None
    n_messages: int
    number: int


class Bag:
    """An open bag; see `open_bag`.

    Attributes:
        ros2: whether it is a bag of ROS 2.
        topics: its topics, in the order of their names.
    """

    def __init__(self, path: Path, reader: Any, *, ros2: bool) -> None:  # noqa: ANN401 (of rosbags)
        self._path, self._reader = path, reader
        self.ros2 = ros2
        self.topics: list[BagTopic] = []
        # Publishers of a type send the same definition, which is parsed once.
        definitions: dict[tuple[str, str], Definition | None] = {}
        for x in sorted(reader.connections, key=lambda x: x.topic):
            # Definitions in IDL are not parsed.
            text = x.msgdef.data if x.msgdef.format.name == "MSG" else ""
            key, kind = (x.msgtype, text), short_name(x.msgtype)
            if key not in definitions and text.strip():
                definitions[key] = None
                with suppress(ValueError):  # a topic that cannot be read does not hide the others
                    definitions[key] = parse_definition(*key)
            elif key not in definitions:
                definitions[key] = None
                if ros2:  # messages of known sensors first: ROS itself has none of these types
                    standard = standard_definition(x.msgtype)
                    definitions[key] = known_definition(x.msgtype) or standard
            topic = BagTopic(x.topic, kind, definitions[key], x.msgcount, x.id)
            self.topics.append(topic)

    def messages(self, topics: Iterable[BagTopic]) -> Iterator[tuple[BagTopic, float, bytes]]:
        """Yield topic, time of recording [s] and bytes of each message, in the order of time.

        Raises:
            RecordingError: the bag is cut or damaged.
        """
        by_number = {topic.number: topic for topic in topics}
        if not by_number:  # of rosbags, no connections are all
            return
        connections = [x for x in self._reader.connections if x.id in by_number]
        with bag_errors(self._path):
            for connection, nanoseconds, data in self._reader.messages(connections):
                yield by_number[connection.id], nanoseconds * 1e-9, data


def standard_definition(kind: str) -> Definition | None:
    """Return the definition of a type that ROS 2 itself has; None of others.

    Databases before ROS 2 Jazzy have no definitions.
    """
    from rosbags.typesys import Stores, get_typestore

    store, name = get_typestore(Stores.ROS2_HUMBLE), short_name(kind).replace("/", "/msg/")
    if name not in store.fielddefs:
        return None
    return parse_definition(kind, store.generate_msgdef(name, ros_version=2)[0])


def find_bags(path: Path) -> list[Path]:
    """Return the bag at `path`, or the bags in that folder in natural order."""
    if is_bag(path):
        return [path]
    return sorted((inside for inside in path.glob("*") if is_bag(inside)), key=natural_order)


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag for reading.

    Raises:
        RecordingError: rosbags cannot read it; the text has the command that recovers it.
    """
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    ros2 = path.is_dir() or path.suffix != ".bag"
    with bag_errors(path):
        reader = Reader2(path) if ros2 else Reader1(path)
        reader.open()
    try:
        yield Bag(path, reader, ros2=ros2)
    finally:
        reader.close()


@contextmanager
def bag_errors(path: Path) -> Iterator[None]:
    """Convert the errors of rosbags inside the block, which may be of any type.

    Raises:
        RecordingError: an error was raised.
    """
    try:
        yield
    except MemoryError:  # says nothing about the bag
        raise
    except Exception as cause:
        raise refusal(path, one_line(cause)) from cause


def refusal(path: Path, problem: str) -> RecordingError:
    """Return the error of a bag that is cut or damaged, with the command that recovers it."""
    # The index of a folder is its metadata; a file in it may be cut all the same.
    cut = [file for file in sorted(path.glob("*.mcap")) if not has_end(file)]
    target = cut[0] if cut else path
    kind = "" if target.is_dir() else target.suffix
    quoted = shlex.quote(str(target.parent if kind == ".db3" else target))
    commands = {
        ".bag": f"rosbag reindex {quoted}",
        ".mcap": f"mcap recover {quoted} -o recovered.mcap",
    }
    command = commands.get(kind, f"ros2 bag reindex {quoted}")
    return RecordingError(f"{path} is cut or damaged: {problem}; to recover it: {command}")


def poses_of(path: Path, wanted: Mapping[str, str]) -> dict[str, Array]:
    """Return the poses of bodies in a bag; see `importer.poses`."""
    rows: dict[str, list[tuple[float, ...]]] = {}
    frames: dict[str, str] = {}
    with open_bag(path) as bag:
        decoders = {
            topic.number: PoseDecoder(topic.definition, ros2=bag.ros2)
            for topic in bag.topics
            if topic.definition is not None and has_poses(topic.definition)
        }
        topics = [topic for topic in bag.topics if topic.number in decoders]
        for topic, _, data in bag.messages(topics):
            for pose in decoders[topic.number](data):
                name = pose.body or topic.name
                rows.setdefault(name, []).append((pose.time, *pose.position, *pose.quaternion))
                frames[name] = pose.frame
    if missing := [name for name in wanted.values() if name not in rows]:
        names = ", ".join(sorted(rows)) or "none"
        raise RecordingError(f"{path} has no pose of {', '.join(missing)}; it has {names}")
    parents = sorted({frames[name] for name in wanted.values()})
    if len(parents) > 1:
        raise RecordingError(f"{path}: poses in one frame expected, {' and '.join(parents)} given")
    return {body: np.array(rows[name]) for body, name in wanted.items()}


def is_bag(path: Path) -> bool:
    """Return whether a folder or file is a bag, by its first bytes."""
    if path.is_dir():
        return (path / METADATA).is_file()
    if path.suffix not in MAGICS or not path.is_file():
        return False
    with path.open("rb") as file:
        return MAGICS[path.suffix].match(file.read(64)) is not None


class StampedPose(NamedTuple):
    """Pose of a body in a frame at one instant.

    Attributes:
        body: name of the body's frame, without a slash at its beginning; empty if the message
            does not name it.
        frame: name of the frame that the pose is expressed in, without that slash.
        time: stamp in the header [s].
        position: x, y, z [m].
        quaternion: w, x, y, z.
    """

    body: str
    frame: str
    time: float
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


class PoseDecoder:
    """Decoder of messages of one type into the poses in them.

    Args:
        definition: definition of the messages.
        ros2: whether messages are encoded as in ROS 2; otherwise as in ROS 1.

    Raises:
        ValueError: the messages have no poses; see `has_poses`.
    """

    def __init__(self, definition: Definition, *, ros2: bool) -> None:
        if not has_poses(definition):
            raise ValueError(
                f"{definition.name} has no poses; messages like geometry_msgs/PoseStamped and "
                "tf2_msgs/TFMessage have"
            )
        self._decode = MessageDecoder(definition, ros2=ros2)

    def __call__(self, data: bytes) -> list[StampedPose]:
        """Return the poses in a message.

        Raises:
            ValueError: the bytes are not a message of this type.
        """
        message = self._decode(data)
        if "transforms" not in message:
            pose = message["pose"]
            return [stamped_pose("", message["header"], pose["position"], pose["orientation"])]
        return [
            stamped_pose(
                transform["child_frame_id"],
                transform["header"],
                transform["transform"]["translation"],
                transform["transform"]["rotation"],
            )
            for transform in message["transforms"]
        ]


def has_poses(definition: Definition) -> bool:
    """Return whether messages have the fields of PoseStamped or of TFMessage."""
    paths = field_paths(definition)
    return any(needed <= paths for needed in (_POSE_PATHS, _TF_PATHS))


def pose_paths(prefix: str, position: str, rotation: str) -> set[str]:
    """Return the paths of the fields of a stamped pose, with their types."""
    axes = [f"{position}.{axis}" for axis in "xyz"] + [f"{rotation}.{axis}" for axis in "wxyz"]
    return {f"{prefix}header.frame_id string", *(f"{prefix}{axis} float64" for axis in axes)}


_POSE_PATHS = pose_paths("", "pose.position", "pose.orientation")
_TF_PATHS = {
    "transforms[].child_frame_id string",
    *pose_paths("transforms[].", "transform.translation", "transform.rotation"),
}


def stamped_pose(
    body: str,
    header: Mapping[str, Any],
    position: Mapping[str, float],
    rotation: Mapping[str, float],
) -> StampedPose:
    """Return a pose with the names that tf2 has, and its time [s]."""
    # ROS 1 and ROS 2 give the two fields other names, in the same order.
    seconds, nanoseconds = header["stamp"].values()
    return StampedPose(
        # ROS 1 allowed a slash before the name of a frame; tf2 does not.
        body.lstrip("/"),
        header["frame_id"].lstrip("/"),
        seconds + nanoseconds * 1e-9,
        (position["x"], position["y"], position["z"]),
        (rotation["w"], rotation["x"], rotation["y"], rotation["z"]),
    )
