"""A ROS 1 topic as a source: by rospy, whatever the definition of its messages."""

import time
from collections import deque
from collections.abc import Callable
from threading import Condition
from types import ModuleType
from typing import Any

from holdfast.errors import SourceError
from holdfast.ros import rospy_node
from holdfast.ros.definitions import parse_definition
from holdfast.ros.sensor_messages import SUPPORTED_MESSAGES, DeviceSample, SampleDecoder
from holdfast.sources.base import Source
from holdfast.sources.ros.topic import PATIENCE, Link, Packet, Stranger, TopicSource, topic_of
from holdfast.sources.uri import Address

N_QUEUED = 256
"""Messages that wait for a reader that is busy; then it misses the oldest."""
LARGEST = 1 << 20
"""Bytes that are read from a socket at a time; less than a message makes rospy lag behind."""


def source(address: Address) -> Source:
    """The source at a URI; entering it subscribes.

    `ros1:///TOPIC`. Parameters: `master=http://127.0.0.1:11311` (by default that of
    `ROS_MASTER_URI`), `values=counts` or `values=calibrated`, `fingers=1:thumb,2:index`,
    `sensor=FILE.json`.

    Raises:
        ValueError: the address or a parameter is not of that form.
        OSError: the sensor's file cannot be read.
    """
    address.only("master", "values", "fingers", "sensor")
    master = rospy_node.master_uri(address.parameters.get("master"))
    return TopicSource(address, Ros1Link(topic_of(address), master))


class Ros1Link(Link):
    """A subscription to a ROS 1 topic.

    Args:
        topic: its name, `/xServTopic`.
        master: URI of the ROS master.
    """

    def __init__(self, topic: str, master: str) -> None:
        self._topic = topic
        self._master = master
        self._rospy: ModuleType | None = None
        self._subscriber: Any = None
        self._waiting: deque[tuple[Any, float]] = deque()
        self._came = Condition()
        self._n_dropped = 0
        self._unpackers: dict[tuple[str, str], Callable[[bytes], list[DeviceSample]]] = {}

    def open(self, deadline: float) -> None:
        """Subscribes.

        Raises:
            SourceError: there is no rospy, or no master.
        """
        self._rospy = rospy_node.start_node(self._master)
        self._subscribe()

    def take(self, timeout: float) -> Packet | None:
        """The next message, or None where none came within `timeout` [s]."""
        with self._came:
            if not self._came.wait_for(lambda: self._waiting, timeout):
                return None
            message, received = self._waiting.popleft()
        return Packet(message._buff, received, self._unpacker(message._connection_header))

    def n_publishers(self) -> int:
        """How many publish on the topic now."""
        return 0 if self._subscriber is None else self._subscriber.get_num_connections()

    def n_dropped(self) -> int:
        """Messages that were not taken in time, since the last call."""
        with self._came:
            n_dropped, self._n_dropped = self._n_dropped, 0
        return n_dropped

    def missing(self) -> str:
        """What to tell where no message comes: who publishes, which topics there are."""
        there = rospy_node.published_topics(self._master)
        if self._topic in there:
            return f"{self._topic} has a publisher, but no samples came in {PATIENCE:g} s"
        others = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(there.items()))
        return (
            f"nobody publishes {self._topic} at the ROS master {self._master}; there are "
            f"{others or 'no topics at all'}"
        )

    def mend(self) -> None:
        """Subscribes anew: a master that was started again does not know us."""
        try:
            rospy_node.check_master(self._master)
        except SourceError:
            return
        self._unsubscribe()
        self._subscribe()

    def close(self) -> None:
        """Ends the subscription; again, it does nothing."""
        self._unsubscribe()
        with self._came:
            self._waiting.clear()

    def _subscribe(self) -> None:
        rospy = self._rospy
        if rospy is not None:
            self._subscriber = rospy.Subscriber(
                self._topic, rospy.AnyMsg, self._put, buff_size=LARGEST, tcp_nodelay=True
            )

    def _unsubscribe(self) -> None:
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None:
            subscriber.unregister()

    def _put(self, message: Any) -> None:  # noqa: ANN401 (rospy.AnyMsg), in a thread of rospy
        received = time.monotonic()
        with self._came:
            if len(self._waiting) == N_QUEUED:
                self._waiting.popleft()
                self._n_dropped += 1
            self._waiting.append((message, received))
            self._came.notify()

    def _unpacker(self, header: dict[str, str]) -> Callable[[bytes], list[DeviceSample]]:
        """By the definition that the publisher sent ahead."""
        kind, text = header.get("type", ""), header.get("message_definition", "")
        if (kind, text) not in self._unpackers:
            self._unpackers[kind, text] = self._new_unpacker(kind, text)
        return self._unpackers[kind, text]

    def _new_unpacker(self, kind: str, text: str) -> Callable[[bytes], list[DeviceSample]]:
        try:
            return SampleDecoder(parse_definition(kind, text), ros2=False)
        except ValueError:
            what = (
                f"{self._topic} has {kind}, in which holdfast knows no samples; it takes "
                f"{SUPPORTED_MESSAGES}"
            )

            def refuse(_: bytes) -> list[DeviceSample]:
                raise Stranger(what)

            return refuse
