import numpy as np
import pytest

from holdfast.devices.sources.xela.decoder import XelaDecoder
from holdfast.errors import RecordingError
from holdfast.io import import_recordings, save_recording
from holdfast.io.file_formats import is_recording
from holdfast.sensors import hand
from holdfast.synthetic import synthetic_recording
from holdfast_ros.sensor_messages import DeviceSample
from holdfast_ros.sources.message_assembler import MessageAssembler

pytest.importorskip("rosbags", reason="rosbags is not installed")

from devices.sources.xela import build as xela_packets
from ros.bag_writer import BagWriter, forget_definitions
from ros_messages import (
    PILLARS,
    PILLARS_OF_ROS2,
    XELA,
    counts,
    sensor_state,
    sensor_state_of_ros2,
)

EPOCH = 1_619_157_045.0
N = 30
STORAGES = ["sqlite3", "mcap", "ros1"]


def xela_bag(folder, storage="mcap", name="grasp"):
    package = "xela_server_ros" if storage == "ros1" else "xela_server_ros2"
    return BagWriter(folder / name, storage, package, XELA)


@pytest.fixture(params=STORAGES)
def any_bag(request, tmp_path):
    """A bag of XELA's messages, of each kind."""
    return xela_bag(tmp_path, request.param)


@pytest.fixture
def bag(tmp_path):
    """A bag of XELA's messages."""
    return xela_bag(tmp_path)


def write_pillars(bag, topic, time, tus, forces):
    """Write a message of a PapillArray, with the time of its own clock [us]."""
    message = sensor_state(bag.types, bag.package, tus, time, forces, ros2=bag.ros2)
    bag.write(topic, message, time)


def read(path, **given):
    (recording,) = import_recordings(path, **given)
    return recording


def test_separate_sensors_with_their_own_times(any_bag):
    samples = [(counts(30, k), counts(16, 100 + k)) for k in range(N)]
    with any_bag as given:
        for k, (thumb, tip) in enumerate(samples):
            time = EPOCH + 0.01 * k
            given.write("/chatter", given.make("std_msgs/msg/String", data="hello"), time)
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
    with xela_bag(tmp_path) as given:
        for k in range(4):
            given.xela(EPOCH + k, (1, model, k, EPOCH + k, counts(n_taxels, k), []))
    assembler = MessageAssembler()
    assembler.identify([DeviceSample(1, model, EPOCH, None, 0, counts(n_taxels), np.empty((0, 3)))])
    decoder = XelaDecoder()
    decoder.identify(xela_packets.text(0, [xela_packets.sensor(counts(n_taxels), model)]))
    imported = {name: module.sensor for name, module in read(given.path).modules.items()}
    assert imported == assembler.sensors
    assert imported == decoder.sensors


def test_a_whole_hand(tmp_path):
    allegro = hand("allegro-uskin")
    samples = [counts(368, k) for k in range(3)]
    with xela_bag(tmp_path, name="hand.1") as given:
        for k, flat in enumerate(samples):
            given.xela(EPOCH + k, (1, "XR23AHRCPP", k, EPOCH + k, flat, []))
    recording = read(given.path)
    assert recording.metadata["hand"] == "allegro-uskin"
    assert recording.name == "hand.1"
    assert list(recording.modules) == list(allegro.modules)
    for name, want in allegro.split(np.array(samples)).items():
        np.testing.assert_array_equal(recording.modules[name].readings, want)


