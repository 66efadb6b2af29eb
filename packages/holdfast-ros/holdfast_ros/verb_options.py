"""Options that the package adds to verbs: `serve --ros2`, `serve --ros1` and `play --hand`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from holdfast.devices.sources import Source
    from holdfast.live.stream_detector import StreamDetector
    from holdfast_ros.publisher import RosPublisher


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
        from holdfast_ros.publisher import Ros2Publisher

        return Ros2Publisher(finger_units(stream), grip=panels.get("grip"))


class Ros1:
    """Topics of ROS 1."""

    OPTIONS = Ros1Options()

    @staticmethod
    def publisher(
        stream: "StreamDetector", panels: Mapping[str, Any], options: Ros1Options
    ) -> "RosPublisher":
        """Return the publisher of a stream; it is not open yet."""
        from holdfast_ros.publisher import Ros1Publisher

        return Ros1Publisher(finger_units(stream), grip=panels.get("grip"))


def finger_units(stream: "StreamDetector") -> dict[str, Any]:
    """Return the unit of the readings of each finger."""
    return {name: sensor.unit for name, sensor in stream.fingers.items()}


@dataclass(frozen=True)
class DrivenTwinOptions:
    """Options of the twin that takes commands."""

    hand: Annotated[
        str,
        typer.Option(
            help="The twin takes commands as this hand does: ros2:plexus?effort=E&max_effort=M. "
            "It plays once, for the first client.",
        ),
    ] = ""


class DrivenTwinPlayer:
    """The twin with the topics of a hand."""

    OPTIONS = DrivenTwinOptions()

    @staticmethod
    def source(text: str, options: DrivenTwinOptions, *, speed: float) -> "Source":
        """Return the twin with the topics of a hand.

        Raises:
            ValueError: the source is not the twin, or the hand is another one.
        """
        if not text.startswith("twin:"):
            raise ValueError(f"--hand needs the source twin:..., {text} given")
        from holdfast_ros.hands.driven_twin import DrivenTwin

        return DrivenTwin(text, options.hand, speed=speed)
