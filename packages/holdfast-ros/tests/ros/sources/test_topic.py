import time
from collections import deque

import numpy as np
import pytest

from holdfast.devices.sources import base
from holdfast.devices.uri import parse
from holdfast.errors import SourceError
from holdfast.sensors import sensor
from holdfast_ros.sensor_messages import DeviceSample
from holdfast_ros.sources import ros2
from holdfast_ros.sources.ros2 import ReceivedMessage, Subscription, TopicSource

SILENCE_TIMEOUT = 0.1


class Script(Subscription):
    """A subscription with the messages of a test."""

    def __init__(self):
        super().__init__("/xServTopic", 7)
        self.packets = deque()
        self.publishers = 1
        self.n_closed = 0

    def put(self, *messages, why=None):
        data = why or list(messages)
        self.packets.append(ReceivedMessage(data, time.monotonic()))

    def decode(self, data):
        if isinstance(data, ValueError):
            raise data
        return data

    def samples(self, k, *numbers, model="uSPa44"):
        counts = np.full((16, 3), k, np.uint16)
        forces = np.empty((0, 3))
        self.put(
            *(DeviceSample(n, model, 0.01 * (k + 1), None, k, counts, forces) for n in numbers)
        )

    def open(self, deadline):
        assert deadline > time.monotonic()

    def take(self, timeout):
        if not self.packets:
            time.sleep(timeout)
            return None
        return self.packets.popleft()

    def n_publishers(self):
        return self.publishers

    def close(self):
        self.n_closed += 1


@pytest.fixture
def link(monkeypatch):
    for name in ("TOPIC_OPEN_TIMEOUT", "DEVICES_TIMEOUT", "PUBLISHER_CHECK_INTERVAL"):
        monkeypatch.setattr(ros2, name, getattr(ros2, name) / 10)
    for name in ("MIN_RETRY_DELAY", "MAX_RETRY_DELAY"):
        monkeypatch.setattr(base, name, getattr(base, name) / 10)
    monkeypatch.setattr(TopicSource, "silence_timeout", SILENCE_TIMEOUT)
    return Script()


def source(link, query=""):
    return TopicSource(parse(f"ros2:///xServTopic{query}")[1], link)


def drained(one, n=1):
    """Arrivals, until there are n or nothing comes for long."""
    arrivals = []
    while len(arrivals) < n and (arrival := one.read(2.0)) is not None:
        arrivals.append(arrival)
    return arrivals


def test_the_first_messages_are_samples_too(link):
    for k in range(3):
        link.samples(k, 1, 2)
    with source(link, "?fingers=2:index") as one:
        assert one.sensors == dict.fromkeys(["finger1", "index"], sensor("uskin-4x4"))
        assert one.metadata["source"] == "ros2:///xServTopic?fingers=2:index"
        arrivals = drained(one, 3)
    assert [int(a.samples["index"][0, 0]) for a in arrivals] == [0, 1, 2]
    assert link.n_closed == 2  # before it opens, and after


def test_devices_that_come_one_by_one_are_all_found(link):
    link.put()  # before any device
    for number in (1, 2, 3, 1):
        link.samples(number, number)
    with source(link) as one:
        assert list(one.sensors) == ["finger1", "finger2", "finger3"]


def test_messages_that_are_invalid(link):
    link.put(why=ValueError("it is cut"))
    with pytest.raises(SourceError, match=r"xServTopic .*it is cut"):
        source(link).open()


def test_invalid_messages_later_are_counted(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        link.put(why=ValueError("it is cut"))
        link.samples(2, 1)
        refused, sample = drained(one, 2)
    assert (refused.n_refused, len(refused.notices)) == (1, 1)
    assert sample.samples


@pytest.mark.parametrize("sends", [True, False])
def test_a_publisher_ends_and_another_begins(link, sends):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        link.publishers = 0
        (lost,) = drained(one)
        assert "connection lost" in lost.notices[0]
        assert one.read(0.02) is None
        link.publishers = 1
        if sends:
            link.samples(90, 1)  # its counter differs
        again, after = drained(one, 2)
        assert "connected again" in again.notices[0]
        assert (len(after.samples), after.n_lost) == (int(sends), 0)
        assert sends or "no new sample" in after.notices[0]
