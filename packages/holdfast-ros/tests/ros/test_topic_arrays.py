"""Topics of any type: arrays of numbers, points, and clouds, and their times."""

import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.io.importers.columns import Columns
from holdfast.io.proposals import ProposalError
from holdfast.sensors import flat_sensor, sensor

pytest.importorskip("rosbags", reason="rosbags is not installed")

from ros.bag_writer import BagWriter, forget_definitions

SKIN = sensor("anyskin")
N = 100
READINGS = np.random.default_rng(5).normal(0, 100, (N, 5, 3)).astype(np.float32)
START = 1_760_000_000
TAXELS = {
    "Taxel": "uint8 id\n" + "\n".join(f"float32 {v}{a}" for v in "fp" for a in "xyz"),
    "Skin": "std_msgs/Header header\nTaxel[] taxels",
    "Points": "std_msgs/Header header\ngeometry_msgs/Vector3[5] points\nfloat32 heat",
    "Columns": "\n".join(f"float32 {a}{k}" for k in range(5) for a in "xyz"),
}


def header(bag, k, late=0.0):
    return bag.header(START + k / 100 - late)


def numbers(bag, values, sizes=()):
    dim = [bag.make("std_msgs/msg/MultiArrayDimension", label="", size=n, stride=0) for n in sizes]
    layout = bag.make("std_msgs/msg/MultiArrayLayout", dim=dim, data_offset=0)
    return bag.make("std_msgs/msg/Float32MultiArray", layout=layout, data=values.ravel())


def cloud(bag, k, names):
    fields = [
        bag.make("sensor_msgs/msg/PointField", name=name, offset=4 * n, datatype=7, count=1)
        for n, name in enumerate(names)
    ]
    data = np.zeros((5, len(names)), np.float32)
    data[:, -3:] = READINGS[k]
    return bag.make(
        "sensor_msgs/msg/PointCloud2", header=header(bag, k), height=1, width=5, fields=fields,
        is_bigendian=False, point_step=4 * len(names), row_step=20 * len(names),
        data=data.view(np.uint8).ravel(), is_dense=True,
    )  # fmt: skip


def written(folder, topics, storage="mcap"):
    """Write a bag of topics, one message every 10 ms: for each a function of bag and number."""
    with BagWriter(folder / "a", storage, "lab", TAXELS) as bag:
        for k in range(N):
            for name, make in topics.items():
                if (message := make(bag, k)) is not None:
                    bag.write(name, message, START + k / 100)
    return bag.path


def taxels(bag, k):
    rows = [
        bag.make("lab/msg/Taxel", id=0, fx=x, fy=y, fz=z, px=0.0, py=0.0, pz=0.0)
        for x, y, z in READINGS[k].tolist()
    ]
    return bag.make("lab/msg/Skin", header=header(bag, k), taxels=rows)


def points(bag, k, late=0.0):
    vector = "geometry_msgs/msg/Vector3"
    rows = [bag.make(vector, x=x, y=y, z=z) for x, y, z in READINGS[k].tolist()]
    return bag.make("lab/msg/Points", header=header(bag, k, late), points=rows, heat=1.0)


def columns(bag, k):
    values = {f"{a}{t}": READINGS[k, t, i] for t in range(5) for i, a in enumerate("xyz")}
    return bag.make("lab/msg/Columns", **values)


def imported(path, keys, **words):
    (recording,) = import_recordings(path, sensors=dict.fromkeys(keys, SKIN), **words)
    return recording


