"""Publish estimates on ROS 1 topics, with rospy."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from holdfast.devices.ros import rospy_node
from holdfast.live.publishers.ros_publisher import (
    DIAGNOSTICS,
    VECTOR,
    WRENCH,
    DiagnosticStatus,
    RosPublisher,
)
from holdfast.sensors.types import Unit

if TYPE_CHECKING:
    from holdfast.live.loop.live_grip import LiveGrip

QUEUE_SIZE = 10
"""Messages that rospy keeps for a slow subscriber; the oldest is dropped first."""


class Ros1Publisher(RosPublisher):
    """Publish estimates on ROS 1 topics.

    Args:
        units: of the readings, by finger.
        namespace: prefix of the topics.
        master: URI of the ROS master; by default `ROS_MASTER_URI`.
        grip: the loop that controls the hand; None if there is none.

    Raises:
        ValueError: as `RosPublisher`, or `master` is not a URI.
    """

    def __init__(
        self,
        units: Mapping[str, Unit],
        namespace: str = "/holdfast",
        master: str | None = None,
        grip: "LiveGrip | None" = None,
    ) -> None:
        super().__init__(units, namespace, grip)
        self._master = rospy_node.master_uri(master)
        self._publishers: dict[str, Any] = {}
        self._message_types: dict[str, type[Any]] = {}
        self._rospy: Any = None

    def _connect(self, topics: Mapping[str, str]) -> None:
        self._rospy = rospy_node.start_node(self._master)
        self._message_types = {name: rospy_node.message_type(name) for name in set(topics.values())}
        for name in ("DiagnosticStatus", "KeyValue"):
            self._message_types[name] = rospy_node.message_type(f"diagnostic_msgs/{name}")
        self._publishers = {
            topic: self._rospy.Publisher(topic, self._message_types[name], queue_size=QUEUE_SIZE)
            for topic, name in topics.items()
        }

    def _disconnect(self) -> None:
        publishers, self._publishers = self._publishers, {}
        for publisher in publishers.values():
            publisher.unregister()

    def _publish_text(self, topic: str, text: str) -> None:
        self._publishers[topic].publish(str(text))

    def _publish_number(self, topic: str, number: float) -> None:
        self._publishers[topic].publish(number)

    def _publish_force(
        self,
        topic: str,
        stamp: float,
        finger: str,
        force: tuple[float, float, float],
        *,
        newtons: bool,
    ) -> None:
        message = self._message_types[WRENCH if newtons else VECTOR]()
        vector = message.wrench.force if newtons else message.vector
        self._stamp(message.header, stamp, finger)
        vector.x, vector.y, vector.z = force
        self._publishers[topic].publish(message)

    def _publish_diagnostics(self, stamp: float, statuses: Iterable[DiagnosticStatus]) -> None:
        message = self._message_types[DIAGNOSTICS]()
        self._stamp(message.header, stamp, "")
        for status in statuses:
            values = [self._message_types["KeyValue"](key, value) for key, value in status.values]
            one = self._message_types["DiagnosticStatus"](
                status.level, f"holdfast: {status.name}", status.message, "holdfast", values
            )
            message.status.append(one)
        self._publishers["/diagnostics"].publish(message)

    def _stamp(self, header: Any, stamp: float, frame: str) -> None:  # noqa: ANN401
        header.stamp = self._rospy.Time.from_sec(stamp)
        header.frame_id = frame
