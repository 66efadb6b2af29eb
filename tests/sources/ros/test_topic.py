import time
from collections import deque

import numpy as np
import pytest

from holdfast.errors import SourceError
from holdfast.ros.sensor_messages import DeviceSample
from holdfast.sensors import sensor
from holdfast.sources.ros import topic
from holdfast.sources.ros.topic import Link, Packet, Stranger, TopicSource, topic_of
from holdfast.sources.uri import parse


class Script(Link):
    """A link that says what a test tells it to."""

    def __init__(self):
        self.packets = deque()
        self.publishers = 1
        self.dropped = 0
        self.n_mended = self.n_closed = 0

    def put(self, *messages, why=None, received=None):
        def unpack(_):
            if why is not None:
                raise why
            return list(messages)

        self.packets.append(Packet(b"", received or time.monotonic(), unpack))

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
            time.sleep(min(timeout, 0.02))
            return None
        return self.packets.popleft()

    def n_publishers(self):
        return self.publishers

    def n_dropped(self):
        dropped, self.dropped = self.dropped, 0
        return dropped

    def missing(self):
        return "nobody publishes"

    def mend(self):
        self.n_mended += 1

    def close(self):
        self.n_closed += 1


@pytest.fixture
def link(monkeypatch):
    for name in ("PATIENCE", "GATHERING", "SILENCE", "BACKOFF", "LONGEST_BACKOFF"):
        monkeypatch.setattr(topic, name, getattr(topic, name) / 10)
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


def test_devices_that_come_one_by_one_are_gathered(link):
    for number in (1, 2, 3, 1):
        link.samples(number, number)
    with source(link) as one:
        assert list(one.sensors) == ["finger1", "finger2", "finger3"]


def test_a_message_before_devices_are_there(link):
    link.put()
    link.samples(0, 1)
    with source(link) as one:
        assert list(one.sensors) == ["finger1"]


def test_nobody_publishes(link):
    with pytest.raises(SourceError, match=r"^nobody publishes$"), source(link):
        pass
    assert link.n_closed == 2


def test_messages_that_make_no_sense_or_are_strangers(link):
    link.put(why=ValueError("it is cut"))
    with pytest.raises(SourceError, match=r"^what ros2:///xServTopic sends makes no sense: it is"):
        source(link).open()
    link.put(why=Stranger("/a has b"))
    with pytest.raises(SourceError, match=r"^/a has b$"):
        source(link).open()


def test_garbage_later_is_counted(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        link.put(why=Stranger("/a has b"))
        link.samples(2, 1)
        refused, sample = drained(one, 2)
    assert (refused.n_refused, refused.notices) == (1, ("a message makes no sense: /a has b",))
    assert sample.samples


def test_a_timeout_gives_nothing(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        assert one.read(0.0) is None
        assert one.read(0.01) is None
        assert not one.ended


def test_silence_is_told_once_and_its_end(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        (silent,) = drained(one)
        assert silent.notices == (f"no new sample for {topic.SILENCE:g} s",)
        assert one.read(0.2) is None
        link.samples(2, 1)
        again, sample = drained(one, 2)
    assert again.notices[0].startswith("samples again after ")
    assert sample.samples


def test_a_reader_that_was_busy_is_not_told_of_silence(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        for k in range(2, 4):
            link.samples(k, 1)
        time.sleep(2 * topic.SILENCE)
        assert [a.notices for a in drained(one, 2)] == [(), ()]


def test_publishers_that_go_and_come(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        link.publishers = 0
        notices = [n for a in drained(one, 2) for n in a.notices]
        assert sorted(notices) == ["no new sample for 0.1 s", "nobody publishes any more"]
        for _ in range(100):
            assert one.read(0.02) is None
            if link.n_mended >= 2:
                break
        assert link.n_mended >= 2
        link.publishers = 1
        link.samples(0, 1, model="uSPa44")  # its counter begins anew
        notices = [n for a in drained(one, 3) for n in a.notices]
        assert "somebody publishes again" in notices


def test_dropped_messages_are_told(link):
    for k in range(2):
        link.samples(k, 1)
    with source(link) as one:
        drained(one, 2)
        link.dropped = 5
        (arrival,) = drained(one)
    assert arrival.notices == ("5 messages dropped: they were taken too slowly",)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("ros2://host/xServTopic", "ros2:///TOPIC expected, as in ros2:///xServTopic"),
        ("ros1:xServTopic", "ros1:///TOPIC expected, as in ros1:///xServTopic"),
        ("ros2:///", "ros2:///TOPIC expected"),
        ("ros2:///a?values=forces", "values=counts or calibrated expected, 'forces' given"),
        ("ros2:///a?sensor=mine", "sensor=FILE.json or one of uskin-curved,"),
        ("ros2:///a?fingers=thumb", "fingers=1:thumb,2:index expected, 'thumb' given"),
    ],
)
def test_bad_addresses(text, told):
    address = parse(text)[1]
    with pytest.raises(ValueError, match=told):
        TopicSource(address, Script()) if "?" in text else topic_of(address)


def test_a_topic_may_have_parts():
    assert topic_of(parse("ros2:///hub_0/sensor_0")[1]) == "/hub_0/sensor_0"
