"""Connection to the topics of ROS 1, with rospy."""

from collections import deque
from collections.abc import Mapping
from functools import partial
from typing import Any

from holdfast.devices.ros import rospy_node
from holdfast.devices.ros.link import Link, Publisher, TakeStates
from holdfast.errors import SourceError
from holdfast.ros.definitions import Definition
from holdfast.ros.topic_messages import JOINT_STATE, JointStates, topic_definition

QUEUE_SIZE = 10
"""Messages that rospy keeps for a slow subscriber; the oldest is dropped first."""
STAMP = "builtin_interfaces/Time"
"""Type of a time in ROS 2, by whose definitions messages are filled."""
STATE_QUEUE_SIZE = 256
"""Joint states that wait until they are read; the oldest is dropped first."""


class Ros1Link(Link):
    """Connection to a ROS master.

    Args:
        master: URI of the ROS master; by default `ROS_MASTER_URI`.

    Raises:
        ValueError: it is no URI.
    """

    def __init__(self, master: str | None = None) -> None:
        self._master = rospy_node.master_uri(master)
        self.where = f"at the ROS master {self._master}"
        self._rospy: Any = None
        self._registered: list[Any] = []

    @property
    def network(self) -> str:
        """Name of the network: the master, with one name for this machine."""
        return f"at the ROS master {rospy_node.master_address(self._master)}"

    def open(self) -> None:
        """Make this process a node.

        Raises:
            SourceError: rospy is not installed, or the master does not answer.
        """
        self._rospy = rospy_node.start_node(self._master)

    def publisher(self, topic: str, kind: str) -> Publisher:
        """Return a publisher of messages of a type on a topic."""
        publisher = self._rospy.Publisher(
            topic, rospy_node.message_type(kind), queue_size=QUEUE_SIZE, tcp_nodelay=True
        )
        self._registered.append(publisher)
        publish = partial(self._publish, topic, publisher, topic_definition(kind))
        return Publisher(publish, publisher.get_num_connections)

    def joint_states(self, topic: str) -> TakeStates:
        """Subscribe to the joint states of a topic."""
        waiting: deque[Any] = deque(maxlen=STATE_QUEUE_SIZE)
        kind = rospy_node.message_type(JOINT_STATE)
        subscriber = self._rospy.Subscriber(topic, kind, waiting.append, tcp_nodelay=True)
        self._registered.append(subscriber)
        return partial(_take, waiting)

    def n_other_publishers(self, topic: str) -> int:
        """Return the number of publishers on a topic, other than those of this process."""
        mine = self._rospy.get_name()
        return sum(node != mine for node in rospy_node.publishers_of(self._master, topic))

    def subscribed_topics(self) -> list[str]:
        """Return the names of all topics with a subscriber."""
        return sorted(rospy_node.subscribed_topics(self._master))

    def published_topics(self) -> list[str]:
        """Return the names of all topics with a publisher."""
        return sorted(rospy_node.published_topics(self._master))

    def close(self) -> None:
        """End the subscription and the publishers; the process stays a node."""
        registered, self._registered = self._registered, []
        for topic in registered:
            topic.unregister()

    def _publish(
        self,
        topic: str,
        publisher: Any,  # noqa: ANN401 (rospy.Publisher)
        definition: Definition,
        fields: Mapping[str, Any],
    ) -> None:
        message = publisher.data_class()
        self._fill(message, definition, definition.name, fields)
        try:
            publisher.publish(message)
        except self._rospy.ROSException as cause:
            raise SourceError(f"{topic}: ROS refuses a message ({cause})") from cause

    def _fill(
        self,
        message: Any,  # noqa: ANN401 (of any type)
        definition: Definition,
        kind: str,
        fields: Mapping[str, Any],
    ) -> None:
        """Set the fields of a message, also those of the messages inside it."""
        for field in definition.types[kind]:
            value = fields[field.name]
            if field.kind == STAMP:
                setattr(message, field.name, self._rospy.Time(value["sec"], value["nanosec"]))
            elif field.kind not in definition.types:
                setattr(message, field.name, value)
            elif field.size is None:
                self._fill(getattr(message, field.name), definition, field.kind, value)
            else:
                parts = [rospy_node.message_type(field.kind)() for _ in value]
                for part, part_fields in zip(parts, value, strict=True):
                    self._fill(part, definition, field.kind, part_fields)
                setattr(message, field.name, parts)


def _take(waiting: deque[Any]) -> list[JointStates]:
    messages = [waiting.popleft() for _ in range(len(waiting))]
    return [JointStates.of_message(m.name, m.position, m.effort) for m in messages]
