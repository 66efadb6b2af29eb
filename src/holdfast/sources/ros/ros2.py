"""A ROS 2 topic as a source: by Cyclone DDS, with or without ROS 2 on this machine."""

import time
from collections import deque

from holdfast.errors import SourceError
from holdfast.ros import dds
from holdfast.ros.sensor_messages import SampleDecoder, known_definition
from holdfast.sources.base import Source
from holdfast.sources.ros.topic import PATIENCE, Link, Packet, TopicSource, topic_of
from holdfast.sources.uri import Address

LOOK = 0.05
"""How often who publishes is looked at, while a publisher is waited for [s]."""


def source(address: Address) -> Source:
    """The source at a URI; entering it subscribes.

    `ros2:///TOPIC`. Parameters: `domain=0` (by default that of `ROS_DOMAIN_ID`),
    `values=counts` or `values=calibrated`, `fingers=1:thumb,2:index`, `sensor=FILE.json`.

    Raises:
        ValueError: the address or a parameter is not of that form.
        OSError: the sensor's file cannot be read.
    """
    address.only("domain", "values", "fingers", "sensor")
    domain = dds.domain_number(address.parameters.get("domain"))
    return TopicSource(address, Ros2Link(topic_of(address), domain))


class Ros2Link(Link):
    """A subscription to a ROS 2 topic.

    Args:
        topic: its name, `/xServTopic`.
        domain: of ROS.
    """

    def __init__(self, topic: str, domain: int) -> None:
        self._topic = topic
        self._domain = domain
        self._node: dds.Node | None = None
        self._reader: dds.TopicReader | None = None
        self._waiting: deque[Packet] = deque()

    def open(self, deadline: float) -> None:
        """Waits for a publisher, whose type it takes, and subscribes.

        Raises:
            SourceError: nobody publishes, or messages of another type.
        """
        self._node = dds.Node(self._domain)
        kind = self._kind(self._node, deadline)
        definition = known_definition(kind, ros2=True)
        if definition is None:
            raise SourceError(
                f"{self._topic} has {kind}, in which holdfast knows no samples; it takes "
                "xela_server_ros2/SensStream and sensor_interfaces/SensorState"
            )
        self._unpack = SampleDecoder(definition, ros2=True)
        self._reader = self._node.reader(self._topic, definition)

    def take(self, timeout: float) -> Packet | None:
        """The next message, or None where none came within `timeout` [s]."""
        if not self._waiting and self._reader is not None:
            found = self._reader.take(timeout)
            received = time.monotonic()
            self._waiting.extend(Packet(data, received, self._unpack) for data in found)
        return self._waiting.popleft() if self._waiting else None

    def n_publishers(self) -> int:
        """How many publish on the topic now."""
        return 0 if self._reader is None else self._reader.n_writers()

    def missing(self) -> str:
        """What to tell where no message comes: who publishes, which topics there are."""
        there = {} if self._node is None else self._node.published_topics()
        if self._topic in there:
            return f"{self._topic} has a publisher, but no samples came in {PATIENCE:g} s"
        others = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(there.items()))
        return (
            f"nobody publishes {self._topic} in ROS domain {self._domain}; there are "
            f"{others or 'no topics at all'}"
        )

    def close(self) -> None:
        """Ends the subscription; again, it does nothing."""
        self._waiting.clear()
        self._reader = None
        self._node = None

    def _kind(self, node: dds.Node, deadline: float) -> str:
        """The type of the messages, as the first publisher tells it."""
        while (kind := node.published_topics().get(self._topic)) is None:
            if time.monotonic() >= deadline:
                raise SourceError(self.missing())
            time.sleep(LOOK)
        return kind