def test_a_packet_that_was_sent_twice_counts_once(bag):
    with bag as given:
        for k in range(N):
            packet = (1, "uSPa44", k // 2, EPOCH + k // 2, counts(16, k // 2), [])
            given.xela(EPOCH + 0.5 * k, packet)
    module = read(given.path).modules["finger1"]
    assert module.n_samples == N // 2
    assert (np.diff(module.times) == 1).all()


@pytest.mark.parametrize("times", [[0.0] * 4, [1.0, 2.0, 1.5, 3.0]])
def test_where_the_device_has_no_good_clock_the_bags_is_taken(bag, times):
    with bag as given:
        for k, time in enumerate(times):
            given.xela(EPOCH + k, (1, "uSPa44", k, time, counts(16, k), []))
    recording = read(given.path)
    assert recording.metadata["clock"] == "bag"
    np.testing.assert_allclose(recording.modules["finger1"].times - EPOCH, range(4))


def test_a_sensor_that_is_off_and_one_that_changes(bag):
    with bag as given:
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


def test_pillars_of_two_sensors(tmp_path):
    forces = np.random.default_rng(0).normal(size=(2, N, 9, 3)).astype(np.float32)
    with BagWriter(tmp_path / "pillars", "mcap", "sensor_interfaces", PILLARS) as given:
        for k in range(N):
            for sensor in (1, 0):
                topic = f"/hub_0/sensor_{sensor}"
                write_pillars(given, topic, EPOCH + 0.001 * k, 1000 * (k + 1), forces[sensor, k])
    recording = read(given.path)
    assert recording.metadata["clock"] == "device"
    assert list(recording.modules) == ["finger1", "finger2"]
    for number, module in enumerate(recording.modules.values()):
        assert (module.sensor.name, module.unit) == ("papillarray", "N")
        np.testing.assert_array_equal(module.readings, forces[number])
        np.testing.assert_allclose(module.times, 0.001 * np.arange(1, N + 1))


def pillars_with(tmp_path, tus):
    """A bag with one message of a PapillArray for each time of its clock [us]."""
    with BagWriter(tmp_path / "pillars", "ros1", "papillarray_ros_v2", PILLARS) as given:
        for k, one in enumerate(tus):
            write_pillars(given, "/hub_0/sensor_0", EPOCH + 0.002 * k, one, np.full((9, 3), k))
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


def test_pillars_of_ros2_before_definitions_were_stored(tmp_path):
    forces = np.random.default_rng(0).normal(size=(N, 9, 3)).astype(np.float32)
    with BagWriter(tmp_path / "pillars", "sqlite3", "sensor_interfaces", PILLARS_OF_ROS2) as given:
        for k in range(N):
            tus = 2000 * (k + 1)
            message = sensor_state_of_ros2(given.types, given.package, tus, forces[k])
            given.write("/hub_0/sensor_0", message, EPOCH + 0.002 * k)
    forget_definitions(given.path)
    recording = read(given.path)
    assert recording.metadata["clock"] == "device"
    np.testing.assert_array_equal(recording.modules["finger1"].readings, forces)


@pytest.mark.parametrize("storage", STORAGES)
def test_found_by_content_and_in_folders(tmp_path, storage):
    for name in ("grasp10", "grasp9"):
        with xela_bag(tmp_path, storage, name) as given:
            for k in range(3):
                given.xela(EPOCH + k, (1, "uSPa44", k, EPOCH + k, counts(16, k), []))
    assert [one.name for one in import_recordings(tmp_path)] == ["grasp9", "grasp10"]
    if given.ros2:
        (given.path / "metadata.yaml").unlink()  # as if the recorder was killed
        (file,) = given.path.iterdir()
        for path in (given.path, file):
            assert read(path).modules["finger1"].n_samples == 3
        assert not is_recording(file)


def test_recordings_of_our_own_and_mcap_of_others_are_no_bags(tmp_path):
    from mcap.writer import Writer

    save_recording(synthetic_recording("own", 0, ["thumb"]), tmp_path / "own.mcap")
    with (tmp_path / "other.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("robot", "other")
        writer.finish()
    for name in ("own.mcap", "other.mcap"):
        with pytest.raises(RecordingError, match=f"{name} is no bag of ROS"):
            import_recordings(tmp_path / name, "rosbag")


def test_topics_without_samples(bag):
    with bag as given:
        given.write("/chatter", given.make("std_msgs/msg/String", data="hello"), EPOCH)
    with pytest.raises(RecordingError, match=r"/chatter .*--topic /TOPIC=SENSOR"):
        read(given.path)


def test_cut_and_damaged_bags(any_bag):
    with any_bag as given:
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
            text = f"^{part} is cut or damaged: .*; to recover it: {commands[whole.suffix]}$"
            with pytest.raises(RecordingError, match=text):
                read(part)
