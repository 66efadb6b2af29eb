"""Topics of any type: arrays of numbers, points, and clouds, and their times."""

import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.sensors import sensor

pytest.importorskip("rosbags", reason="rosbags is not installed")

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

SKIN = sensor("anyskin")
N = 100
READINGS = np.random.default_rng(5).normal(0, 100, (N, 5, 3)).astype(np.float32)
START = 1_760_000_000_000_000_000
TAXELS = {
    "lab/msg/Taxel": "uint8 id\n" + "\n".join(f"float32 {v}{a}" for v in "fp" for a in "xyz"),
    "lab/msg/Skin": "std_msgs/Header header\nTaxel[] taxels",
    "lab/msg/Points": "std_msgs/Header header\ngeometry_msgs/Vector3[5] points\nfloat32 heat",
    "lab/msg/Columns": "\n".join(f"float32 {a}{k}" for k in range(5) for a in "xyz"),
}


class AnyBag:
    """Writes messages of any type, one every 10 ms."""

    def __init__(self, path, storage="mcap"):
        self.ros1 = storage == "ros1"
        self.path = path.with_suffix(".bag") if self.ros1 else path
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        for name, text in TAXELS.items():
            self.store.register(get_types_from_msg(text, name))
        plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
        self.writer = (
            Writer1(self.path) if self.ros1 else Writer2(path, version=9, storage_plugin=plugin)
        )

    def make(self, kind, **fields):
        return self.store.types[kind](**fields)

    def header(self, k, late=0):
        stamp = divmod(START + 10_000_000 * k - late, 10**9)
        time = self.make("builtin_interfaces/msg/Time", sec=stamp[0], nanosec=stamp[1])
        seq = {"seq": k} if self.ros1 else {}
        return self.make("std_msgs/msg/Header", stamp=time, frame_id="", **seq)

    def numbers(self, values, sizes=()):
        dim = [
            self.make("std_msgs/msg/MultiArrayDimension", label="", size=n, stride=0) for n in sizes
        ]
        layout = self.make("std_msgs/msg/MultiArrayLayout", dim=dim, data_offset=0)
        return self.make("std_msgs/msg/Float32MultiArray", layout=layout, data=values.ravel())

    def cloud(self, k, names):
        field = "sensor_msgs/msg/PointField"
        fields = [
            self.make(field, name=name, offset=4 * n, datatype=7, count=1)
            for n, name in enumerate(names)
        ]
        data = np.zeros((5, len(names)), np.float32)
        data[:, -3:] = READINGS[k]
        return self.make(
            "sensor_msgs/msg/PointCloud2", header=self.header(k), height=1, width=5, fields=fields,
            is_bigendian=False, point_step=4 * len(names), row_step=20 * len(names),
            data=data.view(np.uint8).ravel(), is_dense=True,
        )  # fmt: skip

    def write(self, topics):
        """Write topics: for each a function of the number of a message."""
        pack = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        with self.writer as writer:
            first = {name: make(0) for name, make in topics.items()}
            links = {
                name: writer.add_connection(name, one.__msgtype__, typestore=self.store)
                for name, one in first.items()
            }
            for k in range(N):
                for name, make in topics.items():
                    message = make(k)
                    data = pack(message, message.__msgtype__)
                    writer.write(links[name], START + 10_000_000 * k, data)
        return self.path


def taxels(bag, k):
    rows = [
        bag.make("lab/msg/Taxel", id=0, fx=x, fy=y, fz=z, px=0.0, py=0.0, pz=0.0)
        for x, y, z in READINGS[k].tolist()
    ]
    return bag.make("lab/msg/Skin", header=bag.header(k), taxels=rows)


def points(bag, k):
    vector = "geometry_msgs/msg/Vector3"
    rows = [bag.make(vector, x=x, y=y, z=z) for x, y, z in READINGS[k].tolist()]
    return bag.make("lab/msg/Points", header=bag.header(k), points=rows, heat=1.0)


def columns(bag, k):
    values = {f"{a}{t}": READINGS[k, t, i] for t in range(5) for i, a in enumerate("xyz")}
    return bag.make("lab/msg/Columns", **values)


