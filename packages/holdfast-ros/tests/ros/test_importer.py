import numpy as np
import pytest

from holdfast.cli import main
from holdfast.devices.sources.xela.decoder import XelaDecoder
from holdfast.errors import RecordingError
from holdfast.io import import_recordings, load_recording, save_recording
from holdfast.io.recording_files import is_recording
from holdfast.sensors import hand
from holdfast.synthetic import synthetic_recording
from holdfast_ros.sensor_messages import DeviceSample
from holdfast_ros.sources.message_assembler import MessageAssembler

pytest.importorskip("rosbags", reason="rosbags is not installed")

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from devices.sources.xela import build as xela_packets
from ros_messages import (
    OLD,
    PILLARS,
    PILLARS_OF_ROS2,
    XELA,
    counts,
    sens_stream,
    sensor_state,
    sensor_state_of_ros2,
    store,
    x_server,
    x_stream,
)

EPOCH = 1_619_157_045.0
N = 30
STORAGES = ["sqlite3", "mcap", "ros1"]


class Bag:
    """Writes a bag, message by message."""

    def __init__(self, path, storage, package, texts):
        self.ros2 = storage != "ros1"
        self.path = path if self.ros2 else path.with_suffix(".bag")
        self.types = store(package, texts, ros2=self.ros2)
        self.package = package
        plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
        self.writer = (
            Writer2(path, version=9, storage_plugin=plugin) if self.ros2 else Writer1(self.path)
        )
        self.connections = {}

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *_):
        self.writer.close()

    def write(self, topic, message, time):
        name = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, name, typestore=self.types)
        pack = self.types.serialize_cdr if self.ros2 else self.types.serialize_ros1
        self.writer.write(self.connections[topic], round(time * 1e9), pack(message, name))

    def text(self, time):
        self.write("/chatter", self.types.types["std_msgs/msg/String"]("hello"), time)

    def xela(self, time, *sensors, topic="/xServTopic"):
        self.write(topic, sens_stream(self.types, self.package, *sensors), time)

    def pillars(self, topic, time, tus, stamp, forces):
        message = sensor_state(self.types, self.package, tus, stamp, forces, ros2=self.ros2)
        self.write(topic, message, time)


@pytest.fixture(params=STORAGES)
def bag(request, tmp_path):
    """Makes a bag of XELA's messages."""
    package = "xela_server_ros" if request.param == "ros1" else "xela_server_ros2"
    return lambda name="grasp": Bag(tmp_path / name, request.param, package, XELA)


def read(path, **given):
    (recording,) = import_recordings(path, **given)
    return recording


def test_separate_sensors_with_their_own_times(bag):
    samples = [(counts(30, k), counts(16, 100 + k)) for k in range(N)]
    with bag() as given:
        for k, (thumb, tip) in enumerate(samples):
            time = EPOCH + 0.01 * k
            given.text(time)
            given.xela(
                time + 0.3 + 0.001 * (k % 3),
                (1, "uSCuAH", k, time, thumb, thumb * 0.5),
                (2, "uSPa44", k, time - 0.002, tip, []),
            )
    recording = read(given.path)
    assert recording.name == "grasp"
    assert recording.metadata == {
        "source": given.path.name,
        "topics": {"/xServTopic": f"{given.package}/SensStream"},
        "clock": "device",
    }
    one, two = recording.modules["finger1"], recording.modules["finger2"]
    assert (one.sensor.name, two.sensor.name) == ("uskin-curved", "uskin-4x4")
    assert (one.unit, one.readings.dtype) == ("count", np.uint16)
    np.testing.assert_array_equal(one.readings, [thumb for thumb, _ in samples])
    np.testing.assert_array_equal(two.readings, [tip for _, tip in samples])
    np.testing.assert_allclose(one.times - EPOCH, np.arange(N) * 0.01, atol=1e-6)
    np.testing.assert_allclose(two.times - EPOCH, np.arange(N) * 0.01 - 0.002, atol=1e-6)


