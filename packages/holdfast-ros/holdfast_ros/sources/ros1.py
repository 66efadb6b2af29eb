"""Source of a ROS 1 topic, by rospy. Any definition of a supported message is accepted."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from io import BytesIO
from operator import attrgetter
from threading import Condition
from types import ModuleType
from typing import Any

from holdfast.devices.sources.base import Source
from holdfast.devices.uri import Address
from holdfast.errors import SourceError
from holdfast.io.definitions import parse_definition
from holdfast_ros import rospy_node
from holdfast_ros.sensor_messages import (
    SUPPORTED_MESSAGES,
    DeviceSample,
    SampleDecoder,
    known_definition,
)
from holdfast_ros.sources.topic import (
    ReceivedMessage,
    Subscription,
    TopicSource,
    UnsupportedMessage,
    topic_of,
)

PARAMETERS = ("master", "values", "fingers", "sensor")
"""Names of the parameters of the URI."""
MAX_QUEUED_MESSAGES = 256
"""Messages that wait for a busy reader; after that, the oldest ones are dropped."""
MAX_DECODERS = 64
"""Definitions of messages that are kept; of more, the oldest is parsed again when it comes."""
SOCKET_READ_SIZE = 1 << 20
"""Bytes to read from a socket at a time. If a message is longer, rospy lags behind."""

CONNECTION_HEADER = "_connection_header"
"""Attribute of a message of rospy: the header of its publisher, with type and definition. rospy
has no public name for it; without it, the ROS master gives the type."""

Decode = Callable[[bytes], list[DeviceSample]]


def source(address: Address) -> Source:
    """Return the source of a URI; entering it subscribes.

    `ros1:///TOPIC`. Parameters: `master=http://127.0.0.1:11311` (by default that of
    `ROS_MASTER_URI`), `values=counts` or `values=calibrated`, `fingers=1:thumb,2:index`,
    `sensor=FILE.json`.

    Raises:
        ValueError: the address or a parameter is not valid.
    """
    address.only(*PARAMETERS)
    master = rospy_node.master_uri(address.parameters.get("master"))
    return TopicSource(address, Ros1Subscription(topic_of(address), master))


def state() -> str:
    """Return whether rospy is installed and the ROS master answers, for `holdfast doctor`."""
    try:
        rospy_node.rospy_module()
        rospy_node.check_master(master := rospy_node.master_uri(None))
    except (SourceError, ValueError) as error:  # ValueError: ROS_MASTER_URI is invalid
        return str(error)
    return f"rospy is installed; ROS master at {master}"


class Ros1Subscription(Subscription):
    """Subscription to a ROS 1 topic.

    Args:
        topic: name of the topic, `/xServTopic`.
        master: URI of the ROS master.
    """

    def __init__(self, topic: str, master: str) -> None:
        super().__init__(topic, f"at the ROS master {master}")
        self._master = master
        self._rospy: ModuleType | None = None
        self._header_of: Callable[[Any], Mapping[str, str]] = attrgetter(CONNECTION_HEADER)
        self._kind = ""
        self._subscriber: Any = None
        self._queue: deque[tuple[Any, float]] = deque()
        self._queue_changed = Condition()
        self._n_dropped = 0
        self._decoders: dict[tuple[str, str | None], Decode] = {}

    def open(self, deadline: float) -> None:
        """Subscribe.

        Raises:
            SourceError: rospy is not installed, or there is no master.
        """
        self._rospy = rospy_node.start_node(self._master)
        if not hasattr(self._rospy.AnyMsg, CONNECTION_HEADER):
            self._header_of = self._header_by_master
        self._subscribe()

    def take(self, timeout: float) -> ReceivedMessage | None:
        """Return the next message, or None after `timeout` [s]."""
        with self._queue_changed:
            if not self._queue_changed.wait_for(lambda: self._queue, timeout):
                return None
            message, received = self._queue.popleft()
        data = BytesIO()
        message.serialize(data)
        return ReceivedMessage(data.getvalue(), received, self._decoder(self._header_of(message)))

    def n_publishers(self) -> int:
        """Return the current number of publishers."""
        return 0 if self._subscriber is None else self._subscriber.get_num_connections()

    def n_dropped(self) -> int:
        """Return the number of messages dropped since the last call, due to a slow reader."""
        with self._queue_changed:
            n_dropped, self._n_dropped = self._n_dropped, 0
        return n_dropped

    def published_topics(self) -> Mapping[str, str]:
        """Return the types of all topics with a publisher, by name."""
        return rospy_node.published_topics(self._master)

    def renew(self) -> None:
        """Subscribe again: a restarted master does not have the subscription."""
        try:
            rospy_node.check_master(self._master)
        except SourceError:
            return
        self._unsubscribe()
        self._subscribe()

    def close(self) -> None:
        """End the subscription. It has no effect on one that is closed."""
        self._unsubscribe()
        with self._queue_changed:
            self._queue.clear()

    def _subscribe(self) -> None:
        rospy = self._rospy
        if rospy is not None:
            self._subscriber = rospy.Subscriber(
                self._topic, rospy.AnyMsg, self._put, buff_size=SOCKET_READ_SIZE, tcp_nodelay=True
            )

    def _unsubscribe(self) -> None:
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None:
            subscriber.unregister()

    def _put(self, message: Any) -> None:  # noqa: ANN401 (rospy.AnyMsg), in a thread of rospy
        # Before the lock, for which it may wait.
        received = time.monotonic()
        with self._queue_changed:
            if len(self._queue) == MAX_QUEUED_MESSAGES:
                self._queue.popleft()
                self._n_dropped += 1
            self._queue.append((message, received))
            self._queue_changed.notify()

    def _header_by_master(self, message: Any) -> Mapping[str, str]:  # noqa: ANN401
        """Return the type of the topic, which the ROS master has, in place of a header."""
        if not self._kind:
            self._kind = self.published_topics().get(self._topic, "")
        return {"type": self._kind}

    def _decoder(self, header: Mapping[str, str]) -> Decode:
        """Return the decoder of the definition that the publisher sent in its header.

        A header without one gives the known definition of its type.
        """
        kind, text = header.get("type", ""), header.get("message_definition")
        if (kind, text) not in self._decoders:
            if len(self._decoders) == MAX_DECODERS:
                del self._decoders[next(iter(self._decoders))]
            decode: Decode
            try:
                known = known_definition(kind, ros2=False) if text is None else None
                decode = SampleDecoder(known or parse_definition(kind, text or ""), ros2=False)
            except ValueError:
                message = self.unsupported(kind, SUPPORTED_MESSAGES)

                def decode(_: bytes) -> list[DeviceSample]:
                    raise UnsupportedMessage(message)

            self._decoders[kind, text] = decode
        return self._decoders[kind, text]
