"""Another process that sends ROS 2 messages with plain Cyclone DDS, without holdfast.

python ros2_peer.py publish DOMAIN N    sends N messages of XELA at 150 Hz
python ros2_peer.py read DOMAIN         prints what comes on holdfast's topics, as JSON lines
"""

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, float64, int32, sequence, uint8, uint16, uint32
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

CONFIG = (
    "<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast><Interfaces>"
    '<NetworkInterface name="lo"/></Interfaces></General><Discovery>'
    "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>"
    '<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>'
)
ROS2 = "msg::dds_::"
N_TAXELS = 30


@dataclass
class Taxel(IdlStruct, typename=f"xela_server_ros2::{ROS2}Taxel_"):
    x: uint16
    y: uint16
    z: uint16


@dataclass
class Forces(IdlStruct, typename=f"xela_server_ros2::{ROS2}Forces_"):
    x: float32
    y: float32
    z: float32


@dataclass
class SensorFull(IdlStruct, typename=f"xela_server_ros2::{ROS2}SensorFull_"):
    message: uint32
    time: float64
    model: str
    sensor_pos: uint8
    taxels: sequence[Taxel]
    forces: sequence[Forces]


@dataclass
class SensStream(IdlStruct, typename=f"xela_server_ros2::{ROS2}SensStream_"):
    sensors: sequence[SensorFull]


@dataclass
class String(IdlStruct, typename=f"std_msgs::{ROS2}String_"):
    data: str


@dataclass
class Float64(IdlStruct, typename=f"std_msgs::{ROS2}Float64_"):
    data: float64


@dataclass
class Time(IdlStruct, typename=f"builtin_interfaces::{ROS2}Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename=f"std_msgs::{ROS2}Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename=f"geometry_msgs::{ROS2}Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Vector3Stamped(IdlStruct, typename=f"geometry_msgs::{ROS2}Vector3Stamped_"):
    header: Header
    vector: Vector3


@dataclass
class Wrench(IdlStruct, typename=f"geometry_msgs::{ROS2}Wrench_"):
    force: Vector3
    torque: Vector3


@dataclass
class WrenchStamped(IdlStruct, typename=f"geometry_msgs::{ROS2}WrenchStamped_"):
    header: Header
    wrench: Wrench


@dataclass
class KeyValue(IdlStruct, typename=f"diagnostic_msgs::{ROS2}KeyValue_"):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename=f"diagnostic_msgs::{ROS2}DiagnosticStatus_"):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename=f"diagnostic_msgs::{ROS2}DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]


TOPICS = {
    "/holdfast/thumb/state": String,
    "/holdfast/thumb/stable_probability": Float64,
    "/holdfast/thumb/instability": Float64,
    "/holdfast/thumb/force": WrenchStamped,
    "/holdfast/index_1/force": Vector3Stamped,
    "/holdfast/hand/state": String,
    "/diagnostics": DiagnosticArray,
}


def qos(reliability):
    return Qos(
        Policy.DataRepresentation(use_cdrv0_representation=True),
        reliability,
        Policy.Durability.Volatile,
        Policy.History.KeepLast(10),
    )


RELIABLE = qos(Policy.Reliability.Reliable(duration(milliseconds=100)))


def publish(participant, n):
    topic = Topic(participant, "rt/xServTopic", SensStream, qos=RELIABLE)
    writer = DataWriter(participant, topic, qos=RELIABLE)
    while not writer.get_matched_subscriptions():
        time.sleep(0.01)
    start = time.time()
    for k in range(n):
        taxels = [Taxel(k, taxel, 65535) for taxel in range(N_TAXELS)]
        forces = [Forces(0.5 * k, 1.0, 2.0)] * N_TAXELS
        sensors = [
            SensorFull(k, start + k / 150, "uSCuAH", number, taxels, forces) for number in (1, 2)
        ]
        writer.write(SensStream(sensors))
        time.sleep(max(0.0, start + (k + 1) / 150 - time.time()))


def read(participant):
    """Until the whole of standard input was read."""
    readers = {}
    for name, kind in TOPICS.items():
        topic = Topic(participant, f"rt{name}", kind, qos=RELIABLE)
        readers[name] = DataReader(participant, topic, qos=RELIABLE)
    matched = set()
    while len(matched) < len(readers):
        for name, reader in readers.items():
            for message in reader.take(10):
                if not isinstance(message, InvalidSample):
                    sys.stdout.write(json.dumps([name, plain(message)]) + "\n")
                    sys.stdout.flush()
                    matched.add(name)
        time.sleep(0.01)


def plain(value):
    if isinstance(value, IdlStruct):
        return {name: plain(getattr(value, name)) for name in value.__annotations__}
    return [plain(one) for one in value] if isinstance(value, list) else value


if __name__ == "__main__":
    what, domain, *rest = sys.argv[1:]
    keep = Domain(int(domain), CONFIG)
    mine = DomainParticipant(int(domain))
    if what == "publish":
        publish(mine, int(rest[0]))
    else:
        read(mine)