@pytest.mark.parametrize(
    ("model", "n_taxels"),
    [("", 16), ("", 15), ("uSPa35", 15), ("uSPr-DSF", 30), ("uSPa44", 16), ("XR23AHLCPP", 368)],
)
def test_a_device_is_the_same_sensor_in_a_bag_and_live(tmp_path, model, n_taxels):
    with Bag(tmp_path / "grasp", "mcap", "xela_server_ros2", XELA) as given:
        for k in range(4):
            given.xela(EPOCH + k, (1, model, k, EPOCH + k, counts(n_taxels, k), []))
    assembler = MessageAssembler()
    assembler.identify([DeviceSample(1, model, EPOCH, None, 0, counts(n_taxels), np.empty((0, 3)))])
    decoder = XelaDecoder()
    decoder.identify(xela_packets.text(0, [xela_packets.sensor(counts(n_taxels), model)]))
    imported = {name: module.sensor for name, module in read(given.path).modules.items()}
    assert imported == assembler.sensors
    assert imported == decoder.sensors


def test_a_whole_hand(bag):
    allegro = hand("allegro-uskin")
    samples = [counts(368, k) for k in range(3)]
    with bag("hand.1") as given:
        for k, flat in enumerate(samples):
            given.xela(EPOCH + k, (1, "XR23AHRCPP", k, EPOCH + k, flat, []))
    recording = read(given.path)
    assert recording.metadata["hand"] == "allegro-uskin"
    assert recording.name == ("hand.1" if given.ros2 else "hand")
    assert list(recording.modules) == list(allegro.modules)
    for name, want in allegro.split(np.array(samples)).items():
        np.testing.assert_array_equal(recording.modules[name].readings, want)


def test_two_hands_keep_apart(bag):
    with bag() as given:
        for k in range(3):
            right, left = (1, "XR23AHRCPP", k, EPOCH + k, counts(368, k), []), counts(368, 9 + k)
            given.xela(EPOCH + k, right, (2, "XR23AHLCPP", k, EPOCH + k, left, []))
    modules = read(given.path).modules
    assert len(modules) == 36
    assert "thumb" in modules
    assert "finger2/thumb" in modules


