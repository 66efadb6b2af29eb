"""Source of a ROS topic, the same for ROS 1 and ROS 2, and the assembly of its messages."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from holdfast.devices.sources.assembler import Assembler, Device
from holdfast.devices.sources.base import Arrival, DeviceSource
from holdfast.devices.sources.timeline import is_plausible
from holdfast.devices.sources.xela.decoder import no_calibration
from holdfast.devices.sources.xela.devices import xela_devices
from holdfast.devices.uri import Address
from holdfast.errors import SourceError
from holdfast.sensors import Sensor, sensor
from holdfast.sensors.types import Unit
from holdfast_ros.sensor_messages import PAPILLARRAY, DeviceSample, readings_of

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
        self._start(now)
        notices = [text for device in self._assembler.devices.values() for text in device.notices]
        if notices:
            self._notify(now, *notices)
        # The messages that identified the devices have samples, too.
        for message in messages:
            self._assemble(message)
        self._note_clock()

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

    def _receive(self, timeout: float) -> bool:
        message = self._subscription.take(min(timeout, PUBLISHER_CHECK_INTERVAL))
        if n_dropped := self._subscription.n_dropped():
            text = f"{n_dropped} messages dropped: they were read too slowly"
            self._notify(time.monotonic(), text)
        if message is not None:
            self._assemble(message)
            return True
        now = time.monotonic()
        if now - self._checked_at >= PUBLISHER_CHECK_INTERVAL:
            self._checked_at = now
            if not self._subscription.n_publishers():
                self._lose("the topic has no publisher")
        return False

    def _assemble(self, message: ReceivedMessage) -> None:
        received = message.received
        try:
            arrivals = self._assembler.assemble(message.decode(message.data), received)
        except ValueError as why:
            arrivals = self._assembler.refuse(str(why), received)
        self._queue(arrivals, received)

    def _pause(self, seconds: float) -> None:
        """Wait for a message of a new publisher."""
        message = self._subscription.take(seconds)
        if message is not None or self._subscription.n_publishers():
            self._resume()
        if message is not None:
            self._assemble(message)

    def _reconnect(self) -> bool:
        self._subscription.renew()
        return self._subscription.n_publishers() > 0

    def _resume(self) -> None:
        self._assembler.reconnected()
        super()._resume()

    def _disconnect(self) -> None:
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


_STAMPS: tuple[Callable[[DeviceSample], float | None], ...] = (
    lambda sample: _plausible(sample.time),
    lambda sample: _plausible(sample.stamp),
)
"""Stamps of a sample, the best one first: the device's own, and that in the header."""


