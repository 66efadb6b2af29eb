"""Poses in bags of ROS 1 and ROS 2: topics of PoseStamped, frames of TFMessage."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from holdfast.errors import MissingExtra, RecordingError
from holdfast.sensors.types import Array

POSE, FRAMES = "geometry_msgs/msg/PoseStamped", "tf2_msgs/msg/TFMessage"

_Row = tuple[float, float, float, float, float, float, float, float]
_Found = tuple[str, str, _Row]


def read_bag(path: Path, wanted: Mapping[str, str]) -> dict[str, Array]:
    """Rows of time and pose by body.

    Args:
        path: of the bag.
        wanted: by body, a topic (with a slash at its beginning) or a child frame.

    Returns:
        By body (n, 8): time [s], position [m], quaternion w x y z.

    Raises:
        RecordingError: it cannot be read, lacks a topic or frame, or their parents differ.
        MissingExtra: rosbags is not installed.
    """
    rows: dict[str, list[_Row]] = {}
    parents: dict[str, str] = {}
    try:
        for name, parent, row in _messages(path):
            rows.setdefault(name, []).append(row)
            parents[name] = parent
    except (MissingExtra, RecordingError):
        raise
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror or cause}") from cause
    except Exception as cause:  # what rosbags raises on damage is its own affair
        text = " ".join(str(cause).split())[:200] or type(cause).__name__
        raise RecordingError(f"{path} is cut, damaged or no bag: {text}") from cause
    if missing := [name for name in wanted.values() if name not in rows]:
        there = ", ".join(sorted(rows)) or "none"
        raise RecordingError(f"{path} has no pose of {', '.join(missing)}; it has {there}")
    frames = sorted({parents[name] for name in wanted.values()})
    if len(frames) > 1:
        raise RecordingError(f"{path}: poses in one frame expected, {' and '.join(frames)} given")
    return {body: np.array(rows[name]) for body, name in wanted.items()}


def _messages(path: Path) -> Iterator[_Found]:
    """Topic or child frame, parent frame, and pose of every message."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as cause:
        raise MissingExtra("rosbags", "bags") from cause
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        connections = [one for one in reader.connections if one.msgtype in (POSE, FRAMES)]
        for connection, _, data in reader.messages(connections):
            message: Any = reader.deserialize(data, connection.msgtype)
            if connection.msgtype == POSE:
                where, turn = message.pose.position, message.pose.orientation
                yield connection.topic, *_found(message.header, where, turn)
            else:
                for one in message.transforms:
                    where, turn = one.transform.translation, one.transform.rotation
                    yield one.child_frame_id.lstrip("/"), *_found(one.header, where, turn)


def _found(header: Any, where: Any, turn: Any) -> tuple[str, _Row]:  # noqa: ANN401 (messages)
    time = header.stamp.sec + header.stamp.nanosec * 1e-9
    pose = (where.x, where.y, where.z, turn.w, turn.x, turn.y, turn.z)
    return header.frame_id.lstrip("/"), (time, *pose)
