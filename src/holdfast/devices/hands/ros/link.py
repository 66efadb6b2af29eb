"""Connection to the topics of a hand: what ROS 1 and ROS 2 share."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Protocol

from holdfast.openable import Openable
from holdfast.ros.hand_messages import JointStates


class Publisher(Protocol):
    """Function that publishes a message, given by its fields, and returns at once."""

    def __call__(self, message: Mapping[str, Any]) -> None:
        """Publish a message.

        Raises:
            HandError: ROS refuses it.
        """

    def n_listeners(self) -> int:
        """Return the number of subscribers."""


class StateReader(Protocol):
    """Subscription to the joint states of a hand."""

    def take(self) -> list[JointStates]:
        """Return the states since the last call, the oldest first.

        Raises:
            HandError: the message is damaged.
        """


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
            HandError: ROS cannot be reached.
        """

    @abstractmethod
    def publisher(self, topic: str, kind: str) -> Publisher:
        """Return a publisher of messages of a type on a topic."""

    @abstractmethod
    def joint_states(self, topic: str) -> StateReader:
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
