"""This process as a node of ROS 1, by the rospy of a ROS installation or of Debian.

rospy is not on PyPI. If the interpreter cannot import it, the folders of ROS and of Debian are
searched, after all other folders and only if they belong to the same version of Python.
"""

import atexit
import logging
import os
import sys
import threading
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from http.client import HTTPConnection, HTTPException
from importlib import import_module
from ipaddress import ip_address
from pathlib import Path
from socket import gethostname
from types import ModuleType
from typing import Any
from urllib.parse import urlsplit
from xmlrpc.client import Error, ServerProxy, Transport

from holdfast.errors import SourceError
from holdfast.io.definitions import Definition
from holdfast_ros.link import Link, Publisher, TakeStates
from holdfast_ros.topic_messages import JOINT_STATE, JointStates, topic_definition

DEFAULT_MASTER = "http://localhost:11311"
"""URI of the ROS master by default, as in ROS."""
MASTER_TIMEOUT = 2.0
"""Maximum time for an answer of the ROS master [s]."""
ROSPY_FOLDERS = ("/opt/ros/*/lib/python3/dist-packages", "/usr/lib/python3/dist-packages")
"""Folders in which ROS and Debian install rospy."""

_NODE_NAME = "/holdfast"
_lock = threading.Lock()
# A process stays the node of one master until it ends.
_master: str | None = None
QUEUE_SIZE = 10
"""Messages that rospy keeps for a slow subscriber; the oldest is dropped first."""
STAMP, DURATION = "builtin_interfaces/Time", "builtin_interfaces/Duration"
"""Types of a time and of a duration in ROS 2, by whose definitions messages are filled."""
STATE_QUEUE_SIZE = 256
"""Joint states that wait until they are read; the oldest is dropped first."""


def rospy_module() -> ModuleType:
    """Import rospy.

    Raises:
        SourceError: it is not installed, or not for this version of Python.
    """
    with suppress(ImportError):
        return import_module("rospy")
    for folder in rospy_folders():
        # Last, so that its packages replace none of this environment.
        sys.path.append(folder)
        try:
            return import_module("rospy")
        except ImportError:
            sys.path.remove(folder)
            # A failed import leaves modules, which the next folder must not get.
            for name in [name for name in sys.modules if name.split(".")[0] == "rospy"]:
                del sys.modules[name]
    raise SourceError(
        "this needs rospy of ROS 1, which pip cannot install: apt install python3-rospy, and "
        f"a Python of the same version (this is {sys.version_info[0]}.{sys.version_info[1]})"
    )


def start_node(master: str) -> ModuleType:
    """Make this process a node of a ROS master, and return rospy.

    Args:
        master: URI of the ROS master.

    Raises:
        SourceError: rospy is not installed, the master does not answer, or this process is a
            node of another master.
    """
    global _master  # noqa: PLW0603 (a process is one node only)
    check_master(master)
    with _lock:
        rospy = rospy_module()
        if rospy.core.is_initialized():
            if _master not in (None, master):
                raise SourceError(f"this process is a node of {_master} and cannot be of {master}")
            return rospy
        os.environ["ROS_MASTER_URI"] = master  # rospy reads it as long as the process runs
        # Anonymous, because a master ends the older of two nodes of one name. Without `argv` and
        # `disable_signals` rospy would read our arguments and handle Ctrl-C.
        rospy.init_node("holdfast", argv=["holdfast"], anonymous=True, disable_signals=True)
        atexit.register(rospy.signal_shutdown, "the process ends")
        # Stop rospy from writing its log to stdout, which is for results; its log file stays.
        logger = logging.getLogger("rosout")
        for handler in logger.handlers[:]:
            if type(handler).__name__ == "RosStreamHandler":
                logger.removeHandler(handler)
        _master = master
        return rospy


def master_uri(given: str | None) -> str:
    """Return the URI of the given master; by default `ROS_MASTER_URI`, otherwise this machine.

    Raises:
        ValueError: it is not the URI of a ROS master.
    """
    if given is None:
        given = os.environ.get("ROS_MASTER_URI", "").strip() or DEFAULT_MASTER
    with suppress(ValueError):
        parts = urlsplit(given)
        if parts.scheme == "http" and parts.hostname and parts.port:
            return given.rstrip("/")
    raise ValueError(f"a ROS master like {DEFAULT_MASTER} expected, {given!r} given")


