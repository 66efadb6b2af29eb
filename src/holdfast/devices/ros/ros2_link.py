"""Connection to the topics of ROS 2, over DDS. ROS 2 need not be installed."""

from functools import partial

from holdfast.devices.ros import dds
from holdfast.devices.ros.link import Link, Publisher, TakeStates
from holdfast.errors import SourceError
from holdfast.ros.cdr import MessageDecoder, MessageEncoder
from holdfast.ros.topic_messages import JOINT_STATE, JointStates, topic_definition


class Ros2Link(Link):
    """Connection to a ROS domain.

    Args:
        domain: number of the domain as text; by default that of `ROS_DOMAIN_ID`.

    Raises:
        ValueError: there is no such domain.
    """

    def __init__(self, domain: str | None = None) -> None:
        self._domain = dds.domain_number(domain)
        self.where = f"in ROS domain {self._domain}"
        self._joined: dds.Node | None = None

    def open(self) -> None:
        """Join the domain.

        Raises:
            SourceError: DDS reports an error.
        """
        self._joined = dds.Node(self._domain)

    def publisher(self, topic: str, kind: str) -> Publisher:
        """Return a publisher of messages of a type on a topic."""
        definition = topic_definition(kind)
        write, encode = self._node.writer(topic, definition), MessageEncoder(definition)
        return Publisher(lambda message: write(encode(message)), write.n_readers)

    def joint_states(self, topic: str) -> TakeStates:
        """Subscribe to the joint states of a topic."""
        definition = topic_definition(JOINT_STATE)
        decode = MessageDecoder(definition, ros2=True)
        return partial(_take, topic, self._node.reader(topic, definition), decode)

    def n_other_publishers(self, topic: str) -> int:
        """Return the number of publishers on a topic, other than those of this link."""
        return self._node.n_other_writers(topic)

    def subscribed_topics(self) -> list[str]:
        """Return the names of all topics with a subscriber."""
        return sorted(self._node.subscribed_topics())

    def published_topics(self) -> list[str]:
        """Return the names of all topics with a publisher."""
        return sorted(self._node.published_topics())

    def close(self) -> None:
        """Leave the domain."""
        self._joined = None

    @property
    def _node(self) -> dds.Node:
        if self._joined is None:
            raise SourceError(f"the link {self.where} is not open")
        return self._joined


def _take(topic: str, reader: dds.TopicReader, decode: MessageDecoder) -> list[JointStates]:
    waiting: list[bytes] = []
    while found := reader.take(0.0):
        waiting += found
        if len(found) < dds.MAX_MESSAGES_PER_READ:
            break
    try:
        messages = [decode(data) for data in waiting]
    except ValueError as cause:
        raise SourceError(f"{topic} sends damaged joint states: {cause}") from cause
    return [JointStates.of_message(m["name"], m["position"], m["effort"]) for m in messages]
