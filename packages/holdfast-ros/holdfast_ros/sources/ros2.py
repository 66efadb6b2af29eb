"""Source of a ROS 2 topic, by Cyclone DDS. ROS 2 need not be installed."""

import os
import time
from collections import deque
from typing import NamedTuple

from holdfast.devices.sources.base import DeviceSource, Source
from holdfast.devices.uri import Address
from holdfast.errors import SourceError
from holdfast.files import read_input
from holdfast.sensors.types import Unit
from holdfast_ros import dds
from holdfast_ros.sensor_messages import (
    DeviceSample,
    SampleDecoder,
    known_definition,
    own_definition,
)
from holdfast_ros.sources.message_assembler import MessageAssembler, has_taxels

DISCOVERY_INTERVAL = 0.05
"""Time between two checks for the first publisher [s]."""
SUPPORTED_TYPES = (
    "xela_server_ros2/SensStream, sensor_interfaces/SensorState, paxini_hardware/TactileSensor, "
    "paxini_pkg/SensingData; give others of a pad by ?definition=FILE.msg"
)
MAX_DEFINITION_SIZE = 2**16
"""Maximum size of the file of a definition [bytes]."""
TOPIC_OPEN_TIMEOUT = 5.0
"""Longest wait for the first message with samples [s]."""
DEVICES_TIMEOUT = 1.0
"""Longest wait for the other devices of a topic, if each message has one device [s]."""
TOPIC_SILENCE_TIMEOUT = 1.0
"""A topic without a new sample for this time is silent [s]."""
PUBLISHER_CHECK_INTERVAL = 0.5
"""Time between two checks for publishers while no message arrives [s]."""


def source(address: Address) -> Source:
    """Return the source of a URI; entering it subscribes.

    `ros2:///TOPIC`. Parameters: `domain=0` (by default that of `ROS_DOMAIN_ID`),
    `values=counts` or `values=calibrated`, `fingers=1:thumb,2:index`, `sensor=FILE.json`, and
    `definition=FILE.msg` of a message type of pads that is not known here.

    Raises:
        ValueError: the address or a parameter is not valid.
    """
    address.only("domain", "values", "fingers", "sensor", "definition")
    domain, text = dds.domain_number(address.parameters.get("domain")), ""
    if path := address.parameters.get("definition"):
        try:
            text = read_input(path, MAX_DEFINITION_SIZE).decode()
        except (OSError, ValueError) as cause:
            raise ValueError(f"{address.text}: cannot read {path}: {cause}") from cause
    return TopicSource(address, Subscription(topic_of(address), domain, text))


def state() -> str:
    """Return the domain of ROS 2, for `holdfast doctor`."""
    return f"cyclonedds, domain {os.environ.get('ROS_DOMAIN_ID', '0')}"


class ReceivedMessage(NamedTuple):
    """Message of a topic.

    Attributes:
        data: its bytes.
        received: time of arrival, by `time.monotonic` [s].
    """

    data: bytes
    received: float