def master_address(uri: str) -> str:
    """Return host and port of a ROS master, `localhost` for all names of this machine.

    Names of other machines are not looked up.

    Example:
        >>> master_address("http://127.0.0.1:11311"), master_address("http://Robot:11311/")
        ('localhost:11311', 'robot:11311')
    """
    parts = urlsplit(uri)
    host = parts.hostname or ""
    here = host in ("localhost", gethostname().lower())
    with suppress(ValueError):  # a name, not an address
        here = ip_address(host).is_loopback
    return f"{'localhost' if here else host}:{parts.port}"


def check_master(master: str) -> None:
    """Check that a ROS master answers.

    Raises:
        SourceError: there is no answer within 2 s.
    """
    call_master(master, "getPid")


def published_topics(master: str) -> dict[str, str]:
    """Return the types of all published topics by name.

    Raises:
        SourceError: the ROS master does not answer.
    """
    # `getTopicTypes` also lists topics without a publisher.
    names = {name for name, nodes in call_master(master, "getSystemState")[0] if nodes}
    return {name: kind for name, kind in call_master(master, "getTopicTypes") if name in names}


def publishers_of(master: str, topic: str) -> list[str]:
    """Return the names of the running nodes that publish a topic.

    A node that was killed stays registered: only those that answer are returned.

    Raises:
        SourceError: the ROS master does not answer.
    """
    topics = dict(call_master(master, "getSystemState")[0])
    running = []
    for node in topics.get(topic, ()):
        with suppress(SourceError):
            call_master(call_master(master, "lookupNode", node), "getPid")
            running.append(node)
    return running


def subscribed_topics(master: str) -> list[str]:
    """Return the names of all topics with a subscriber.

    Raises:
        SourceError: the ROS master does not answer.
    """
    return [name for name, nodes in call_master(master, "getSystemState")[1] if nodes]


def message_type(full_name: str) -> type[Any]:
    """Return the class of a ROS message, `std_msgs/String`.

    Raises:
        SourceError: its package is not installed.
    """
    package, name = full_name.split("/")
    try:
        found: type[Any] = getattr(import_module(f"{package}.msg"), name)
    except ImportError as cause:
        debian = f"python3-{package.replace('_', '-')}"
        raise SourceError(f"this needs {package} of ROS 1: apt install {debian}") from cause
    return found


def call_master(master: str, method: str, *arguments: str) -> Any:  # noqa: ANN401 (any value)
    """Call a method of the interface of a ROS master.

    Raises:
        SourceError: no ROS master answers in time, or it reports an error.
    """
    try:
        with ServerProxy(master, transport=_TimeoutTransport()) as proxy:
            code, text, value = getattr(proxy, method)(_NODE_NAME, *arguments)
    except OSError as cause:
        raise SourceError(
            f"no ROS master answers at {master} ({cause.strerror or cause}): is roscore running? "
            "ROS_MASTER_URI or ?master= sets its address"
        ) from cause
    except (Error, HTTPException, ValueError, TypeError) as cause:
        raise SourceError(f"the program at {master} is not a ROS master: {cause}") from cause
    if code != 1:
        raise SourceError(f"the ROS master at {master} refuses {method}: {text}")
    return value


class _TimeoutTransport(Transport):
    """Connection with a timeout."""

    def make_connection(self, host: Any) -> HTTPConnection:  # noqa: ANN401
        connection = super().make_connection(host)
        connection.timeout = MASTER_TIMEOUT
        return connection


def rospy_folders() -> Iterator[str]:
    """Yield the folders with a rospy for this version of Python."""
    python = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    for pattern in ROSPY_FOLDERS:
        for folder in sorted(Path("/").glob(pattern.removeprefix("/"))):
            if (folder / "rospy").is_dir() and python in system_pythons():
                yield str(folder)


