"""Bags that were packed by the recorder are read like those that were not."""

import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed")

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

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
