import math
import threading
import time
from functools import partial

import pytest

from holdfast.contact import ContactEstimate, ContactState, Fault, Reason
from holdfast.io.cdr import MessageEncoder
from holdfast.live.stream_detector import StreamEstimate, StreamUpdate
from holdfast_ros import publisher as module
from holdfast_ros.dds import Publisher
from holdfast_ros.publisher import (
    ERROR,
    OK,
    WARN,
    Ros2Publisher,
    diagnostics_of,
    topic_names,
)
from holdfast_ros.topic_messages import DIAGNOSTICS, VECTOR, WRENCH, topic_definition
from live.estimates import UNITS, estimate, finger


def test_the_diagnostic_has_the_fields_of_the_estimate_without_a_topic():
    names = list(ContactEstimate.__struct_fields__)
    diagnostic = dict(diagnostics_of((estimate(), 1.0), 1.0)[1].values)
    assert list(diagnostic) == [name for name in names if name not in module.NOT_IN_DIAGNOSTICS]
    assert set(names) >= module.NOT_IN_DIAGNOSTICS


class FakeLink:
    """Connection that stores the messages, as what a test compares."""

    def __init__(self, publisher):
        self.of_test = publisher

    def open(self):
        self.of_test.kinds = {}

    def close(self):
        self.of_test.log.append("ended")

    def publisher(self, topic, kind):
        self.of_test.kinds[topic] = kind
        return Publisher(partial(self.store, topic, kind), lambda: 1)

    def store(self, topic, kind, message):
        MessageEncoder(topic_definition(kind))(message)  # has all fields
        assert self.of_test.gate.wait(60)
        if self.of_test.broken:
            raise RuntimeError("no network")
        if kind == DIAGNOSTICS:
            names = [one["name"].removeprefix("holdfast: ") for one in message["status"]]
            what = [
                (name, one["level"]) for name, one in zip(names, message["status"], strict=True)
            ]
        elif kind in (VECTOR, WRENCH):
            newtons = kind == WRENCH
            force = message["wrench"]["force"] if newtons else message["vector"]
            what = message["header"]["frame_id"], tuple(force.values()), newtons
            stamp = message["header"]["stamp"]
            self.of_test.stamp = stamp["sec"] + stamp["nanosec"] * 1e-9 + 1e-9
        else:
            what = message["data"]
        self.of_test.published.append((topic, what))


class FakePublisher(Ros2Publisher):
    """Publisher that stores its messages."""

    def __init__(self, **given):
        super().__init__(UNITS, FakeLink(self), **given)
        self.published = []
        self.log = []
        self.gate = threading.Event()
        self.gate.set()
        self.broken = False

    def of(self, topic):
        return [what for name, what in self.published if name == topic]


def test_topics_and_their_messages():
    before = time.time()
    with FakePublisher(namespace="/robot/hand_1/") as publisher:
        slides = finger(slip_probability=0.875, slip_speed=12.5, slip_distance=0.75)
        publisher.publish(estimate(thumb=slides))
    assert [topic.removeprefix("/robot/hand_1") for topic in publisher.kinds] == [
        "/hand/state", "/diagnostics",
        "/thumb/state", "/thumb/stable_probability", "/thumb/slip_probability",
        "/thumb/slip_speed", "/thumb/slip_distance", "/thumb/instability", "/thumb/force",
        "/index_1/state", "/index_1/stable_probability", "/index_1/slip_probability",
        "/index_1/slip_speed", "/index_1/slip_distance", "/index_1/instability", "/index_1/force",
    ]  # fmt: skip
    assert publisher.kinds["/robot/hand_1/thumb/force"] == "geometry_msgs/WrenchStamped"
    assert publisher.kinds["/robot/hand_1/index_1/force"] == "geometry_msgs/Vector3Stamped"
    published = {topic: what for topic, what in publisher.published if topic != "/diagnostics"}
    for field in ("slip_probability", "slip_speed", "slip_distance"):
        assert math.isnan(published.pop(f"/robot/hand_1/index_1/{field}"))  # without a rule
    assert published == {
        "/robot/hand_1/hand/state": "UNSTABLE",
        "/robot/hand_1/thumb/state": "STABLE",
        "/robot/hand_1/thumb/stable_probability": 0.75,
        "/robot/hand_1/thumb/slip_probability": 0.875,
        "/robot/hand_1/thumb/slip_speed": 12.5,
        "/robot/hand_1/thumb/slip_distance": 0.75,
        "/robot/hand_1/thumb/instability": 0.5,
        "/robot/hand_1/thumb/force": ("thumb", (1.0, -2.0, 3.0), True),
        "/robot/hand_1/index_1/state": "UNSTABLE",
        "/robot/hand_1/index_1/stable_probability": 0.75,
        "/robot/hand_1/index_1/instability": 0.5,
        "/robot/hand_1/index_1/force": ("index/1", (100.0, 0.0, -5.5), False),
    }
    assert before <= publisher.stamp <= time.time()
    assert publisher.log == ["ended"]