def system_pythons() -> Sequence[str]:
    """Return the names of the Pythons of the operating system, which use these folders."""
    return [path.name for path in Path("/usr/bin").glob("python3.*")]


class Ros1Link(Link):
    """Connection to a ROS master.

    Args:
        master: URI of the ROS master; by default `ROS_MASTER_URI`.

    Raises:
        ValueError: it is no URI.
    """

    def __init__(self, master: str | None = None) -> None:
        self._master = master_uri(master)
        self.where = f"at the ROS master {self._master}"
        self._rospy: Any = None
        self._registered: list[Any] = []

    @property
    def network(self) -> str:
        """Name of the network: the master, with one name for this machine."""
        return f"at the ROS master {master_address(self._master)}"

    def open(self) -> None:
        """Make this process a node.

        Raises:
            SourceError: rospy is not installed, or the master does not answer.
        """
        self._rospy = start_node(self._master)

    def publisher(self, topic: str, kind: str) -> Publisher:
        """Return a publisher of messages of a type on a topic."""
        publisher = self._rospy.Publisher(
            topic, message_type(kind), queue_size=QUEUE_SIZE, tcp_nodelay=True
        )
        self._registered.append(publisher)
        publish = partial(self._publish, topic, publisher, topic_definition(kind))
        return Publisher(publish, publisher.get_num_connections)

    def joint_states(self, topic: str) -> TakeStates:
        """Subscribe to the joint states of a topic."""
        waiting: deque[Any] = deque(maxlen=STATE_QUEUE_SIZE)
        kind = message_type(JOINT_STATE)
        subscriber = self._rospy.Subscriber(topic, kind, waiting.append, tcp_nodelay=True)
        self._registered.append(subscriber)
        return partial(take_states, waiting)

    def n_other_publishers(self, topic: str) -> int:
        """Return the number of publishers on a topic, other than those of this process."""
        mine = self._rospy.get_name()
        return sum(node != mine for node in publishers_of(self._master, topic))

    def subscribed_topics(self) -> list[str]:
        """Return the names of all topics with a subscriber."""
        return sorted(subscribed_topics(self._master))

    def published_topics(self) -> list[str]:
        """Return the names of all topics with a publisher."""
        return sorted(published_topics(self._master))

    def close(self) -> None:
        """End the subscription and the publishers; the process stays a node."""
        registered, self._registered = self._registered, []
        for topic in registered:
            topic.unregister()

    def _publish(
        self,
        topic: str,
        publisher: Any,  # noqa: ANN401 (rospy.Publisher)
        definition: Definition,
        fields: Mapping[str, Any],
    ) -> None:
        message = publisher.data_class()
        self._fill(message, definition, definition.name, fields)
        try:
            publisher.publish(message)
        except self._rospy.ROSException as cause:
            raise SourceError(f"{topic}: ROS refuses a message ({cause})") from cause

    def _fill(
        self,
        message: Any,  # noqa: ANN401 (of any type)
        definition: Definition,
        kind: str,
        fields: Mapping[str, Any],
    ) -> None:
        """Set the fields of a message, also those of the messages inside it."""
        for field in definition.types[kind]:
            value = fields[field.name]
            if field.kind == STAMP:
                setattr(message, field.name, self._rospy.Time(value["sec"], value["nanosec"]))
            elif field.kind == DURATION:
                setattr(message, field.name, self._rospy.Duration(value["sec"], value["nanosec"]))
            elif field.kind not in definition.types:
                setattr(message, field.name, value)
            elif field.size is None:
                self._fill(getattr(message, field.name), definition, field.kind, value)
            else:
                parts = [message_type(field.kind)() for _ in value]
                for part, part_fields in zip(parts, value, strict=True):
                    self._fill(part, definition, field.kind, part_fields)
                setattr(message, field.name, parts)


def take_states(waiting: deque[Any]) -> list[JointStates]:
    """Return the joint states that wait in a queue."""
    messages = [waiting.popleft() for _ in range(len(waiting))]
    return [JointStates.of_message(m.name, m.position, m.effort) for m in messages]