def test_a_packet_that_was_sent_twice_counts_once(bag):
    with bag() as given:
        for k in range(N):
            packet = (1, "uSPa44", k // 2, EPOCH + k // 2, counts(16, k // 2), [])
            given.xela(EPOCH + 0.5 * k, packet)
    module = read(given.path).modules["finger1"]
    assert module.n_samples == N // 2
    assert (np.diff(module.times) == 1).all()


@pytest.mark.parametrize("times", [[0.0] * 4, [1.0, 2.0, 1.5, 3.0]])
def test_where_the_device_has_no_good_clock_the_bags_is_taken(bag, times):
    with bag() as given:
        for k, time in enumerate(times):
            given.xela(EPOCH + k, (1, "uSPa44", k, time, counts(16, k), []))
    recording = read(given.path)
    assert recording.metadata["clock"] == "bag"
    np.testing.assert_allclose(recording.modules["finger1"].times - EPOCH, range(4))


def test_a_sensor_that_is_off_and_one_that_changes(bag):
    with bag() as given:
        for k in range(4):
            changing = counts(16 if k else 24, k)
            given.xela(
                EPOCH + k,
                (1, "not_available", 0, 0.0, [], []),
                (2, "uSPa46", k, EPOCH + k, changing, []),
                (3, "uSPa44", k, EPOCH + k, counts(16, k), []),
            )
    recording = read(given.path)
    assert list(recording.modules) == ["finger2", "finger3"]
    assert recording.modules["finger2"].n_samples == 1
    assert recording.metadata["n_refused"] == 3


@pytest.mark.parametrize("storage", STORAGES)
def test_older_messages_of_xela(tmp_path, storage):
    with Bag(tmp_path / "old", storage, "xela_server", OLD) as given:
        for k in range(N):
            for number in (1, 2):
                message = x_server(
                    given.types, "xela_server", number, "XR1944", EPOCH + 0.01 * k,
                    counts(16, k + number), ros2=given.ros2,
                )  # fmt: skip
                given.write("/xServTopic", message, EPOCH + 0.01 * k + 0.005 * number)
    recording = read(given.path)
    assert recording.metadata["clock"] == "header"
    assert [m.sensor.name for m in recording.modules.values()] == ["uskin-4x4"] * 2
    np.testing.assert_array_equal(recording.modules["finger2"].readings[3], counts(16, 5))
    with Bag(tmp_path / "older", storage, "tactile_msgs", OLD) as given:
        for k in range(N):
            message = x_stream(given.types, "tactile_msgs", counts(16, k), counts(24, k))
            given.write("/xServTopic", message, EPOCH + 0.01 * k)
    recording = read(given.path)
    assert recording.metadata["clock"] == "bag"
    assert recording.modules["finger2"].sensor.name == "uskin-4x6"


@pytest.mark.parametrize("storage", STORAGES)
def test_pillars_of_two_sensors(tmp_path, storage):
    package = "papillarray_ros_v2" if storage == "ros1" else "sensor_interfaces"
    forces = np.random.default_rng(0).normal(size=(2, N, 9, 3)).astype(np.float32)
    with Bag(tmp_path / "pillars", storage, package, PILLARS) as given:
        for k in range(N):
            for sensor in (1, 0):
                time = EPOCH + 0.001 * k
                topic = f"/hub_0/sensor_{sensor}"
                given.pillars(topic, time, 1000 * (k + 1), time, forces[sensor, k])
    recording = read(given.path)
    assert recording.metadata["clock"] == "device"
    assert list(recording.modules) == ["finger1", "finger2"]
    for number, module in enumerate(recording.modules.values()):
        assert (module.sensor.name, module.unit) == ("papillarray", "N")
        np.testing.assert_array_equal(module.readings, forces[number])
        np.testing.assert_allclose(module.times, 0.001 * np.arange(1, N + 1))


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_pillars_as_the_maker_sends_them_in_ros2(tmp_path, storage):
    forces = np.random.default_rng(0).normal(size=(N, 9, 3)).astype(np.float32)
    with Bag(tmp_path / "pillars", storage, "sensor_interfaces", PILLARS_OF_ROS2) as given:
        for k in range(N):
            time = EPOCH + 0.002 * k
            message = sensor_state_of_ros2(
                given.types, given.package, 2000 * (k + 1) + 40 * (k % 3), forces[k]
            )
            given.write("/hub_0/sensor_0", message, time + 0.0015 * (k % 2))
    recording = read(given.path)
    assert recording.metadata["clock"] == "device"
    module = recording.modules["finger1"]
    np.testing.assert_array_equal(module.readings, forces)
    expected = (2000 * np.arange(1, N + 1) + 40 * (np.arange(N) % 3)) * 1e-6
    np.testing.assert_allclose(module.times, expected)


def pillars_with(tmp_path, tus):
    """A bag with one message of a PapillArray for each time of its clock [us]."""
    with Bag(tmp_path / "pillars", "ros1", "papillarray_ros_v2", PILLARS) as given:
        for k, microseconds in enumerate(tus):
            time = EPOCH + 0.002 * k
            given.pillars("/hub_0/sensor_0", time, microseconds, time, np.full((9, 3), float(k)))
    return read(given.path)


def test_pillars_without_a_time_of_their_own(tmp_path):
    recording = pillars_with(tmp_path, [0, 0, 2000, 4000, 4000, 6000, 8000])
    assert recording.metadata["clock"] == "device"
    assert recording.metadata["n_undated"] == 3
    module = recording.modules["finger1"]
    assert module.readings[:, 0, 0].tolist() == [2, 3, 5, 6]
    np.testing.assert_allclose(module.times, [0.002, 0.004, 0.006, 0.008])


@pytest.mark.parametrize(
    "tus", [[2000, 4000, 3000, 6000], [2000] * 5, [0, 0, 0, 2000, 4000], [0] * 4, [5, 0, 7, 9]]
)
def test_pillars_with_a_clock_that_is_none(tmp_path, tus):
    recording = pillars_with(tmp_path, tus)
    assert recording.metadata["clock"] == "header"
    assert "n_undated" not in recording.metadata
    assert recording.modules["finger1"].n_samples == len(tus)


def test_forces_that_are_missing_stay_missing(tmp_path):
    with Bag(tmp_path / "pillars", "mcap", "sensor_interfaces", PILLARS) as given:
        for k in range(4):
            forces = np.full((9, 3), np.nan if k == 2 else 1.0)
            given.pillars("/hub_0/sensor_0", EPOCH + k, 1000 * (k + 1), EPOCH + k, forces)
    readings = read(given.path).modules["finger1"].readings
    assert np.isnan(readings).any(axis=(1, 2)).tolist() == [False, False, True, False]


def test_another_number_of_pillars(tmp_path):
    with Bag(tmp_path / "pillars", "mcap", "sensor_interfaces", PILLARS) as given:
        given.pillars("/hub_0/sensor_0", EPOCH, 1000, EPOCH, np.ones((8, 3)))
    with pytest.raises(RecordingError, match=r"8 taxels given, 9 expected \(papillarray\)$"):
        read(given.path)


def test_clocks_of_two_devices_are_not_mixed(tmp_path):
    with Bag(tmp_path / "both", "mcap", "p", PILLARS | XELA) as given:
        for k in range(N):
            time = EPOCH + 0.01 * k
            given.pillars("/hub_0/sensor_0", time, 1000 * (k + 1), time, np.ones((9, 3)))
            given.xela(time + 0.001, (1, "uSPa44", k, time, counts(16, k), []))
    recording = read(given.path)
    assert recording.metadata["clock"] == "bag"
    assert list(recording.modules) == ["finger1", "xServTopic/finger1"]


def test_definitions_are_not_needed_where_the_type_is_known(tmp_path):
    """As bags of ROS 2 before Iron, that keep types by name only."""
    with Bag(tmp_path / "grasp", "sqlite3", "xela_server_ros2", XELA) as given:
        for k in range(4):
            given.xela(EPOCH + k, (1, "uSPa44", k, EPOCH + k, counts(16, k), []))
    without_definitions(given.path)
    assert read(given.path).modules["finger1"].n_samples == 4


def test_pillars_of_ros2_before_definitions_were_stored(tmp_path):
    forces = np.random.default_rng(0).normal(size=(N, 9, 3)).astype(np.float32)
    with Bag(tmp_path / "pillars", "sqlite3", "sensor_interfaces", PILLARS_OF_ROS2) as given:
        for k in range(N):
            tus = 2000 * (k + 1)
            message = sensor_state_of_ros2(given.types, given.package, tus, forces[k])
            given.write("/hub_0/sensor_0", message, EPOCH + 0.002 * k)
    without_definitions(given.path)
    recording = read(given.path)
    assert recording.metadata["clock"] == "device"
    np.testing.assert_array_equal(recording.modules["finger1"].readings, forces)


def without_definitions(path):
    """Remove the definitions of messages from a bag."""
    import sqlite3

    (file,) = path.glob("*.db3")
    base = sqlite3.connect(file)
    base.execute("DELETE FROM message_definitions")
    base.commit()
    base.close()


def test_found_by_content_and_in_folders(tmp_path, bag):
    for name in ("grasp10", "grasp9"):
        with bag(name) as given:
            for k in range(3):
                given.xela(EPOCH + k, (1, "uSPa44", k, EPOCH + k, counts(16, k), []))
    assert [one.name for one in import_recordings(tmp_path)] == ["grasp9", "grasp10"]
    if given.ros2:
        (file,) = (one for one in given.path.iterdir() if one.name != "metadata.yaml")
        assert read(file).modules["finger1"].n_samples == 3
        assert not is_recording(file)


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_bag_whose_recorder_was_killed_has_no_metadata(tmp_path, storage):
    with Bag(tmp_path / "grasp", storage, "xela_server_ros2", XELA) as given:
        for k in range(3):
            given.xela(EPOCH + k, (1, "uSPa44", k, EPOCH + k, counts(16, k), []))
    (given.path / "metadata.yaml").unlink()
    assert read(given.path).modules["finger1"].n_samples == 3


def test_mcap_of_others_is_no_bag(tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "other.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("robot", "other")
        writer.finish()
    with pytest.raises(RecordingError, match=r"other\.mcap is no bag of ROS; a \.bag"):
        read(tmp_path / "other.mcap", format="rosbag")


def test_recordings_of_our_own_are_no_bags(tmp_path):
    save_recording(synthetic_recording("own", 0, ["thumb"]), tmp_path / "own.mcap")
    with pytest.raises(RecordingError, match="is of no supported format"):
        import_recordings(tmp_path / "own.mcap")
    with pytest.raises(RecordingError) as caught:
        import_recordings(tmp_path / "own.mcap", "rosbag")
    assert str(caught.value) == (
        f"{tmp_path / 'own.mcap'} is no bag of ROS; a .bag, .db3 or .mcap file of ROS expected"
    )


def test_the_command(tmp_path, bag, capsys):
    with bag() as given:
        for k in range(N):
            given.xela(EPOCH + 0.01 * k, (1, "uSPa44", k, EPOCH + 0.01 * k, counts(16, k), []))
    assert main(["import", str(given.path), str(tmp_path / "out")]) == 0
    assert "1 recording with 1 module and 30 samples" in capsys.readouterr().out
    assert load_recording(tmp_path / "out" / "grasp.parquet").modules["finger1"].n_samples == N


class TestRefusals:
    def test_unknown_topics(self, bag):
        with bag() as given:
            given.text(EPOCH)
        with pytest.raises(RecordingError) as caught:
            read(given.path)
        assert str(caught.value) == (
            f"{given.path} has no topic of a supported tactile sensor; it has "
            "/chatter (std_msgs/String); for numbers x, y, z of any topic: --topic /TOPIC=SENSOR"
        )

    def test_a_topic_without_samples(self, bag):
        with bag() as given:
            given.xela(EPOCH)
        with pytest.raises(RecordingError) as caught:
            read(given.path)
        assert str(caught.value) == (
            f"{given.path} has no messages on /xServTopic; at least one expected"
        )

    def test_another_number_of_taxels(self, bag):
        with bag() as given:
            given.xela(EPOCH, (1, "XR23AHRCPP", 1, EPOCH, counts(30), []))
        with pytest.raises(RecordingError) as caught:
            read(given.path)
        assert str(caught.value) == (
            f"{given.path}: 30 taxels given, 368 expected (XR23AHRCPP: allegro-uskin)"
        )

    def test_cut_and_damaged_bags(self, bag):
        with bag() as given:
            for k in range(N):
                given.xela(EPOCH + k, (1, "uSPa44", k, EPOCH + k, counts(16, k), []))
        path, whole = given.path, given.path
        if given.ros2:
            (whole,) = (file for file in path.iterdir() if file.suffix != ".yaml")
        commands = {
            ".bag": f"rosbag reindex {path}",
            ".db3": f"ros2 bag reindex {path}",
            ".mcap": f"mcap recover {whole} -o recovered.mcap",
        }
        data = whole.read_bytes()
        for size in range(100, len(data), len(data) // 7):
            whole.write_bytes(data[:size])
            for part in {path, whole}:
                with pytest.raises(RecordingError) as caught:
                    read(part)
                assert str(caught.value).startswith(f"{part} is cut or damaged: ")
                assert str(caught.value).endswith(f"; to recover it: {commands[whole.suffix]}")
                assert "\n" not in str(caught.value)

    def test_metadata_that_are_none(self, tmp_path):
        folder = tmp_path / "bag"
        folder.mkdir()
        for text in ("", "[1, 2", "a: 1", "rosbag2_bagfile_information: {version: 99}"):
            (folder / "metadata.yaml").write_text(text)
            with pytest.raises(RecordingError, match=r"bag is cut or damaged: [^\n]+$"):
                read(folder)