TOPICS = {
    "numbers": (lambda bag, k: numbers(bag, READINGS[k]), "/skin"),
    "numbers with sizes": (lambda bag, k: numbers(bag, READINGS[k], (5, 3)), "/skin"),
    "any topic": (lambda bag, k: numbers(bag, READINGS[k]), "*"),
    "points": (points, "/skin"),
    "taxels": (taxels, "/skin.taxels.f"),
    "columns": (columns, "/skin"),
    "cloud": (lambda bag, k: cloud(bag, k, "xyz"), "/skin"),
    "cloud with forces": (lambda bag, k: cloud(bag, k, ["x", "y", "z", "fx", "fy", "fz"]), "/skin"),
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
    recording = imported(written(tmp_path, {"/skin": make}, storage), [key], accept=key == "*")
    module = recording.modules["finger1"]
    np.testing.assert_array_equal(module.readings, READINGS)
    np.testing.assert_allclose(module.times - START, np.arange(N) / 100, atol=1e-6)


def test_two_topics_are_two_modules(tmp_path):
    path = written(
        tmp_path,
        {f"/{n}/skin": lambda bag, k, s=s: numbers(bag, s * READINGS[k]) for n, s in NAMED},
    )
    recording = imported(path, ["/l/skin", "/r/skin"])
    assert list(recording.modules) == ["l", "r"]
    np.testing.assert_array_equal(recording.modules["r"].readings, 2 * READINGS)
    with pytest.raises(ProposalError) as caught:
        imported(path, ["*"])
    options = ["--topic", "/l/skin/data=*", "--topic", "/r/skin/data=*"]
    assert caught.value.proposal.options({}) == options


def test_without_a_sensor_the_topics_are_proposed(tmp_path):
    path = written(
        tmp_path,
        {name: lambda bag, k: numbers(bag, READINGS[k]) for name in ("/l/skin", "/r/skin")},
    )
    with pytest.raises(ProposalError) as caught:
        list(import_recordings(path))
    options = ["--topic", "/l/skin/data=anyskin", "--topic", "/r/skin/data=anyskin"]
    assert caught.value.proposal.options({}) == options
    (recording,) = import_recordings(path, accept=True)
    assert list(recording.modules) == ["l", "r"]


def test_topics_are_not_paired_by_row_number(tmp_path):
    """One that starts late keeps its times, and one with a message less stays."""
    path = written(
        tmp_path,
        {
            "/l/skin": points,
            "/r/skin": lambda bag, k: points(bag, k) if k >= 30 and k != 50 else None,
        },
    )
    modules = imported(path, ["/l/skin", "/r/skin"]).modules
    assert modules["r"].n_samples == N - 31
    np.testing.assert_array_equal(modules["r"].readings[0], modules["l"].readings[30])
    assert modules["r"].times[0] == modules["l"].times[30]


def wrench(bag, k):
    vector = "geometry_msgs/msg/Vector3"
    parts = [bag.make(vector, x=x, y=y, z=z) for x, y, z in READINGS[k, :2].tolist()]
    both = bag.make("geometry_msgs/msg/Wrench", force=parts[0], torque=parts[1])
    return bag.make("geometry_msgs/msg/WrenchStamped", header=header(bag, k), wrench=both)


@pytest.mark.parametrize("key", ["*", "/tip", "/tip.wrench.force"])
def test_of_a_wrench_force_is_read_and_torque_is_not(tmp_path, key):
    path = written(tmp_path, {"/tip": wrench})
    button = flat_sensor("button", 1, 1, 0.005, unit="N")
    (recording,) = import_recordings(path, sensors={key: button}, columns=Columns(unit="N"))
    np.testing.assert_array_equal(recording.modules["finger1"].readings[:, 0], READINGS[:, 0])


NAMED = (("l", 1), ("r", 2))


@pytest.mark.parametrize(
    ("late", "clock"), [(lambda _: 0.005, -0.005), (lambda k: START + k / 100 if k < 9 else 0, 0)]
)
def test_times_are_those_of_the_header_if_it_works(tmp_path, late, clock):
    path = written(tmp_path, {"/skin": lambda bag, k: points(bag, k, late(k))})
    times = imported(path, ["/skin"]).modules["finger1"].times
    np.testing.assert_allclose(times - START, np.arange(N) / 100 + clock, atol=1e-6)


REFUSED = {
    "normal force": (lambda bag, k: numbers(bag, READINGS[k, :, 2]), "/skin", "three axes"),
    "two vectors": (taxels, "/skin", "--topic skin/taxels/f=skin|--topic /skin/taxels/f=/skin"),
    "another topic": (columns, "/hand", "/hand; it has /skin"),
    "no definition": (columns, "/skin", r"lab/Columns \(/skin\).*ros2 bag convert"),
}


@pytest.mark.parametrize(("make", "key", "text"), REFUSED.values(), ids=REFUSED)
def test_refusals_name_the_option(tmp_path, make, key, text):
    path = written(tmp_path, {"/skin": make}, "sqlite3")
    if "convert" in text:
        forget_definitions(path)
    with pytest.raises(RecordingError, match=text):
        imported(path, [key])
