"""Bags that were packed by the recorder are read like those that were not."""

import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed")

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from holdfast.errors import RecordingError
from holdfast_ros.bags import open_bag

N = 300
KIND = "std_msgs/msg/String"
DEFINITION = "string data\n"


def text(k):
    return f"text {k}".encode()


def found(path):
    with open_bag(path) as bag:
        assert [(one.name, one.n_messages) for one in bag.topics] == [("/a", N), ("/b", N)]
        messages = list(bag.messages(bag.topics))
    times = [round(time * 1e9) for _, time, _ in messages]
    assert times == sorted(times)
    return sorted((topic.name, data) for topic, _, data in messages)


EXPECTED = sorted((topic, text(k)) for topic in ("/a", "/b") for k in range(N))


def write(writer, **options):
    with writer:
        topics = [writer.add_connection(name, KIND, **options) for name in ("/a", "/b")]
        for k in range(N):
            for topic in topics:
                writer.write(topic, 1000 * k, text(k))


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("mode", list(CompressionMode))
def test_ros2(tmp_path, storage, mode):
    if storage is StoragePlugin.SQLITE3 and mode is CompressionMode.STORAGE:
        pytest.skip("there is no such bag")
    path = tmp_path / "bag"
    writer = Writer(path, version=9, storage_plugin=storage)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    write(writer, msgdef=DEFINITION, rihs01=f"RIHS01_{0:064x}")
    assert found(path) == EXPECTED


@pytest.mark.parametrize("kind", [None, *Writer1.CompressionFormat])
def test_ros1(tmp_path, kind):
    path = tmp_path / "a.bag"
    writer = Writer1(path)
    if kind is not None:
        writer.set_compression(kind)
    write(writer, msgdef=DEFINITION, md5sum="0" * 32)
    assert found(path) == EXPECTED


def test_a_file_that_is_named_twice(tmp_path):
    path = tmp_path / "bag"
    write(Writer(path, version=9), msgdef=DEFINITION, rihs01=f"RIHS01_{0:064x}")
    metadata = path / "metadata.yaml"
    (file,) = [one.name for one in path.iterdir() if one != metadata]
    metadata.write_text(metadata.read_text().replace(f"- {file}", f"- {file}\n  - {file}", 1))
    with pytest.raises(RecordingError, match=r"metadata\.yaml names a file twice"), open_bag(path):
        pass


@pytest.mark.parametrize("size", [200, 6000])
def test_a_database_that_is_cut_inside_a_page_or_a_message_gives_whole_messages(tmp_path, size):
    path = tmp_path / "bag"
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = writer.add_connection("/a", KIND, msgdef=DEFINITION, rihs01=f"RIHS01_{0:064x}")
        for k in range(8000 // size + 20):
            writer.write(topic, 1000 * k, f"{k:04}".encode() * (size // 4))
    (file,) = path.glob("*.db3")
    data, n_found = file.read_bytes(), set()
    for n_bytes in range(max(len(data) // 2, 30_000), len(data), 1100):
        file.write_bytes(data[:n_bytes])
        with open_bag(file) as bag:
            assert not bag.complete
            messages = [message for _, _, message in bag.messages(bag.topics)]
        assert all(message == message[:4] * (size // 4) for message in messages)
        n_found.add(len(messages))
    assert max(n_found) > min(n_found)
