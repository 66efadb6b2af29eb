"""Estimates on ROS 1 topics: by rospy."""

from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

from holdfast.errors import SourceError
from holdfast.live.ros_publisher import DIAGNOSTICS, VECTOR, WRENCH, RosPublisher, Status
from holdfast.ros import rospy_node
from holdfast.sensors.types import Unit

N_SENDING = 10
"""Messages that rospy keeps for a subscriber that is slow; then the oldest goes."""


class Ros1Publisher(RosPublisher):
    """Publishes on ROS 1 topics.

    Args:
        units: of the readings, by finger.
        namespace: that topics begin with.
        master: URI of the ROS master; that of `ROS_MASTER_URI` where not given.

    Raises:
        ValueError: as `RosPublisher`, or it is no URI of a master.
    """

    def __init__(
        self,
        units: Mapping[str, Unit],
        namespace: str = "/holdfast",
        master: str | None = None,
    ) -> None:
        super().__init__(units, namespace)
        self._master = rospy_node.master_uri(master)
        self._publishers: dict[str, Any] = {}
        self._kinds: dict[str, type[Any]] = {}
        self._rospy: Any = None

    def _connect(self, topics: Mapping[str, str]) -> None:
        self._rospy = rospy_node.start_node(self._master)
        self._kinds = {kind: _message(kind) for kind in set(topics.values())}
        for name in ("DiagnosticStatus", "KeyValue"):
            self._kinds[name] = _message(f"diagnostic_msgs/{name}")
        self._publishers = {
            topic: self._rospy.Publisher(topic, self._kinds[kind], queue_size=N_SENDING)
            for topic, kind in topics.items()
        }

    def _disconnect(self) -> None:
        publishers, self._publishers = self._publishers, {}
        for publisher in publishers.values():
            publisher.unregister()

    def _text(self, topic: str, text: str) -> None:
        self._publishers[topic].publish(str(text))

    def _number(self, topic: str, number: float) -> None:
        self._publishers[topic].publish(number)

    def _force(
        self,
        topic: str,
        stamp: float,
        finger: str,
        force: tuple[float, float, float],
        *,
        newtons: bool,
    ) -> None:
        message = self._kinds[WRENCH if newtons else VECTOR]()
        vector = message.wrench.force if newtons else message.vector
        self._stamp(message.header, stamp, finger)
        vector.x, vector.y, vector.z = force
        self._publishers[topic].publish(message)

    def _diagnostics(self, stamp: float, statuses: Iterable[Status]) -> None:
        message = self._kinds[DIAGNOSTICS]()
        self._stamp(message.header, stamp, "")
        for status in statuses:
            values = [self._kinds["KeyValue"](key, value) for key, value in status.values]
            one = self._kinds["DiagnosticStatus"](
                status.level, f"holdfast: {status.name}", status.message, "holdfast", values
            )
            message.status.append(one)
        self._publishers["/diagnostics"].publish(message)

    def _stamp(self, header: Any, stamp: float, frame: str) -> None:  # noqa: ANN401
        header.stamp = self._rospy.Time.from_sec(stamp)
        header.frame_id = frame


def _message(kind: str) -> type[Any]:
    """The class of a message of ROS."""
    package, name = kind.split("/")
    try:
        found: type[Any] = getattr(import_module(f"{package}.msg"), name)
    except ImportError as cause:
        debian = f"python3-{package.replace('_', '-')}"
        raise SourceError(f"this needs {package} of ROS 1: apt install {debian}") from cause
    return found
