"""Connection to ROS, the same for ROS 1 and ROS 2: publishers, and joint states of hands."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from holdfast.openable import Openable
from holdfast_ros.topic_messages import JointStates


class Publisher(NamedTuple):
    """Publisher of messages on a topic.

    Attributes:
        publish: publishes a message, given by its fields, and returns at once; it raises a
            `SourceError` if ROS refuses the message.
        n_listeners: returns the number of subscribers.
    """

    publish: Callable[[Mapping[str, Any]], None]
    n_listeners: Callable[[], int]


TakeStates = Callable[[], list[JointStates]]
"""Function that returns the joint states of a hand since its last call, the oldest first. It
raises a `SourceError` if a message is damaged."""


class Link(Openable):
    """Connection to ROS.

    Attributes:
        where: part of the messages: "in ROS domain 0".
    """

    where: str = ""

    @property
    def network(self) -> str:
        """Name of the network; the same for all ways in which it can be given."""
        return self.where

    @abstractmethod
    def open(self) -> None:
        """Join ROS.

        Raises:
            SourceError: ROS cannot be reached.
        """

    @abstractmethod
    def publisher(self, topic: str, kind: str) -> Publisher:
        """Return a publisher of messages of a type on a topic."""

    @abstractmethod
    def joint_states(self, topic: str) -> TakeStates:
        """Subscribe to the joint states of a topic."""

    @abstractmethod
    def n_other_publishers(self, topic: str) -> int:
        """Return the number of publishers on a topic, other than those of this link."""

    @abstractmethod
    def subscribed_topics(self) -> list[str]:
        """Return the names of all topics with a subscriber."""

    @abstractmethod
    def published_topics(self) -> list[str]:
        """Return the names of all topics with a publisher."""
