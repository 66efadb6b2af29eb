"""The examples for ROS 2, with stand-ins for rclpy: topics and fields are those of holdfast."""

import importlib.util
import sys
import types
from pathlib import Path
from typing import ClassVar

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast.io.definitions import NUMBER_CODES
from holdfast_ros.dds import Link
from holdfast_ros.publisher import Ros2Publisher
from holdfast_ros.topic_messages import (
    DIAGNOSTICS,
    FLOAT64,
    STRING,
    VECTOR,
    WRENCH,
    topic_definition,
)

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).parents[5] / "examples" / "ros2"
FINGERS = ("thumb", "index", "middle", "ring")


class Message:
    """Message with the fields of its definition, and no others."""

    defaults: ClassVar = {}

    def __init__(self, **fields):
        unknown = fields.keys() - self.defaults.keys()
        assert not unknown, f"{type(self).__name__} has no field {unknown}"
        self.__dict__.update({k: make() for k, make in self.defaults.items()} | fields)


def message_class(kind, definition):
    """Return the class of a message type, with classes of its parts."""
    defaults = {}
    for field in definition.types[kind]:
        if field.size is not None:
            defaults[field.name] = list
        elif field.kind == "string":
            defaults[field.name] = str
        elif field.kind in NUMBER_CODES:
            defaults[field.name] = float
        else:
            defaults[field.name] = message_class(field.kind, definition)
    name = kind.rpartition("/")[2]
    return type(name, (Message,), {"defaults": defaults})


KINDS = {
    kind: message_class(kind, topic_definition(kind))
    for kind in (STRING, FLOAT64, VECTOR, WRENCH, DIAGNOSTICS)
}


class Node:
    """Stand-in for `rclpy.node.Node` that keeps what an example subscribes to and publishes."""

    parameters: ClassVar = {}

    def __init__(self, name):
        self.name, self.time = name, 100.0
        self.subscriptions, self.published, self.log, self.timers = {}, {}, [], []

    def declare_parameter(self, name, default):
        return types.SimpleNamespace(value=self.parameters.get(name, default))

    def create_subscription(self, kind, topic, callback, qos):
        assert qos == 10  # the default quality of service: reliable and volatile
        self.subscriptions[topic] = kind, callback

    def create_publisher(self, kind, topic, qos):
        sent = self.published.setdefault(topic, [])
        return types.SimpleNamespace(publish=lambda message: sent.append((kind, message)))

    def create_timer(self, period, callback):
        self.timers.append((period, callback))

    def get_clock(self):
        now = types.SimpleNamespace(nanoseconds=round(self.time * 1e9))
        return types.SimpleNamespace(now=lambda: now)

    def get_logger(self):
        return types.SimpleNamespace(info=self.log.append, warning=self.log.append)

    def send(self, topic, **fields):
        kind, callback = self.subscriptions[topic]
        callback(kind(**fields))


def module(name, **members):
    made = types.ModuleType(name)
    made.__dict__.update(members)
    return made


@pytest.fixture
def example(monkeypatch):
    """A function that imports an example with stand-ins for the packages of ROS."""
    status = topic_definition(DIAGNOSTICS)
    status = message_class("diagnostic_msgs/DiagnosticStatus", status)
    status.OK = b"\0"
    packages = {}
    for kind, made in [*KINDS.items(), ("diagnostic_msgs/DiagnosticStatus", status)]:
        package, _, name = kind.partition("/")
        packages.setdefault(package, {})[name] = made
    stand_ins = [
        module("rclpy"),
        module("rclpy.node", Node=Node),
        *(module(package) for package in packages),
        *(module(f"{package}.msg", **members) for package, members in packages.items()),
    ]
    for one in stand_ins:
        monkeypatch.setitem(sys.modules, one.__name__, one)

    def load(name):
        spec = importlib.util.spec_from_file_location("example", FOLDER / name)
        made = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(made)
        return made

    return load


def check_topics(node, unit):
    """Check that holdfast publishes each topic of a node, with that type."""
    published = Ros2Publisher(dict.fromkeys(FINGERS, unit), Link()).topics()
    assert node.subscriptions
    for topic, (kind, _) in node.subscriptions.items():
        assert KINDS[published[topic]] is kind, topic


def test_the_watcher_logs_states_and_faults(example):
    node = example("watch_states.py").StateWatcher()
    check_topics(node, "count")
    assert len(node.subscriptions) == 2 * len(FINGERS) + 2
    node.send("/holdfast/thumb/stable_probability", data=0.97)
    for state in ("STABLE", "STABLE", "UNSTABLE"):
        node.send("/holdfast/thumb/state", data=state)
        node.send("/holdfast/hand/state", data="STABLE")
    assert [line.partition(":")[0] for line in node.log] == ["thumb", "hand", "thumb"]


@pytest.mark.parametrize("unit", ["count", "N"])
def test_the_grip_follows_the_state(example, monkeypatch, unit):
    monkeypatch.setattr(Node, "parameters", {"unit": unit})
    node = example("grip_harder.py").GripHarder()
    check_topics(node, unit)
    ((period, update),) = node.timers

    def factor(state=None, seconds=period):
        if state is not None:
            node.send("/holdfast/hand/state", data=state)
        node.time += seconds
        update()
        return node.published["/grip/force_factor"][-1][1].data

    assert factor() == 1.0
    assert factor("STABLE") == 1.0
    assert factor("UNSTABLE") == 1.5
    assert 1.0 < factor("STABLE") < 1.5
    assert [factor("STABLE") for _ in range(150)][-1] == 1.0
    factor("UNSTABLE")
    assert factor("UNKNOWN") == 1.0
    factor("UNSTABLE")
    assert factor(seconds=1.0) == 1.0  # holdfast is silent
    kind, _ = node.subscriptions["/holdfast/thumb/force"]
    message = kind()
    vector = message.wrench.force if unit == "N" else message.vector
    vector.x, vector.y, vector.z = 1.0, 2.0, 3.0
    node.subscriptions["/holdfast/thumb/force"][1](message)
    assert node.force == (1.0, 2.0, 3.0)
    node.largest_force = 3.0
    assert factor("UNSTABLE") == 1.0  # the grip is strong enough