def test_a_listener_of_a_session_publishes_updated_fingers():
    with FakePublisher() as publisher:
        estimates = [
            StreamEstimate(estimate(7.0), ("thumb",)),
            StreamEstimate(estimate(8.0), ("index/1",)),
        ]
        publisher.put(StreamUpdate(None, estimates, []))
    assert len(publisher.of("/holdfast/thumb/state")) == 1
    assert len(publisher.of("/holdfast/index_1/state")) == 1
    assert len(publisher.of("/holdfast/hand/state")) == 2


def test_a_full_queue_drops_the_oldest_estimate(monkeypatch):
    monkeypatch.setattr(module, "MAX_QUEUED_ESTIMATES", 4)
    with FakePublisher() as publisher:
        publisher.gate.clear()
        for k in range(20):
            publisher.publish(estimate(thumb=finger(instability=k)), ("thumb",))
        publisher.gate.set()
    published = publisher.of("/holdfast/thumb/instability")
    assert published[-4:] == [16, 17, 18, 19]
    assert len(published) + publisher.n_dropped == 20


def test_publishing_continues_after_a_failure():
    with FakePublisher() as publisher:
        publisher.broken = True
        publisher.publish(estimate())
        while not publisher.n_failed:
            time.sleep(0.005)
        publisher.broken = False
        publisher.publish(estimate())
    assert publisher.of("/holdfast/thumb/state") == ["STABLE"]


def test_diagnostics_are_published_on_changes_and_periodically(monkeypatch):
    monkeypatch.setattr(module, "DIAGNOSTICS_PERIOD", 1000.0)
    well = estimate(thumb=finger())
    with FakePublisher() as publisher:
        for one in (well, well, estimate(), estimate(), well):
            publisher.publish(one)
    published = [[level for _, level in statuses] for statuses in publisher.of("/diagnostics")]
    assert published[-3:] == [[OK, OK, OK], [WARN, WARN, OK], [OK, OK, OK]]
    assert len(published) <= 4  # the first may report that there is no estimate yet
    monkeypatch.setattr(module, "DIAGNOSTICS_PERIOD", 0.01)
    with FakePublisher() as publisher:
        publisher.publish(well)
        while len(publisher.of("/diagnostics")) < 5:
            time.sleep(0.005)


BLIND = {
    reason: finger(ContactState.UNKNOWN, reason=reason, faults=faults)
    for reason, faults in (
        (Reason.FAULT, (Fault.STUCK, Fault.LATE)),
        (Reason.GAP, ()),
        (Reason.TARE, ()),
    )
}
STATUSES = [
    ({"thumb": finger()}, (OK, OK, OK), None),
    ({}, (WARN, WARN, OK), "dead"),
    ({"thumb": BLIND[Reason.FAULT]}, (ERROR, ERROR, OK), "stuck, late"),
    ({"thumb": BLIND[Reason.GAP]}, (ERROR, ERROR, OK), "gap"),
    ({"thumb": BLIND[Reason.TARE]}, (OK, OK, OK), None),
]


@pytest.mark.parametrize(("fingers", "levels", "message"), STATUSES)
def test_diagnostics_of_hand_and_fingers(fingers, levels, message):
    found = diagnostics_of((estimate(**fingers), 100.0), 100.5)
    assert [one.name for one in found] == ["hand", "thumb", "index/1"]
    assert tuple(one.level for one in found) == levels
    assert message in (None, found[1].message)


def test_faulty_taxels_are_numbers_from_1():
    assert estimate().fingers["thumb"].faulty_taxels == (3, 7)  # indices
    values = dict(diagnostics_of((estimate(), 1.0), 1.0)[1].values)
    assert values["faulty_taxels"] == "4, 8"


def test_topic_names_are_valid_in_ros():
    fingers = ["thumb", "index/1", "palm/2", "left/thumb", "1st", "a b-ä", "_x"]
    names = ["/thumb", "/index_1", "/palm_2", "/left/thumb", "/finger_1st", "/a_b_", "/finger_x"]
    assert topic_names(fingers, "") == dict(zip(fingers, names, strict=True))


def test_invalid_names_are_refused():
    with pytest.raises(ValueError, match="index/1, index_1"):
        topic_names(["index/1", "index_1"], "/holdfast")
    with pytest.raises(ValueError, match="fingers hand"):
        topic_names(["hand"], "/holdfast")
    for bad in ("holdfast", "/1", "/a b", "/a//b"):
        with pytest.raises(ValueError, match=f"'{bad}'"):
            topic_names(["thumb"], bad)
