import itertools
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")
pytest.importorskip("rosbags", reason="rosbags is not installed")

from holdfast.devices.sources import open_source
from holdfast.errors import SourceError
from holdfast.io.definitions import parse_definition
from holdfast.sensors import sensor
from holdfast_ros import dds
from holdfast_ros.sensor_messages import known_definition
from holdfast_ros.sources import ros2
from ros_messages import PILLARS, sensor_state, store

PEER = Path(__file__).parents[1] / "ros2_peer.py"
N = 300


@contextmanager
def publishing(domain, n=N):
    peer = subprocess.Popen([sys.executable, PEER, "publish", str(domain), str(n)])
    try:
        yield peer
    finally:
        peer.kill()
        peer.wait()


def until(source, wanted, seconds=60.0):
    """Arrivals until one is as wanted."""
    end = time.monotonic() + seconds
    arrivals = []
    while time.monotonic() < end:
        arrival = source.read(0.5)
        if arrival is not None:
            arrivals.append(arrival)
            if wanted(arrival):
                return arrivals
    raise AssertionError(f"not within {seconds} s: {[a.notices for a in arrivals if a.notices]}")


def test_xela_from_another_process(domain):
    with publishing(domain), open_source("ros2:///xServTopic?fingers=1:thumb") as source:
        assert source.sensors == dict.fromkeys(["thumb", "finger2"], sensor("uskin-curved"))
        last = N - 1
        arrivals = until(source, lambda a: a.samples and a.samples["thumb"][0, 0] == last)
    samples = [a for a in arrivals if a.samples]
    numbers = [int(a.samples["thumb"][0, 0]) for a in samples]
    assert np.all(np.diff(numbers) > 0)
    assert len(numbers) + sum(a.n_lost for a in samples) == last - numbers[0] + 1
    assert len(numbers) > 0.9 * (last - numbers[0])
    assert np.all(np.diff([a.time for a in samples]) > 0)
    np.testing.assert_array_equal(samples[-1].samples["finger2"][:, 1], range(30))
    assert samples[-1].samples["thumb"].dtype == np.uint16


def test_a_publisher_is_replaced_by_another(domain):
    with publishing(domain, 20), open_source("ros2:///xServTopic") as source:
        until(source, lambda a: any("connection lost" in text for text in a.notices))
        with publishing(domain, 2000):
            arrivals = until(source, lambda a: a.samples)
            notices = [notice for arrival in arrivals for notice in arrival.notices]
            assert any("connected again" in notice for notice in notices)
            assert arrivals[-1].n_lost == 0


def test_pillars(domain):
    types = store("sensor_interfaces", PILLARS, ros2=True)
    topic, kind = "/hub_0/sensor_0", known_definition("sensor_interfaces/SensorState")
    source = open_source(f"ros2://{topic}?fingers=1:tip")
    with writing(domain, topic, kind, lambda k: pillars(types, k)), source:
        arrivals = list(itertools.islice((a for a in source if a.samples), 10))
    assert source.sensors == {"tip": sensor("papillarray")}
    assert arrivals[-1].samples["tip"].shape == (9, 3)
    np.testing.assert_allclose(np.diff([a.time for a in arrivals]), 0.001)


def pillars(types, k):
    message = sensor_state(
        types, "sensor_interfaces", 1000 * (k + 1), 0.0, np.full((9, 3), k), ros2=True
    )
    return bytes(types.serialize_cdr(message, message.__msgtype__))


@contextmanager
def writing(domain, topic, kind, data):
    """Write the data of message 0, 1, ... to a topic, in a thread."""
    write, over = dds.Node(domain).writer(topic, kind), Event()

    def run():
        for k in itertools.count():
            if over.wait(0.01):
                return
            write(data(k))

    thread = Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def test_a_topic_that_cannot_be_read(domain, monkeypatch):
    monkeypatch.setattr(ros2, "TOPIC_OPEN_TIMEOUT", 1.0)
    keep = dds.Node(domain)
    write = keep.writer("/chatter", parse_definition("std_msgs/String", "string data"))
    with pytest.raises(SourceError, match=rf"/xServTopic in ROS domain {domain}.*/chatter"):
        open_source("ros2:///xServTopic").open()
    with pytest.raises(SourceError, match=r"/chatter .*std_msgs/String; supported types: xela_"):
        open_source("ros2:///chatter").open()
    silent = keep.writer("/xServTopic", known_definition("xela_server_ros2/SensStream"))
    with pytest.raises(SourceError, match="/xServTopic has a publisher"):
        open_source("ros2:///xServTopic").open()
    del write, silent


def test_a_configuration_of_dds_that_is_none(monkeypatch):
    domain = 231  # DDS reads its configuration when the first node of the process joins a domain
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><Domain><Nonsense/></Domain></CycloneDDS>")
    with pytest.raises(SourceError, match=f"^ROS domain {domain} cannot be joined: "):
        open_source("ros2:///a").open()


@pytest.mark.parametrize("given", ["-1", "233", "zero"])
def test_bad_domains(given, monkeypatch):
    with pytest.raises(ValueError, match=f"'{given}'"):
        open_source(f"ros2:///a?domain={given}")
    monkeypatch.setenv("ROS_DOMAIN_ID", given)
    with pytest.raises(ValueError, match=f"'{given}'"):
        open_source("ros2:///a")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ros2://host/xServTopic", "ros2:///TOPIC"),
        ("ros2:///", "ros2:///TOPIC"),
        ("ros2:///a?values=forces", "'forces'"),
        ("ros2:///a?sensor=mine", "'mine'; built in are"),
        ("ros2:///a?fingers=thumb", "'thumb'"),
        ("ros2:///a?master=x", "unknown parameter master"),
    ],
)
def test_bad_addresses(text, message):
    with pytest.raises(ValueError, match=message):
        open_source(text)
