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
from holdfast_ros.sources.ros2 import ReceivedMessage, Subscription, TopicSource, topic_of

SILENCE_TIMEOUT = 0.1


class Script(Subscription):
    """A subscription with the messages of a test."""

    def __init__(self):
        super().__init__("/xServTopic", 7)
        self.packets = deque()
        self.publishers = 1
        self.n_asked = self.n_closed = 0

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
        self.n_asked += 1
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
    for number in (1, 2, 3, 1):
        link.samples(number, number)
    with source(link) as one:
        assert list(one.sensors) == ["finger1", "finger2", "finger3"]


def test_a_message_before_devices_are_there(link):
    link.put()
    link.samples(0, 1)
    with source(link) as one:
        assert list(one.sensors) == ["finger1"]


def test_a_topic_without_publishers(link):
    with pytest.raises(SourceError) as caught, source(link):
        pass
    assert str(caught.value) == (
        "no node publishes /xServTopic in ROS domain 7; published topics: none"
    )
    assert link.n_closed == 2


def test_messages_that_are_invalid(link):
    link.put(why=ValueError("it is cut"))
    with pytest.raises(
        SourceError, match=r"^ros2:///xServTopic sends invalid messages: it is cut$"
    ):
        source(link).open()


def test_invalid_messages_later_are_counted(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        link.put(why=ValueError("it is cut"))
        link.samples(2, 1)
        refused, sample = drained(one, 2)
    assert (refused.n_refused, refused.notices) == (1, ("invalid message: it is cut",))
    assert sample.samples


def test_a_timeout_gives_nothing(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        assert one.read(0.0) is None
        assert one.read(0.01) is None
        assert not one.ended


def test_silence_and_its_end_are_reported_once(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        (silent,) = drained(one)
        assert silent.notices == (f"no new sample for {SILENCE_TIMEOUT:g} s",)
        assert one.read(0.2) is None
        link.samples(2, 1)
        again, sample = drained(one, 2)
    assert again.notices[0].startswith("samples again after ")
    assert sample.samples


def test_a_busy_reader_causes_no_silence(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        for k in range(2, 4):
            link.samples(k, 1)
        time.sleep(2 * SILENCE_TIMEOUT)
        assert [a.notices for a in drained(one, 2)] == [(), ()]


def test_a_publisher_ends_and_another_begins(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        link.publishers = 0
        (lost,) = drained(one)
        assert lost.notices == ("connection lost (the topic has no publisher)",)
        link.n_asked = 0
        for _ in range(100):
            assert one.read(0.02) is None
            if link.n_asked >= 2:
                break
        assert link.n_asked >= 2
        link.publishers = 1
        link.samples(90, 1)  # its counter differs
        again, sample = drained(one, 2)
        assert again.notices[0].startswith("connected again after ")
        assert (len(sample.samples), sample.n_lost) == (1, 0)


def test_a_publisher_without_messages_is_found_again(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        link.publishers = 0
        drained(one)
        link.publishers = 1
        (again,) = drained(one)
        assert again.notices[0].startswith("connected again after ")
        (silent,) = drained(one)
        assert silent.notices == (f"no new sample for {SILENCE_TIMEOUT:g} s",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ros2://host/xServTopic", "ros2:///TOPIC expected, as in ros2:///xServTopic"),
        ("ros2:///", "ros2:///TOPIC expected"),
        ("ros2:///a?values=forces", "values=counts or calibrated expected, 'forces' given"),
        ("ros2:///a?sensor=mine", "sensor=FILE.json or one of uskin-curved,"),
        ("ros2:///a?fingers=thumb", "fingers=1:thumb,2:index expected, 'thumb' given"),
    ],
)
def test_bad_addresses(text, message):
    address = parse(text)[1]
    with pytest.raises(ValueError, match=message):
        TopicSource(address, Script()) if "?" in text else topic_of(address)


def test_a_topic_may_have_parts():
    assert topic_of(parse("ros2:///hub_0/sensor_0")[1]) == "/hub_0/sensor_0"
