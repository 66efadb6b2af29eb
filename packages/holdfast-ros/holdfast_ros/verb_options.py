"""Option that the package adds to a verb: `serve --ros2`."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from holdfast.live.stream_detector import StreamDetector
    from holdfast_ros.publisher import Ros2Publisher


@dataclass(frozen=True)
class Ros2Options:
    """Options of ROS 2."""

    ros2: Annotated[bool, typer.Option("--ros2", help="Also publish on ROS 2 topics.")] = False


class Ros2:
    """Topics of ROS 2."""

    OPTIONS = Ros2Options()

    @staticmethod
    def publisher(stream: "StreamDetector", options: Ros2Options) -> "Ros2Publisher":
        """Return the publisher of a stream; it is not open yet."""
        from holdfast_ros.dds import Link
        from holdfast_ros.publisher import Ros2Publisher

        units = {name: sensor.unit for name, sensor in stream.fingers.items()}
        return Ros2Publisher(units, Link())