class MessageAssembler:
    """Collector of the samples of ROS messages, also after restarts of the publisher.

    Stamps are those of the device's clock; without one, those in the header; without both, the
    times of arrival. Devices of one message with different stamps arrive one after the other. A
    repeated message is no new sample.

    Args:
        names: names of the devices by number; `finger1`, ... by default.
        unit: unit of the readings; a device that sends only newtons gives newtons.
        sensor: layout of the separate sensors with this number of taxels.
    """

    def __init__(
        self,
        names: Mapping[int, str] | None = None,
        unit: Unit = "count",
        sensor: Sensor | None = None,
    ) -> None:
        self._names = dict(names or {})
        self._unit: Unit = unit
        self._sensor = sensor
        self._assembler = Assembler()
        self._stamp: Callable[[DeviceSample], float | None] | None = None

    @property
    def devices(self) -> Mapping[int, Device]:
        """Devices by number; empty before `identify`."""
        return self._assembler.devices

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Sensors by module."""
        return self._assembler.sensors

    @property
    def metadata(self) -> dict[str, Any]:
        """Models of the devices, and the hand."""
        return self._assembler.metadata

    def identify(self, samples: Iterable[DeviceSample]) -> None:
        """Identify the devices from their first samples.

        Raises:
            SourceError: they do not fit the arguments of the assembler.
        """
        found = {_number(sample): sample for sample in samples if has_taxels(sample)}
        for number, one in found.items():
            if one.counts is not None and self._unit == "N" and not len(one.forces):
                raise SourceError(no_calibration(number, one.model))
        # Only a PapillArray sends newtons without counts.
        hubs = [number for number, one in found.items() if one.counts is None]
        if hubs:
            devices = {number: self._papillarray(number, found[number]) for number in hubs}
        else:
            models = {n: (x.model, len(readings_of(x, self._unit))) for n, x in found.items()}
            calibrated = self._unit == "N"
            devices = xela_devices(models, self._names, self._sensor, calibrated=calibrated)
        self._assembler.devices = devices
        # One kind for all devices: stamps of two clocks have no common order.
        self._stamp = next(
            (stamp for stamp in _STAMPS if any(stamp(one) is not None for one in found.values())),
            None,
        )

    def reconnected(self) -> None:
        """Accept any sequence number in the next message, because the publisher is a new one."""
        self._assembler.reconnected()

    def assemble(self, samples: Iterable[DeviceSample], received: float) -> list[Arrival]:
        """Return the arrivals of a message in order of time, none if it has nothing new.

        Args:
            samples: samples of the message.
            received: time of arrival, on the host's monotonic clock [s].
        """
        new = [sample for sample in samples if self._is_new(sample, received)]
        stamps = [received if self._stamp is None else self._stamp(one) for one in new]
        newest = max((stamp for stamp in stamps if stamp is not None), default=None)
        if newest is not None:
            self._assembler.stamp(newest, received)
            # A lost message lacks all of its devices, and counts once.
            n_lost = [0]
            for sample, stamp in zip(new, stamps, strict=True):
                number = _number(sample)
                n_lost.append(self._assembler.n_missing(sample.sequence, number))
                self._assembler.add(number, readings_of(sample, self._unit), stamp)
            self._assembler.n_lost += max(n_lost)
        elif new:
            self._assembler.refuse("time", "a message has no time, others had", received)
        return self._assembler.finish(received)

    def refuse(self, reason: str, received: float) -> list[Arrival]:
        """Return the arrival that reports an invalid message."""
        self._assembler.refuse("message", f"invalid message: {reason}", received)
        return self._assembler.finish(received)

    def _papillarray(self, number: int, sample: DeviceSample) -> Device:
        if unknown := sorted(set(self._names) - {number}):
            raise SourceError(
                f"fingers= names {', '.join(map(str, unknown))}; the topic has 1 ({PAPILLARRAY})"
            )
        built_in = self._sensor or sensor(PAPILLARRAY)
        if len(sample.forces) != built_in.n_taxels:
            raise SourceError(
                f"{len(sample.forces)} taxels given, {built_in.n_taxels} expected ({built_in.name})"
            )
        return Device(number, PAPILLARRAY, {self._names.get(number, f"finger{number}"): built_in})

    def _is_new(self, sample: DeviceSample, received: float) -> bool:
        """Return whether it is a new sample of a known device with its number of taxels."""
        number = _number(sample)
        if number not in self.devices and not has_taxels(sample):
            return False  # the server's entry for a sensor that is off
        stamp = sample.stamp if sample.time is None else sample.time
        return (
            self._assembler.accepts_device(number, received)
            and self._assembler.accepts_taxels(
                number, len(readings_of(sample, self._unit)), received
            )
            and self._assembler.is_new(number, None if stamp is None else (sample.sequence, stamp))
        )


def has_taxels(sample: DeviceSample) -> bool:
    """Return whether it is a sample, and not the server's entry for a sensor that is off."""
    return len(sample.forces if sample.counts is None else sample.counts) > 0


def _number(sample: DeviceSample) -> int:
    return 1 if sample.number is None else sample.number


def _plausible(time: float | None) -> float | None:
    """Return a time, or None instead of one that is thousands of years away."""
    return time if time is not None and is_plausible(time) else None