class Subscription:
    """Subscription to a ROS 2 topic.

    Args:
        topic: name of the topic, `/xServTopic`.
        domain: number of the ROS domain.
        definition: definition of its messages; empty for those that are known.

    Attributes:
        note: which fields of the messages are read, where there is a choice.
    """

    note = ""

    def __init__(self, topic: str, domain: int, definition: str = "") -> None:
        self._topic = topic
        self._domain = domain
        self._definition = definition
        self._node: dds.Node | None = None
        self._reader: dds.TopicReader | None = None
        self._decoder: SampleDecoder | None = None
        self._queue: deque[ReceivedMessage] = deque()

    def open(self, deadline: float) -> None:
        """Wait for a publisher until `deadline`, by `time.monotonic` [s], and subscribe.

        Raises:
            SourceError: no node publishes, or the messages have an unsupported type.
        """
        self._node = dds.Node(self._domain)
        # DDS connects a reader only to publishers of the same type.
        while (kind := self._node.published_topics().get(self._topic)) is None:
            if time.monotonic() >= deadline:
                raise SourceError(self.why_no_message())
            time.sleep(DISCOVERY_INTERVAL)
        try:
            stated = self._definition
            definition = own_definition(kind, stated) if stated else known_definition(kind)
            if definition is None:
                raise SourceError(
                    f"{self._topic} has messages of type {kind}; supported types: {SUPPORTED_TYPES}"
                )
            self._decoder = SampleDecoder(definition, ros2=True)
        except ValueError as cause:
            raise SourceError(f"{self._topic}: {cause}") from cause
        self.note = self._decoder.note
        self._reader = self._node.reader(self._topic, definition)

    def take(self, timeout: float) -> ReceivedMessage | None:
        """Return the next message, or None after `timeout` [s]."""
        if not self._queue and self._reader is not None:
            messages = self._reader.take(timeout)
            received = time.monotonic()
            self._queue.extend(ReceivedMessage(data, received) for data in messages)
        return self._queue.popleft() if self._queue else None

    def decode(self, data: bytes) -> list[DeviceSample]:
        """Return the samples in a message.

        Raises:
            ValueError: the bytes are not valid.
        """
        return [] if self._decoder is None else self._decoder(data)

    def n_publishers(self) -> int:
        """Return the current number of publishers."""
        return 0 if self._reader is None else self._reader.n_writers()

    def why_no_message(self) -> str:
        """Return a message about a topic without samples, with the topics that exist."""
        topics = {} if self._node is None else self._node.published_topics()
        if self._topic in topics:
            return f"{self._topic} has a publisher, but no samples came in {TOPIC_OPEN_TIMEOUT:g} s"
        others = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(topics.items()))
        return (
            f"no node publishes {self._topic} in ROS domain {self._domain}; published topics: "
            f"{others or 'none'}"
        )

    def close(self) -> None:
        """End the subscription. It has no effect on one that is closed."""
        self._queue.clear()
        self._reader = None
        self._node = None


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
        notices += [self._subscription.note] if self._subscription.note else []
        if notices:
            self.notify(now, *notices)
        # The messages that identified the devices have samples, too.
        for message in messages:
            self._assemble(message)
        self.note_clock()

    def _first_messages(self, deadline: float) -> tuple[list[ReceivedMessage], list[DeviceSample]]:
        """Return the first messages, until a device repeats, and the first sample of each."""
        messages: list[ReceivedMessage] = []
        first_samples: dict[int | None, DeviceSample] = {}
        invalid: ValueError | None = None
        while (left := deadline - time.monotonic()) > 0:
            message = self._subscription.take(left)
            if message is None:
                continue
            try:
                decoded = self._subscription.decode(message.data)
            except ValueError as why:
                invalid = why
                continue
            samples = [device_sample for device_sample in decoded if has_taxels(device_sample)]
            messages.append(message)
            # A device that comes again has come after all others.
            if any(sample.number in first_samples for sample in samples):
                break
            if samples and not first_samples:
                deadline = min(deadline, time.monotonic() + DEVICES_TIMEOUT)
            first_samples.update((sample.number, sample) for sample in samples)
        if first_samples:
            return messages, list(first_samples.values())
        if invalid is not None:
            raise SourceError(f"{self.name} sends invalid messages: {invalid}") from invalid
        raise SourceError(self._subscription.why_no_message())

    def receive(self, timeout: float) -> bool:
        """Process what the device sends within `timeout` [s]; return False if nothing came."""
        message = self._subscription.take(min(timeout, PUBLISHER_CHECK_INTERVAL))
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
            samples = self._subscription.decode(message.data)
            arrivals = self._assembler.assemble(samples, received)
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
        """Return whether the device is connected; DDS subscribes again by itself."""
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
        raise ValueError(f"{address.text}: ros2:///TOPIC expected, as in ros2:///xServTopic")
    return topic
