"""Poses in ROS messages: `geometry_msgs/PoseStamped` and `tf2_msgs/TFMessage`."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from holdfast.io.cdr import MessageDecoder
from holdfast.io.definitions import Definition, field_paths


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
            return [_pose("", message["header"], pose["position"], pose["orientation"])]
        return [
            _pose(
                one["child_frame_id"],
                one["header"],
                one["transform"]["translation"],
                one["transform"]["rotation"],
            )
            for one in message["transforms"]
        ]


def has_poses(definition: Definition) -> bool:
    """Return whether messages have the fields of PoseStamped or of TFMessage."""
    paths = field_paths(definition)
    return any(needed <= paths for needed in (_POSE_PATHS, _TF_PATHS))


def _pose_paths(prefix: str, position: str, rotation: str) -> set[str]:
    axes = [f"{position}.{axis}" for axis in "xyz"] + [f"{rotation}.{axis}" for axis in "wxyz"]
    return {f"{prefix}header.frame_id string", *(f"{prefix}{axis} float64" for axis in axes)}


_POSE_PATHS = _pose_paths("", "pose.position", "pose.orientation")
_TF_PATHS = {
    "transforms[].child_frame_id string",
    *_pose_paths("transforms[].", "transform.translation", "transform.rotation"),
}


def _pose(
    body: str,
    header: Mapping[str, Any],
    position: Mapping[str, float],
    rotation: Mapping[str, float],
) -> StampedPose:
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
