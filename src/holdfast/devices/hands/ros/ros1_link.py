"""Connection to the topics of a hand by ROS 1, with rospy."""

from collections import deque
from collections.abc import Mapping
from functools import partial
from typing import Any

from holdfast.devices.hands.ros.link import Link, Publisher, TakeStates, hand_errors
from holdfast.devices.ros import rospy_node
from holdfast.errors import HandError
from holdfast.ros.hand_messages import JOINT_STATE, JointStates

QUEUE_SIZE = 10
"""Messages that rospy keeps for a slow subscriber; the oldest is dropped first."""
STATE_QUEUE_SIZE = 256
"""Joint states that wait until they are read; the oldest is dropped first."""


class Ros1Link(Link):
    """Connection to a ROS master.

    Args:
        master: URI of the ROS master; by default `ROS_MASTER_URI`.

    Raises:
        ValueError: it is no URI.
    """

    def __init__(self, master: str | None) -> None:
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
            HandError: rospy is not installed, or the master does not answer.
        """
        with hand_errors():
            self._rospy = rospy_node.start_node(self._master)

    def publisher(self, topic: str, kind: str) -> Publisher:
        """Return a publisher of messages of a type on a topic."""
        made = self._rospy.Publisher(
            topic, self._type(kind), queue_size=QUEUE_SIZE, tcp_nodelay=True
        )
        self._registered.append(made)
        return Publisher(partial(self._publish, topic, made), made.get_num_connections)

    def joint_states(self, topic: str) -> TakeStates:
        """Subscribe to the joint states of a topic."""
        waiting: deque[Any] = deque(maxlen=STATE_QUEUE_SIZE)
        kind = self._type(JOINT_STATE)
        made = self._rospy.Subscriber(topic, kind, waiting.append, tcp_nodelay=True)
        self._registered.append(made)
        return partial(_take, waiting)

    def n_other_publishers(self, topic: str) -> int:
        """Return the number of publishers on a topic, other than those of this process."""
        mine = self._rospy.get_name()
        return sum(node != mine for node in self._ask(rospy_node.publishers_of, topic))

    def subscribed_topics(self) -> list[str]:
        """Return the names of all topics with a subscriber."""
        return sorted(self._ask(rospy_node.subscribed_topics))

    def published_topics(self) -> list[str]:
        """Return the names of all topics with a publisher."""
        return sorted(self._ask(rospy_node.published_topics))

    def close(self) -> None:
        """End the subscription and the publishers; the process stays a node."""
        registered, self._registered = self._registered, []
        for one in registered:
            one.unregister()

    def _publish(self, topic: str, publisher: Any, message: Mapping[str, Any]) -> None:  # noqa: ANN401
        made = publisher.data_class()
        for name, value in message.items():
            if name == "header":
                stamp = value["stamp"]
                made.header.stamp = self._rospy.Time(stamp["sec"], stamp["nanosec"])
            else:
                setattr(made, name, value)
        try:
            publisher.publish(made)
        except self._rospy.ROSException as cause:
            raise HandError(f"{topic}: ROS refuses a message ({cause})") from cause

    def _type(self, kind: str) -> type[Any]:
        with hand_errors():
            return rospy_node.message_type(kind)

    def _ask(self, function: Any, *given: str) -> Any:  # noqa: ANN401 (any answer)
        with hand_errors():
            return function(self._master, *given)


def _take(waiting: deque[Any]) -> list[JointStates]:
    messages = [waiting.popleft() for _ in range(len(waiting))]
    return [JointStates.of_message(m.name, m.position, m.effort) for m in messages]
