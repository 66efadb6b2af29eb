"""Options of `holdfast serve` that publish on topics of ROS."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from holdfast.live.publishers.ros_publisher import RosPublisher
    from holdfast.live.stream_detector import StreamDetector


@dataclass(frozen=True)
class Ros2Options:
    """Options of ROS 2."""

    ros2: Annotated[bool, typer.Option("--ros2", help="Also publish on ROS 2 topics.")] = False


@dataclass(frozen=True)
class Ros1Options:
    """Options of ROS 1."""

    ros1: Annotated[bool, typer.Option("--ros1", help="Also publish on ROS 1 topics.")] = False


class Ros2:
    """Topics of ROS 2."""

    OPTIONS = Ros2Options()

    @staticmethod
    def publisher(
        stream: "StreamDetector", panels: Mapping[str, Any], options: Ros2Options
    ) -> "RosPublisher":
        """Return the publisher of a stream; it is not open yet."""
        from holdfast.live.publishers.ros_publisher import Ros2Publisher

        return Ros2Publisher(_units(stream), grip=panels.get("grip"))


class Ros1:
    """Topics of ROS 1."""

    OPTIONS = Ros1Options()

    @staticmethod
    def publisher(
        stream: "StreamDetector", panels: Mapping[str, Any], options: Ros1Options
    ) -> "RosPublisher":
        """Return the publisher of a stream; it is not open yet."""
        from holdfast.live.publishers.ros_publisher import Ros1Publisher

        return Ros1Publisher(_units(stream), grip=panels.get("grip"))


def _units(stream: "StreamDetector") -> dict[str, Any]:
    """Return the unit of the readings of each finger."""
    return {name: sensor.unit for name, sensor in stream.fingers.items()}