def imported(path, keys, **words):
    (recording,) = import_recordings(path, sensors=dict.fromkeys(keys, SKIN), **words)
    return recording


TOPICS = {
    "numbers": (lambda bag, k: bag.numbers(READINGS[k]), "/skin"),
    "numbers with sizes": (lambda bag, k: bag.numbers(READINGS[k].T, (3, 5)), "/skin"),
    "any topic": (lambda bag, k: bag.numbers(READINGS[k]), "*"),
    "points": (points, "/skin"),
    "taxels": (taxels, "/skin.taxels.f"),
    "columns": (columns, "/skin"),
    "cloud": (lambda bag, k: bag.cloud(k, "xyz"), "/skin"),
    "cloud with forces": (lambda bag, k: bag.cloud(k, ["x", "y", "z", "fx", "fy", "fz"]), "/skin"),
}


@pytest.mark.parametrize(
    ("name", "storage"),
    [
        *((name, "mcap") for name in TOPICS),
        *((name, "ros1") for name in ("numbers", "taxels", "cloud")),
        *((name, "sqlite3") for name in ("numbers", "cloud with forces")),
    ],
)
def test_a_topic_with_numbers(tmp_path, name, storage):
    make, key = TOPICS[name]
    bag = AnyBag(tmp_path / "a", storage)
    recording = imported(bag.write({"/skin": lambda k: make(bag, k)}), [key])
    module = recording.modules["finger1"]
    np.testing.assert_array_equal(module.readings, READINGS)
    np.testing.assert_allclose(module.times - START / 1e9, np.arange(N) / 100, atol=1e-6)


def test_two_topics_are_two_modules(tmp_path):
    bag = AnyBag(tmp_path / "a")
    path = bag.write(
        {f"/{n}/skin": lambda k, s=s: bag.numbers(s * READINGS[k]) for n, s in (("l", 1), ("r", 2))}
    )
    recording = imported(path, ["/l/skin", "/r/skin"])
    assert list(recording.modules) == ["l", "r"]
    np.testing.assert_array_equal(recording.modules["r"].readings, 2 * READINGS)
    with pytest.raises(RecordingError, match="--topic /l/skin/data=anyskin --topic /r/skin/data="):
        imported(path, ["*"])


@pytest.mark.parametrize(
    ("late", "clock"), [(lambda _: 5_000_000, -0.005), (lambda k: START * (k < 9), 0.0)]
)
def test_times_are_those_of_the_header_if_it_works(tmp_path, late, clock):
    bag = AnyBag(tmp_path / "a")

    def make(k):
        message = points(bag, k)
        message.header.stamp = bag.header(
            k, late(k) if late(k) < START else START + 10_000_000 * k
        ).stamp
        return message

    times = imported(bag.write({"/skin": make}), ["/skin"]).modules["finger1"].times
    np.testing.assert_allclose(times - START / 1e9, np.arange(N) / 100 + clock, atol=1e-6)


REFUSED = {
    "normal force": (
        lambda bag, k: bag.numbers(READINGS[k, :, 2]),
        "/skin",
        "three axes (x, y, z)",
    ),
    "two vectors": (taxels, "/skin", "--topic /skin/taxels/f=anyskin --topic /skin/taxels/p="),
    "another topic": (columns, "/hand", "a has no topic /hand; it has /skin"),
    "no definition": (
        columns,
        "/skin",
        "no definition of lab/Columns (/skin): write the bag as mcap",
    ),
}


@pytest.mark.parametrize(("make", "key", "text"), REFUSED.values(), ids=REFUSED)
def test_refusals_name_the_option(tmp_path, monkeypatch, make, key, text):
    monkeypatch.chdir(tmp_path)
    bag = AnyBag(tmp_path / "a", "sqlite3" if "definition" in text else "mcap")
    path = bag.write({"/skin": lambda k: make(bag, k)})
    if "definition" in text:
        forget_definitions(path)
    with pytest.raises(RecordingError) as caught:
        imported(path.relative_to(tmp_path), [key])
    assert text in str(caught.value)
    assert len(str(caught.value)) <= 300


def forget_definitions(path):
    import sqlite3

    (file,) = path.glob("*.db3")
    with sqlite3.connect(file) as base:
        base.execute("DELETE FROM message_definitions")
