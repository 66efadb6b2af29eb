"""Connection to the topics of a hand: what ROS 1 and ROS 2 share."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from holdfast.errors import HandError, SourceError
from holdfast.openable import Openable
from holdfast.ros.hand_messages import JointStates


class Publisher(NamedTuple):
    """Publisher of messages on a topic.

    Attributes:
        publish: publishes a message, given by its fields, and returns at once.
        n_listeners: returns the number of subscribers.
    """

    publish: Callable[[Mapping[str, Any]], None]
    n_listeners: Callable[[], int]

    def __call__(self, message: Mapping[str, Any]) -> None:
        """Publish a message.

        Raises:
            HandError: ROS refuses it.
        """
        with hand_errors():
            self.publish(message)


TakeStates = Callable[[], list[JointStates]]
"""Function that returns the joint states of a hand since its last call, the oldest first. It
raises a `HandError` if a message is damaged."""


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


@contextmanager
def hand_errors() -> Iterator[None]:
    """Turn an error of ROS into one of the hand.

    Raises:
        HandError: the block raised a `SourceError`.
    """
    try:
        yield
    except SourceError as cause:
        raise HandError(str(cause)) from cause
