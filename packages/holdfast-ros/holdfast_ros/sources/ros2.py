"""Source of a ROS 2 topic, by Cyclone DDS. ROS 2 need not be installed."""

import os
import time
from collections import deque
from collections.abc import Mapping

from holdfast.devices.sources.base import Source
from holdfast.devices.uri import Address
from holdfast.errors import SourceError
from holdfast_ros import dds
from holdfast_ros.sensor_messages import SampleDecoder, known_definition
from holdfast_ros.sources.topic import ReceivedMessage, Subscription, TopicSource, topic_of

DISCOVERY_INTERVAL = 0.05
"""Time between two checks for the first publisher [s]."""
SUPPORTED_TYPES = "xela_server_ros2/SensStream, sensor_interfaces/SensorState"


def source(address: Address) -> Source:
    """Return the source of a URI; entering it subscribes.

    `ros2:///TOPIC`. Parameters: `domain=0` (by default that of `ROS_DOMAIN_ID`),
    `values=counts` or `values=calibrated`, `fingers=1:thumb,2:index`, `sensor=FILE.json`.

    Raises:
        ValueError: the address or a parameter is not valid.
    """
    address.only("domain", "values", "fingers", "sensor")
    domain = dds.domain_number(address.parameters.get("domain"))
    return TopicSource(address, Ros2Subscription(topic_of(address), domain))


def state() -> str:
    """Return the domain of ROS 2, for `holdfast doctor`."""
    return f"cyclonedds, domain {os.environ.get('ROS_DOMAIN_ID', '0')}"


class Ros2Subscription(Subscription):
    """Subscription to a ROS 2 topic.

    Args:
        topic: name of the topic, `/xServTopic`.
        domain: number of the ROS domain.
    """

    def __init__(self, topic: str, domain: int) -> None:
        super().__init__(topic, f"in ROS domain {domain}")
        self._domain = domain
        self._node: dds.Node | None = None
        self._reader: dds.TopicReader | None = None
        self._queue: deque[ReceivedMessage] = deque()

    def open(self, deadline: float) -> None:
        """Wait for a publisher, and subscribe with its type.

        Raises:
            SourceError: no node publishes, or the messages have an unsupported type.
        """
        self._node = dds.Node(self._domain)
        # DDS connects a reader only to publishers of the same type.
        while (kind := self.published_topics().get(self._topic)) is None:
            if time.monotonic() >= deadline:
                raise SourceError(self.why_no_message())
            time.sleep(DISCOVERY_INTERVAL)
        definition = known_definition(kind, ros2=True)
        if definition is None:
            raise SourceError(self.unsupported(kind, SUPPORTED_TYPES))
        self._decode = SampleDecoder(definition, ros2=True)
        self._reader = self._node.reader(self._topic, definition)

    def take(self, timeout: float) -> ReceivedMessage | None:
        """Return the next message, or None after `timeout` [s]."""
        if not self._queue and self._reader is not None:
            found = self._reader.take(timeout)
            received = time.monotonic()
            self._queue.extend(ReceivedMessage(data, received, self._decode) for data in found)
        return self._queue.popleft() if self._queue else None

    def n_publishers(self) -> int:
        """Return the current number of publishers."""
        return 0 if self._reader is None else self._reader.n_writers()

    def published_topics(self) -> Mapping[str, str]:
        """Return the types of all topics with a publisher, by name."""
        return {} if self._node is None else self._node.published_topics()

    def close(self) -> None:
        """End the subscription. It has no effect on one that is closed."""
        self._queue.clear()
        self._reader = None
        self._node = None
