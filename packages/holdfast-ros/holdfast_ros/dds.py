"""Topics of ROS 2 without an installation of ROS: over DDS, by Cyclone DDS."""

import os
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any, NamedTuple, Self

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import (
    DDSException,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from holdfast.errors import SourceError
from holdfast.io.cdr import MessageDecoder, MessageEncoder
from holdfast.io.definitions import NUMBER_CODES, Definition, MessageField
from holdfast.openable import Openable
from holdfast_ros.topic_messages import JOINT_STATE, JointStates, topic_definition

READER_QUEUE_SIZE = 256
"""Maximum number of messages that wait for a busy reader."""
WRITER_QUEUE_SIZE = 10
"""Maximum number of messages that wait for a busy subscriber."""
MAX_MESSAGES_PER_READ = 32
"""Maximum number of messages that are read at a time."""
MAX_ENDPOINTS = 1000
"""Maximum number of publishers, or of subscribers, that are listed."""
MAX_DOMAIN = 232
"""Largest number of a ROS domain; larger ones have no ports."""
TOPIC_PREFIX, TYPE_SEPARATOR = "rt/", "::msg::dds_::"
"""Parts that ROS 2 adds to the names of topics and of types in DDS."""

LOCALHOST_CONFIGURATION = (
    "<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast><Interfaces>"
    '<NetworkInterface address="127.0.0.1"/></Interfaces></General><Discovery>'
    "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>"
    '<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>'
)
"""Configuration for `ROS_LOCALHOST_ONLY=1`."""

_PRIMITIVES = {
    "bool": bool,
    "string": str,
    # Both are one octet in ROS 2.
    "byte": idl.uint8,
    "char": idl.uint8,
    **{
        name: getattr(idl, name)
        for name in NUMBER_CODES
        if hasattr(idl, name) and name[-1].isdigit()
    },
}
# Domains with an own configuration, which a process can set once for each.
_domains: dict[int, Domain] = {}


class Node:
    """Participant in a ROS domain; on this machine only, if `ROS_LOCALHOST_ONLY` is 1.

    Args:
        domain: number of the ROS domain.

    Raises:
        SourceError: DDS reports an error, for example if `CYCLONEDDS_URI` is not valid.
    """

    def __init__(self, domain: int) -> None:
        try:
            # A configuration that the user has set takes precedence over ROS_LOCALHOST_ONLY.
            is_local = os.environ.get("ROS_LOCALHOST_ONLY") == "1"
            if is_local and not os.environ.get("CYCLONEDDS_URI") and domain not in _domains:
                _domains[domain] = Domain(domain, LOCALHOST_CONFIGURATION)
            self._participant = DomainParticipant(domain)
            self._publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
            self._subscriptions = BuiltinDataReader(self._participant, BuiltinTopicDcpsSubscription)
        except DDSException as cause:
            raise SourceError(f"ROS domain {domain} cannot be joined: {cause.msg}") from cause

    def published_topics(self) -> dict[str, str]:
        """Return the types of all published topics by name, both as in ROS."""
        return {
            ros_topic(endpoint): ros_type(endpoint.type_name)
            for endpoint in ros_endpoints(self._publications)
        }

    def subscribed_topics(self) -> dict[str, str]:
        """Return the types of all topics with a subscriber by name, both as in ROS."""
        return {
            ros_topic(endpoint): ros_type(endpoint.type_name)
            for endpoint in ros_endpoints(self._subscriptions)
        }

    def n_other_writers(self, topic: str) -> int:
        """Return the number of publishers on a topic that do not belong to this node.

        Those of a program that was killed count until DDS notices, 10 s by default.
        """
        mine = self._participant.guid
        writers = [endpoint.participant_key for endpoint in ros_endpoints(self._publications)
                 if ros_topic(endpoint) == topic]  # fmt: skip
        return sum(key != mine for key in writers)

    def reader(self, topic: str, definition: Definition) -> "TopicReader":
        """Subscribe to a topic."""
        # Also matches reliable publishers.
        qos = qos_of(Policy.Reliability.BestEffort, READER_QUEUE_SIZE)
        reader = DataReader(self._participant, self._topic(topic, definition, qos), qos=qos)
        return TopicReader(reader, WaitSet(self._participant))

    def writer(self, topic: str, definition: Definition) -> "TopicWriter":
        """Return a function that publishes messages on a topic, with the defaults of ROS 2."""
        reliable = Policy.Reliability.Reliable(duration(milliseconds=0))  # never blocks
        qos = qos_of(reliable, WRITER_QUEUE_SIZE)
        writer = DataWriter(self._participant, self._topic(topic, definition, qos), qos=qos)
        return TopicWriter(writer, _raw(definition))

    def _topic(self, name: str, definition: Definition, qos: Qos) -> Topic[Any]:
        full = TOPIC_PREFIX + name.removeprefix("/")
        return Topic(self._participant, full, _raw(definition), qos=qos)


class TopicReader:
    """Subscription to one topic."""

    def __init__(self, reader: DataReader[Any], wait: WaitSet) -> None:
        self._reader = reader
        new = ViewState.Any | SampleState.NotRead | InstanceState.Any
        self._new = ReadCondition(reader, new)
        self._wait = wait
        self._wait.attach(self._new)

    def take(self, timeout: float) -> list[bytes]:
        """Return the waiting messages; if there are none, wait up to `timeout` [s] for some."""
        samples = self._reader.take(MAX_MESSAGES_PER_READ)
        if not samples and self._wait.wait(duration(seconds=timeout)) > 0:
            samples = self._reader.take(MAX_MESSAGES_PER_READ)
        return [sample.data for sample in samples if not isinstance(sample, InvalidSample)]

    def n_writers(self) -> int:
        """Return the number of publishers on the topic."""
        return len(self._reader.get_matched_publications())


class TopicWriter:
    """Function that publishes messages on one topic, given as their bytes."""

    def __init__(self, writer: DataWriter[Any], raw: type[Any]) -> None:
        self._writer = writer
        self._raw = raw

    def __call__(self, data: bytes) -> None:
        """Publish a message.

        Raises:
            SourceError: DDS refuses it.
        """
        try:
            self._writer.write(self._raw(data))
        except DDSException as cause:
            topic = self._writer.topic.name
            raise SourceError(f"DDS refuses a message on {topic}: {cause.msg}") from cause

    def n_readers(self) -> int:
        """Return the number of subscribers of the topic."""
        return len(self._writer.get_matched_subscriptions())


def ros_endpoints(reader: BuiltinDataReader) -> list[Any]:
    """Return the publishers or subscribers of all topics of ROS."""
    # Publishers that have left stay in the reader, as not alive.
    alive = InstanceState.Alive | ViewState.Any | SampleState.Any
    samples = reader.read(MAX_ENDPOINTS, ReadCondition(reader, alive))
    return [
        sample
        for sample in samples
        if not isinstance(sample, InvalidSample) and sample.topic_name.startswith(TOPIC_PREFIX)
    ]


def ros_topic(endpoint: Any) -> str:  # noqa: ANN401 (cyclonedds has no types)
    """Return the topic of an endpoint as ROS has it."""
    # The slash stays: `rt/name` is `/name` in ROS.
    return str(endpoint.topic_name).removeprefix(TOPIC_PREFIX[:-1])


def qos_of(reliability: object, depth: int) -> Qos:
    """Return the quality of service of ROS 2's defaults, with this reliability and depth."""
    return Qos(
        # ROS 2 encodes messages in XCDR1; Cyclone DDS would also offer XCDR2.
        Policy.DataRepresentation(use_cdrv0_representation=True),
        reliability,
        Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
    )


def domain_number(domain: str | None) -> int:
    """Return the given ROS domain; by default that of `ROS_DOMAIN_ID`, otherwise 0.

    Raises:
        ValueError: the domain is not a number from 0 to 232.
    """
    text = domain if domain is not None else os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not (text.isdecimal() and int(text) <= MAX_DOMAIN):
        raise ValueError(f"a ROS domain from 0 to {MAX_DOMAIN} expected, {text!r} given")
    return int(text)


def dds_type(name: str) -> str:
    """Return the name in DDS of a type of ROS.

    Example:
        >>> dds_type("std_msgs/String")
        'std_msgs::msg::dds_::String_'
    """
    package, kind = name.split("/")
    return f"{package}{TYPE_SEPARATOR}{kind}_"


def ros_type(name: str) -> str:
    """Return the name in ROS of a type of DDS; a type that is not of ROS keeps its name.

    Example:
        >>> ros_type("std_msgs::msg::dds_::String_")
        'std_msgs/String'
    """
    package, separator, kind = name.partition(TYPE_SEPARATOR)
    return f"{package}/{kind.removesuffix('_')}" if separator else name


def _raw(definition: Definition) -> type[Any]:
    """Return the DDS type of a message; its samples keep their bytes in `data`."""
    return _raw_type(definition.name, tuple(definition.types.items()))


class _Raw:
    """Methods of a DDS type that keep its messages as bytes."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def serialize(self, *_: object, **__: object) -> bytes:
        return self.data

    @classmethod
    def deserialize(cls, data: bytes, *_: object, **__: object) -> Self:
        return cls(bytes(data))

    deserialize_key = deserialize


@cache
def _raw_type(name: str, types: tuple[tuple[str, tuple[MessageField, ...]], ...]) -> type[Any]:
    made = idl_struct(name, dict(types))
    for method in ("__init__", "serialize", "deserialize", "deserialize_key"):
        setattr(made, method, vars(_Raw)[method])
    return made


def idl_struct(name: str, types: Mapping[str, tuple[MessageField, ...]]) -> type[Any]:
    """Return a type of DDS with the fields of a message, and of those inside it."""
    fields: dict[str, Any] = {}
    for field in types[name]:
        part: Any = _PRIMITIVES.get(field.kind) or idl_struct(field.kind, types)
        if field.size is not None:  # 0 for a list of any length
            part = idl.sequence[part] if field.size == 0 else idl.array[part, field.size]  # type: ignore[misc]
        fields[field.name] = part
    _, kind = name.split("/")
    return make_idl_struct(kind, dds_type(name), fields, dataclassify=False)


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
    """Connection to a ROS domain: publishers, and joint states of hands.

    Args:
        domain: number of the domain as text; by default that of `ROS_DOMAIN_ID`.

    Attributes:
        where: part of the messages, and name of the network: "in ROS domain 0".

    Raises:
        ValueError: there is no such domain.
    """

    def __init__(self, domain: str | None = None) -> None:
        self._domain = domain_number(domain)
        self.where = f"in ROS domain {self._domain}"
        self._joined: Node | None = None

    def open(self) -> None:
        """Join the domain.

        Raises:
            SourceError: DDS reports an error.
        """
        self._joined = Node(self._domain)

    def publisher(self, topic: str, kind: str) -> Publisher:
        """Return a publisher of messages of a type on a topic."""
        definition = topic_definition(kind)
        write, encode = self._node.writer(topic, definition), MessageEncoder(definition)
        return Publisher(lambda message: write(encode(message)), write.n_readers)

    def joint_states(self, topic: str) -> TakeStates:
        """Subscribe to the joint states of a topic."""
        definition = topic_definition(JOINT_STATE)
        decode = MessageDecoder(definition, ros2=True)
        return partial(take_states, topic, self._node.reader(topic, definition), decode)

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
    def _node(self) -> Node:
        if self._joined is None:
            raise SourceError(f"the link {self.where} is not open")
        return self._joined


def take_states(topic: str, reader: TopicReader, decode: MessageDecoder) -> list[JointStates]:
    """Return the joint states that wait at a reader."""
    waiting: list[bytes] = []
    while taken := reader.take(0.0):
        waiting += taken
        if len(taken) < MAX_MESSAGES_PER_READ:
            break
    try:
        messages = [decode(data) for data in waiting]
    except ValueError as cause:
        raise SourceError(f"{topic} sends damaged joint states: {cause}") from cause
    return [JointStates.of_message(m["name"], m["position"], m["effort"]) for m in messages]
