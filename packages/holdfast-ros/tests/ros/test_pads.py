"""Messages of pads: taxels with index, position, normal and force, and arrays with their shape."""

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed")

from holdfast.errors import SourceError
from holdfast.io import import_recordings
from holdfast.io.definitions import parse_definition
from holdfast.sensors import sensor
from holdfast_ros.sensor_messages import PAD_FORCES, SampleDecoder, known_definition
from ros.bag_writer import BagWriter

N, START = 60, 1_760_000_000
PADS = {
    "TactileTaxel": (
        "uint32 index\ngeometry_msgs/Point position\n# zero: unknown\n"
        "geometry_msgs/Vector3 normal\ngeometry_msgs/Vector3 force\n"
    ),
    "TactileSensor": (
        "std_msgs/Header header\ngeometry_msgs/Vector3 resultant_force\nTactileTaxel[] taxels\n"
    ),
}
ARRAY = {"SensingData": "std_msgs/Header header\nint32[] shape\nfloat32[] data\n"}
FORCES = np.random.default_rng(3).normal(0, 1, (N, 24, 3))
COUNTS = np.random.default_rng(4).integers(-128, 128, (N, 2, 120, 3)).astype(np.float32)


def vector(bag, values, kind="Vector3"):
    return bag.make(
        f"geometry_msgs/msg/{kind}", **dict(zip("xyz", map(float, values), strict=True))
    )


def pad(bag, k):
    """Taxels in any order; positions and normals that would be readings."""
    order = np.random.default_rng(k).permutation(24)
    taxels = [
        bag.make(
            f"{bag.package}/msg/TactileTaxel", index=int(i), force=vector(bag, FORCES[k, i]),
            position=vector(bag, (0.01, 0.02, 0.03), "Point"), normal=vector(bag, (0, 0, 1)),
        )
        for i in order
    ]  # fmt: skip
    return bag.make(
        f"{bag.package}/msg/TactileSensor", header=bag.header(START + k / 60),
        resultant_force=vector(bag, FORCES[k].sum(axis=0)), taxels=taxels,
    )  # fmt: skip


def array(bag, k, shape=(2, 120, 3)):
    return bag.make(
        f"{bag.package}/msg/SensingData", header=bag.header(START + k / 60),
        shape=np.array(shape, np.int32), data=COUNTS[k].ravel(),
    )  # fmt: skip


def written(folder, make, package, texts, storage="mcap"):
    with BagWriter(folder / "bag", storage, package, texts) as bag:
        for k in range(N):
            bag.write("/pad", make(bag, k), START + k / 60 + 0.002)
    return bag.path


@pytest.mark.parametrize("storage", ["mcap", "ros1"])
@pytest.mark.parametrize("package", ["paxini_hardware", "my_msgs"])
def test_force_is_read_and_the_choice_is_reported(tmp_path, storage, package):
    path, lines = written(tmp_path, pad, package, PADS, storage), []
    (recording,) = import_recordings(path, report=lines.append)
    (module,) = recording.modules.values()
    np.testing.assert_array_equal(module.readings, FORCES)
    assert (module.sensor.name, module.unit, recording.metadata["clock"]) == (
        "pad-24",
        "N",
        "header",
    )
    assert f"/pad: {PAD_FORCES}" in lines


def test_an_array_is_read_in_its_shape(tmp_path):
    (recording,) = import_recordings(written(tmp_path, array, "paxini_pkg", ARRAY))
    for k, module in enumerate(recording.modules.values()):
        np.testing.assert_array_equal(module.readings, COUNTS[:, k])
        assert module.sensor == sensor("paxini-120")
        np.testing.assert_allclose(np.diff(module.times), 1 / 60, atol=1e-6)
    assert len(recording.modules) == 2


@pytest.mark.parametrize("shape", [(2, 119, 3), (720,), (3, 240), (1, 1, 240, 3)])
def test_another_shape_is_refused(tmp_path, shape):
    with BagWriter(tmp_path / "a", "mcap", "paxini_pkg", ARRAY) as bag:
        message = array(bag, 0, shape)
        data = bag.types.serialize_cdr(message, message.__msgtype__)
    decode = SampleDecoder(known_definition("paxini_pkg/msg/SensingData"), ros2=True)
    with pytest.raises(ValueError, match=r"shape \(pads, taxels, 3\) of 720 values"):
        decode(bytes(data))


class TestLive:
    """Over DDS, from a topic whose messages rosbags wrote."""

    @pytest.fixture
    def published(self, domain, tmp_path):
        pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")
        from ros.sources.test_ros2 import writing

        def start(make, package, texts):
            with BagWriter(tmp_path / package, "mcap", package, texts) as bag:
                first = make(bag, 0).__msgtype__
                text, _ = bag.types.generate_msgdef(first, ros_version=2)

                def data(k):
                    return bytes(bag.types.serialize_cdr(make(bag, k % N), first))

                return writing(domain, "/pad", parse_definition(first, text), data)

        return start

    @staticmethod
    def first_arrivals(uri, n=3):
        from holdfast.devices.sources import open_source

        with open_source(uri) as source:
            arrivals = [next(a for a in source if a.samples or a.notices) for _ in range(n + 1)]
            return source.sensors, arrivals

    def test_force_of_taxels(self, published):
        with published(pad, "paxini_hardware", PADS):
            sensors, arrivals = self.first_arrivals("ros2:///pad?fingers=1:thumb")
        assert arrivals[0].notices == (PAD_FORCES,)
        assert (sensors["thumb"].n_taxels, sensors["thumb"].unit) == (24, "N")
        one = arrivals[-1].samples["thumb"]
        assert any(np.array_equal(one, forces) for forces in FORCES)

    def test_own_types_by_their_definition(self, published, tmp_path):
        types = PADS["TactileSensor"] + "=====\nMSG: my_msgs/TactileTaxel\n" + PADS["TactileTaxel"]
        (tmp_path / "pad.msg").write_text(types)
        (tmp_path / "wrong.msg").write_text("std_msgs/Header header\n")
        uri = "ros2:///pad?definition="
        with published(pad, "my_msgs", PADS):
            sensors, arrivals = self.first_arrivals(f"{uri}{tmp_path}/pad.msg")
            assert list(sensors) == ["finger1"] and arrivals[-1].samples
            with pytest.raises(SourceError, match=r"my_msgs/TactileSensor;.*definition=FILE.msg"):
                self.first_arrivals("ros2:///pad")
            with pytest.raises(SourceError, match="is not supported"):
                self.first_arrivals(f"{uri}{tmp_path}/wrong.msg")
        with pytest.raises(ValueError, match=r"none\.msg"):
            self.first_arrivals(f"{uri}{tmp_path}/none.msg")
