"""Publish estimates on ROS 2 topics, with Cyclone DDS; no ROS installation is needed."""

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from holdfast.devices.ros import dds
from holdfast.live.publishers.ros_publisher import (
    DIAGNOSTICS,
    FLOAT,
    STRING,
    VECTOR,
    WRENCH,
    DiagnosticStatus,
    RosPublisher,
)
from holdfast.ros.cdr import MessageEncoder
from holdfast.ros.definitions import parse_definition
from holdfast.sensors.types import Unit

if TYPE_CHECKING:
    from holdfast.live.loop.live_grip import LiveGrip

_LINE = "\n=====\nMSG: "
_HEADER = (
    _LINE
    + "std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
    + _LINE
    + "builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
)
_XYZ = _LINE + "geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"

DEFINITIONS = {
    STRING: "string data",
    FLOAT: "float64 data",
    VECTOR: "std_msgs/Header header\nVector3 vector" + _HEADER + _XYZ,
    WRENCH: (
        "std_msgs/Header header\nWrench wrench"
        + _HEADER
        + _LINE
        + "geometry_msgs/Wrench\nVector3 force\nVector3 torque"
        + _XYZ
    ),
    DIAGNOSTICS: (
        "std_msgs/Header header\nDiagnosticStatus[] status"
        + _HEADER
        + _LINE
        + "diagnostic_msgs/DiagnosticStatus\nbyte level\nstring name\nstring message\n"
        + "string hardware_id\nKeyValue[] values"
        + _LINE
        + "diagnostic_msgs/KeyValue\nstring key\nstring value"
    ),
}
"""Message definitions of ROS 2, by message type."""

NO_TORQUE = {"x": 0.0, "y": 0.0, "z": 0.0}


class Ros2Publisher(RosPublisher):
    """Publish estimates on ROS 2 topics.

    Args:
        units: of the readings, by finger.
        namespace: prefix of the topics.
        domain: ROS domain; by default `ROS_DOMAIN_ID`.
        grip: the loop that controls the hand; None if there is none.

    Raises:
        ValueError: as `RosPublisher`, or the domain does not exist.
    """

    def __init__(
        self,
        units: Mapping[str, Unit],
        namespace: str = "/holdfast",
        domain: int | None = None,
        grip: "LiveGrip | None" = None,
    ) -> None:
        super().__init__(units, namespace, grip)
        self._domain = dds.domain_number(None if domain is None else str(domain))
        self._node: dds.Node | None = None
        self._writers: dict[str, Callable[[Mapping[str, Any]], None]] = {}

    def _connect(self, topics: Mapping[str, str]) -> None:
        self._node = node = dds.Node(self._domain)
        self._writers = {topic: _writer(node, topic, kind) for topic, kind in topics.items()}

    def _disconnect(self) -> None:
        self._writers.clear()
        self._node = None

    def _publish_text(self, topic: str, text: str) -> None:
        self._writers[topic]({"data": text})

    def _publish_number(self, topic: str, number: float) -> None:
        self._writers[topic]({"data": number})

    def _publish_force(
        self,
        topic: str,
        stamp: float,
        finger: str,
        force: tuple[float, float, float],
        *,
        newtons: bool,
    ) -> None:
        vector = dict(zip("xyz", force, strict=True))
        message: dict[str, Any] = {"header": _header(stamp, finger), "vector": vector}
        if newtons:
            message["wrench"] = {"force": vector, "torque": NO_TORQUE}
        self._writers[topic](message)

    def _publish_diagnostics(self, stamp: float, statuses: Iterable[DiagnosticStatus]) -> None:
        found = [
            {
                "level": status.level,
                "name": f"holdfast: {status.name}",
                "message": status.message,
                "hardware_id": "holdfast",
                "values": [{"key": key, "value": value} for key, value in status.values],
            }
            for status in statuses
        ]
        self._writers["/diagnostics"]({"header": _header(stamp, ""), "status": found})


def _writer(node: dds.Node, topic: str, kind: str) -> Callable[[Mapping[str, Any]], None]:
    definition = parse_definition(kind, DEFINITIONS[kind])
    write, encode = node.writer(topic, definition), MessageEncoder(definition)
    return lambda message: write(encode(message))


def _header(stamp: float, frame: str) -> dict[str, Any]:
    seconds = int(stamp)
    nanoseconds = int((stamp - seconds) * 1e9)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame}
