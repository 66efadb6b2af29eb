import struct
import time
from types import SimpleNamespace

import numpy as np
import pytest

from holdfast.devices.sources import open_source
from holdfast_ros.rospy_node import published_topics
from holdfast_ros.sources import ros1
from ros.ros1_master import lines, running_master

pytestmark = pytest.mark.slow

N = 300
LOST, AGAIN = "connection lost (the topic has no publisher)", "connected again after"


@pytest.fixture
def master(tmp_path):
    with running_master(tmp_path) as running:
        yield running


def result_of(child):
    """Return what a source gave after it was open."""
    first, *others = lines(child)
    assert first == "open"
    (result,) = others
    return result


def test_xela_from_another_process(master):
    master.peer("publish", N)
    result = result_of(master.peer("source", "ros1:///xServTopic?fingers=1:thumb", LOST))
    assert result["sensors"] == {
        "thumb": ["uskin-curved", "count"],
        "finger2": ["uskin-curved", "count"],
    }
    numbers = result["numbers"]
    assert numbers[-1] == N - 1
    assert np.all(np.diff(numbers) > 0)
    assert len(numbers) + result["n_lost"] == N - numbers[0]
    assert len(numbers) > 0.9 * N
    assert np.all(np.diff(result["times"]) > 0)
    assert result["sample"] == [N - 1, 1, 65535]
    assert LOST in result["notices"]


def test_a_restarted_master(master):
    master.peer("publish", 30)
    uri = f"ros1:///xServTopic?values=calibrated&master={master.uri}/"
    child = master.peer("source", uri, AGAIN)
    assert next(lines(child)) == "open"
    master.stop()
    master.start()
    master.peer("publish", 1500)
    (result,) = lines(child)
    assert LOST in result["notices"]
    assert any(notice.startswith(AGAIN) for notice in result["notices"])
    assert result["sensors"]["finger1"] == ["uskin-curved", "N"]
    assert result["sample"][1:] == [1.0, 2.0]
    assert result["numbers"][-1] < 20  # of the new one
    assert np.all(np.diff(result["times"]) > 0)


def test_topics_of_others(master):
    master.peer("chatter")
    while "/chatter" not in published_topics(master.uri):
        time.sleep(0.05)
    (result,) = lines(master.peer("source", "ros1:///xServTopic", LOST, 1))
    assert result["error"].startswith(
        f"no node publishes /xServTopic at the ROS master {master.uri}; published topics: "
        "/chatter (std_msgs/String), /rosout"
    )
    (result,) = lines(master.peer("source", "ros1:///chatter", LOST))
    assert result["error"].startswith(
        "/chatter has messages of type std_msgs/String; supported types: xela_server"
    )


def test_unknown_parameters():
    with pytest.raises(ValueError, match="unknown parameter domain; there are master, values, fin"):
        open_source("ros1:///a?domain=0")
    with pytest.raises(
        ValueError, match=r"a ROS master like http://localhost:11311 expected, 'x' given"
    ):
        open_source("ros1:///a?master=x")


def test_old_definitions_are_dropped(monkeypatch):
    monkeypatch.setattr(ros1, "MAX_DECODERS", 3)
    subscription = ros1.Ros1Subscription("/xServTopic", "http://127.0.0.1:1")
    headers = [{"type": "a/B", "message_definition": f"float32 x{k}"} for k in range(5)]
    decoders = [subscription._decoder(header) for header in headers]
    assert len(subscription._decoders) == 3
    assert subscription._decoder(headers[4]) is decoders[4]
    assert subscription._decoder(headers[0]) is not decoders[0]


class PlainMessage:
    """Message of a rospy that keeps no header of the publisher with its messages."""

    def serialize(self, file):
        one = struct.pack("<IdI3sBII", 7, 0.5, 3, b"XR1", 2, 0, 0)
        file.write(struct.pack("<I", 1) + one)


def test_a_rospy_without_headers_takes_the_type_of_the_master(monkeypatch):
    received, calls = [], []

    def subscribe(topic, kind, callback, **_):
        received.append(callback)

    def published(master):
        calls.append(master)
        return {"/xServTopic": "xela_server_ros/SensStream"}

    rospy = SimpleNamespace(AnyMsg=PlainMessage, Subscriber=subscribe)
    monkeypatch.setattr(ros1.rospy_node, "start_node", lambda master: rospy)
    monkeypatch.setattr(ros1.rospy_node, "published_topics", published)
    subscription = ros1.Ros1Subscription("/xServTopic", "http://127.0.0.1:1")
    subscription.open(0.0)
    for _ in range(2):
        received[0](PlainMessage())
        message = subscription.take(1.0)
        (sample,) = message.decode(message.data)
        assert (sample.number, sample.model, sample.sequence) == (2, "XR1", 7)
    assert calls == ["http://127.0.0.1:1"]
