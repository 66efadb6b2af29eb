import errno
import os
import stat
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.errors import OutputError, RecordingError
from holdfast.io import load_recording
from holdfast.io.mcap_writer import RecordingWriter
from holdfast.sensors import sensor

ANYSKIN = sensor("anyskin")


def readings(n, number=np.uint16):
    return np.arange(n * 15).reshape(n, 5, 3).astype(number)


@settings(max_examples=30)
@given(cuts=st.lists(st.integers(0, 100), max_size=20))
def test_samples_come_back_however_they_were_given(cuts, tmp_path_factory):
    path = tmp_path_factory.mktemp("writer") / "a.mcap"
    times, values = np.arange(100) * 0.013 - 0.5, readings(100)
    edges = [0, *sorted(cuts), 100]
    with RecordingWriter(path, {"thumb": ANYSKIN, "none": ANYSKIN}) as writer:
        for first, last in pairwise(edges):
            given = values[first:last].copy()
            writer.append("thumb", times[first:last], given)
            given[:] = 0  # the arrays may be changed afterwards
    recording = load_recording(path)
    np.testing.assert_array_equal(recording.modules["thumb"].times, times)
    np.testing.assert_array_equal(recording.modules["thumb"].readings, values)
    assert recording.modules["thumb"].readings.dtype == np.uint16
    assert recording.modules["none"].n_samples == 0
    assert recording.complete


def test_all_that_was_said_comes_back(tmp_path):
    with RecordingWriter(
        tmp_path / "a.mcap",
        {"thumb": ANYSKIN},
        name="grasp",
        units={"thumb": "N"},
        metadata={"object": "can"},
        media=[("a.mp4", 0.5)],
    ) as writer:
        writer.append("thumb", [1.0], readings(1))
        writer.mark(1.0, "now")
    recording = load_recording(tmp_path / "a.mcap")
    assert (recording.name, recording.modules["thumb"].unit) == ("grasp", "N")
    assert recording.metadata == {"object": "can"}
    assert (recording.markers, recording.media) == (((1.0, "now"),), (("a.mp4", 0.5),))


def test_while_it_runs_at_most_half_a_second_is_missing(tmp_path):
    path, slow = tmp_path / "a.mcap", 0
    with RecordingWriter(path, {"thumb": ANYSKIN, "index": ANYSKIN}) as writer:
        for k in range(600):
            writer.append("thumb", [k / 150], readings(1))
            if k % 15 == 0:
                writer.append("index", [k / 150], readings(1))
                slow = k / 150
            if k > 75 and k % 50 == 0:
                modules = load_recording(path).modules
                assert modules["thumb"].times[-1] > k / 150 - 0.5
                assert modules["index"].times[-1] > slow - 0.5


def test_wrong_samples_are_refused(tmp_path):
    wrong = [
        ("pinky", [1.0], readings(1), "'pinky'"),
        ("thumb", [1.0], np.zeros((1, 30, 3)), r"thumb: .*\(1, 30, 3\)"),
        ("thumb", [1.0], readings(1, np.float32), "thumb: .*float32"),
        ("thumb", [0.0], readings(1), "thumb: .*times"),
        ("thumb", [np.nan], readings(1), "thumb: .*times"),
        ("thumb", [1.0], readings(1, np.float16), "thumb are float16"),
    ]
    with RecordingWriter(tmp_path / "a.mcap", {"thumb": ANYSKIN}) as writer:
        writer.append("thumb", [0.0], readings(1))
        for module, times, values, text in wrong:
            with pytest.raises(RecordingError, match=text):
                writer.append(module, times, values)
    assert load_recording(tmp_path / "a.mcap").modules["thumb"].n_samples == 1


def test_nothing_is_overwritten_unless_forced(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_text("mine")
    with pytest.raises(OutputError, match="exists already"):
        RecordingWriter(path, {"thumb": ANYSKIN})
    assert path.read_text() == "mine"
    with RecordingWriter(path, {"thumb": ANYSKIN}, force=True) as writer:
        writer.append("thumb", [0.0], readings(1))
    assert load_recording(path).complete


def test_a_full_disk(tmp_path, monkeypatch):
    writer = RecordingWriter(tmp_path / "a.mcap", {"thumb": ANYSKIN})

    def full(data):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(
        "holdfast.io.output_stream.UnbufferedStream.write", lambda self, data: full(data)
    )
    with pytest.raises(OutputError, match="No space left on device"):
        writer.append("thumb", np.arange(100) * 0.1, readings(100))
    with pytest.raises(OutputError, match="No space left on device"):
        writer.close()
    writer.close()


def test_flushed_samples_are_on_disk(tmp_path):
    path = tmp_path / "a.mcap"
    with RecordingWriter(path, {"thumb": ANYSKIN, "index": ANYSKIN}) as writer:
        for k in range(30):
            writer.append("thumb", [k / 150], readings(1))
            writer.mark(k / 150, str(k), at_once=False)
            writer.flush()
            recording = load_recording(path)
            assert recording.modules["thumb"].n_samples == len(recording.markers) == k + 1
            assert writer.n_bytes == path.stat().st_size
    recording = load_recording(path)
    assert (recording.complete, recording.modules["thumb"].n_samples) == (True, 30)


SENSORS = {"thumb": sensor("anyskin")}


def test_two_writers_of_one_file_are_refused(tmp_path):
    path = tmp_path / "a.mcap"
    with RecordingWriter(path, SENSORS) as first:
        first.append("thumb", [0.0, 0.01], np.zeros((2, 5, 3)))
        first.flush()
        with pytest.raises(OutputError, match=f"{path} is being recorded"):
            RecordingWriter(path, SENSORS, force=True)
    assert load_recording(path).complete
    with RecordingWriter(path, SENSORS, force=True) as second:
        second.append("thumb", [5.0], np.zeros((1, 5, 3)))
    assert load_recording(path).modules["thumb"].times.tolist() == [5.0]


def test_a_pipe_is_no_output(tmp_path):
    os.mkfifo(tmp_path / "a.mcap")
    with pytest.raises(OutputError, match=r"a\.mcap"):
        RecordingWriter(tmp_path / "a.mcap", SENSORS, force=True)


def test_with_fsync_the_writer_waits_for_the_disk(tmp_path, monkeypatch):
    synced, sync = [], os.fsync
    monkeypatch.setattr(os, "fsync", lambda handle: (synced.append(os.fstat(handle)), sync(handle)))
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, SENSORS, fsync=True)
    assert [stat.S_ISDIR(one.st_mode) for one in synced] == [False, True]
    writer.append("thumb", [0.0, 0.01], np.zeros((2, 5, 3)))
    writer.flush()
    writer.sync()
    assert synced[-1].st_size == path.stat().st_size
    writer.close()
    assert len(synced) == 4
    assert synced[-1].st_size == path.stat().st_size
    with RecordingWriter(tmp_path / "b.mcap", SENSORS) as plain:
        plain.append("thumb", [0.0], np.zeros((1, 5, 3)))
    assert len(synced) == 4
