"""Source of a ROS topic, the same for ROS 1 and ROS 2."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import NamedTuple

from holdfast.devices.sources.base import DeviceSource
from holdfast.devices.uri import Address
from holdfast.errors import SourceError
from holdfast.sensors.types import Unit
from holdfast_ros.sensor_messages import DeviceSample
from holdfast_ros.sources.message_assembler import MessageAssembler, has_taxels

TOPIC_OPEN_TIMEOUT = 5.0
"""Longest wait for the first message with samples [s]."""
DEVICES_TIMEOUT = 1.0
"""Longest wait for the other devices of a topic, if each message has one device [s]."""
TOPIC_SILENCE_TIMEOUT = 1.0
"""A topic without a new sample for this time is silent [s]."""
PUBLISHER_CHECK_INTERVAL = 0.5
"""Time between two checks for publishers while no message arrives [s]."""


class UnsupportedMessage(ValueError):  # noqa: N818 (it is not an error of the program)
    """A message has a type without known samples. The text names the type."""


class ReceivedMessage(NamedTuple):
    """Message of a topic.

    Attributes:
        data: its bytes.
        received: time of arrival, by `time.monotonic` [s].
        decode: returns the samples in the bytes; raises a `ValueError` if they are not valid.
    """

    data: bytes
    received: float
    decode: Callable[[bytes], list[DeviceSample]]


class Subscription(ABC):
    """Subscription to one topic.

    Args:
        topic: name of the topic, `/xServTopic`.
        network: where the topic is, for messages: "in ROS domain 0".
    """

    def __init__(self, topic: str, network: str) -> None:
        self._topic = topic
        self._network = network

    @abstractmethod
    def open(self, deadline: float) -> None:
        """Subscribe, with waits only until `deadline`, by `time.monotonic` [s].

        Raises:
            SourceError: ROS cannot be reached, or the messages have an unsupported type.
        """

    @abstractmethod
    def take(self, timeout: float) -> ReceivedMessage | None:
        """Return the next message, or None after `timeout` [s]."""

    @abstractmethod
    def n_publishers(self) -> int:
        """Return the current number of publishers."""

    @abstractmethod
    def published_topics(self) -> Mapping[str, str]:
        """Return the types of all topics with a publisher, by name."""

    @abstractmethod
    def close(self) -> None:
        """End the subscription. It has no effect on one that is closed."""

    def renew(self) -> None:  # noqa: B027 (some subscriptions renew themselves)
        """Subscribe again, if that can help when there is no publisher."""

    def n_dropped(self) -> int:
        """Return the number of messages dropped since the last call, due to a slow reader."""
        return 0

    def why_no_message(self) -> str:
        """Return a message about a topic without samples, with the topics that exist."""
        topics = self.published_topics()
        if self._topic in topics:
            return f"{self._topic} has a publisher, but no samples came in {TOPIC_OPEN_TIMEOUT:g} s"
        others = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(topics.items()))
        return (
            f"no node publishes {self._topic} {self._network}; published topics: {others or 'none'}"
        )

    def unsupported(self, kind: str, supported: str) -> str:
        """Return a message about a topic of an unsupported type."""
        return f"{self._topic} has messages of type {kind}; supported types: {supported}"


class TopicSource(DeviceSource):
    """Source of the sensors of one topic. A topic without publishers is a lost connection.

    Args:
        address: `ros2:///TOPIC`, with `values`, `fingers` and `sensor` as for XELA's server.
        subscription: subscription to the topic.
    """

    silence_timeout = TOPIC_SILENCE_TIMEOUT

    def __init__(self, address: Address, subscription: Subscription) -> None:
        super().__init__()
        self.name = address.text
        self._subscription = subscription
        unit: Unit = "N" if address.calibrated() else "count"
        self._options = (address.names(), unit, address.sensor())
        self._assembler = MessageAssembler(*self._options)
        self._checked_at = 0.0

    def open(self) -> None:
        """Subscribe, and wait until the modules are known.

        Raises:
            SourceError: ROS cannot be reached, no node publishes, or other data than expected.
        """
        self.close()
        self._assembler = MessageAssembler(*self._options)
        deadline = time.monotonic() + TOPIC_OPEN_TIMEOUT
        self._subscription.open(deadline)
        messages, samples = self._first_messages(deadline)
        self._assembler.identify(samples)
        self.sensors = self._assembler.sensors
        self.metadata = {"source": self.name, **self._assembler.metadata}
        now = self._checked_at = time.monotonic()
        self.begin_reading(now)
        notices = [text for device in self._assembler.devices.values() for text in device.notices]
        if notices:
            self.notify(now, *notices)
        # The messages that identified the devices have samples, too.
        for message in messages:
            self._assemble(message)
        self.note_clock()

    def _first_messages(self, deadline: float) -> tuple[list[ReceivedMessage], list[DeviceSample]]:
        """Return the first messages, until a device repeats, and the first sample of each."""
        messages: list[ReceivedMessage] = []
        found: dict[int | None, DeviceSample] = {}
        invalid: ValueError | None = None
        while (left := deadline - time.monotonic()) > 0:
            message = self._subscription.take(left)
            if message is None:
                continue
            try:
                samples = [one for one in message.decode(message.data) if has_taxels(one)]
            except UnsupportedMessage as why:
                raise SourceError(str(why)) from why
            except ValueError as why:
                invalid = why
                continue
            messages.append(message)
            # A device that comes again has come after all others.
            if any(sample.number in found for sample in samples):
                break
            if samples and not found:
                deadline = min(deadline, time.monotonic() + DEVICES_TIMEOUT)
            found.update((sample.number, sample) for sample in samples)
        if found:
            return messages, list(found.values())
        if invalid is not None:
            raise SourceError(f"{self.name} sends invalid messages: {invalid}") from invalid
        raise SourceError(self._subscription.why_no_message())

    def receive(self, timeout: float) -> bool:
        """Process what the device sends within `timeout` [s]; return False if nothing came."""
        message = self._subscription.take(min(timeout, PUBLISHER_CHECK_INTERVAL))
        if n_dropped := self._subscription.n_dropped():
            text = f"{n_dropped} messages dropped: they were read too slowly"
            self.notify(time.monotonic(), text)
        if message is not None:
            self._assemble(message)
            return True
        now = time.monotonic()
        if now - self._checked_at >= PUBLISHER_CHECK_INTERVAL:
            self._checked_at = now
            if not self._subscription.n_publishers():
                self.lose("the topic has no publisher")
        return False

    def _assemble(self, message: ReceivedMessage) -> None:
        received = message.received
        try:
            arrivals = self._assembler.assemble(message.decode(message.data), received)
        except ValueError as why:
            arrivals = self._assembler.refuse(str(why), received)
        self.queue(arrivals, received)

    def pause(self, seconds: float) -> None:
        """Wait for a message of a new publisher."""
        message = self._subscription.take(seconds)
        if message is not None or self._subscription.n_publishers():
            self.resume()
        if message is not None:
            self._assemble(message)

    def reconnect(self) -> bool:
        """Try to connect again; return whether the device is connected."""
        self._subscription.renew()
        return self._subscription.n_publishers() > 0

    def resume(self) -> None:
        """Report that the device is connected again, and accept new numbers of its messages."""
        self._assembler.reconnected()
        super().resume()

    def disconnect(self) -> None:
        """Close the connection, if there is one."""
        self._subscription.close()


def topic_of(address: Address) -> str:
    """Return the topic of a URI: `/xServTopic` for `ros2:///xServTopic`.

    Raises:
        ValueError: the URI has a host, or no topic.
    """
    topic = address.path.rstrip("/")
    if address.host or not topic.startswith("/") or len(topic) < 2:
        scheme = address.text.split(":", maxsplit=1)[0]
        raise ValueError(
            f"{address.text}: {scheme}:///TOPIC expected, as in {scheme}:///xServTopic"
        )
    return topic
