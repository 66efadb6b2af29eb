import contextlib
import math
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from holdfast.contact import Fault
from holdfast.devices.sources import Arrival, open_source
from holdfast.devices.sources.base import notice_arrival
from holdfast.errors import OutputError, RecordingError
from holdfast.io import load_recording
from holdfast.io.mcap_writer import RecordingWriter
from holdfast.live import recorder as module
from holdfast.live.recorder import Recorder
from holdfast.sensors import sensor
from live.build import PATIENCE, wait_for

ANYSKIN = sensor("anyskin")
TWO = {"thumb": ANYSKIN, "index": ANYSKIN}


def readings(k, number=np.uint16):
    return np.full((5, 3), k, number)


def arrival(k, *names, time=None, **fields):
    at = k / 100 if time is None else time
    samples = {name: readings(k) for name in names or ("thumb",)}
    return Arrival(at, samples, received=at, **fields)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.mcap"


def test_arrivals_are_recorded_with_the_times_of_each_module(path):
    with Recorder(path, TWO, name="grasp", metadata={"object": "can"}) as recorder:
        for k in range(300):
            recorder.put(arrival(k, *("thumb", "index")[: 1 + (k % 3 == 0)]))
    recording = load_recording(path)
    assert recording.complete
    assert (recording.name, dict(recording.metadata)) == ("grasp", {"object": "can"})
    for name, ks in (("thumb", np.arange(300)), ("index", np.arange(0, 300, 3))):
        module = recording.modules[name]
        np.testing.assert_array_equal(module.times, ks / 100)
        np.testing.assert_array_equal(module.readings[:, 4, 2], ks)
        assert module.readings.dtype == np.uint16


def test_the_status_shows_the_progress(path):
    with Recorder(path, TWO) as recorder:
        assert recorder.status.seconds == 0.0
        for k in [*range(100), *range(150, 200)]:
            recorder.put(arrival(k, "thumb", n_lost=k == 150, n_refused=2 * (k == 7)))
        wait_for(lambda: recorder.status.n_samples == 150 and recorder.status.rate > 0)
        recorder.add_marker("one")
    status = recorder.status
    assert status.seconds == pytest.approx(1.99)
    assert status.modules == {"thumb": 150, "index": 0}
    assert (status.n_gaps, status.n_lost, status.n_refused, status.n_dropped) == (1, 1, 2, 0)
    assert (status.n_markers, status.n_bytes) == (1, path.stat().st_size)
    assert (status.failure, recorder.failed) == ("", False)


def test_markers_have_the_times_at_which_they_were_set(path):
    with Recorder(path, TWO) as recorder:
        recorder.add_marker("early")
        recorder.add_marker("before", 0.5)
        recorder.put(arrival(100))
        recorder.add_marker("at\nthe  newest\x00\ud800")
        recorder.put(arrival(101))
        recorder.add_marker("nowhere", math.inf)
        recorder.add_marker("x" * 1000, 1.005)
    assert load_recording(path).markers == (
        (1.0, "early"),
        (0.5, "before"),
        (1.0, "at the newest??"),
        (1.01, "nowhere"),
        (1.005, "x" * 200),
    )


def test_faults_and_notices_become_markers(path):
    gap = {"index": (Fault.PACKET_GAP,)}
    with Recorder(path, TWO) as recorder:
        recorder.put(arrival(0, "thumb", "index"))
        recorder.put(arrival(1, "thumb", "index", faults=gap))
        recorder.put(arrival(2, "thumb", "index", faults=gap))
        recorder.put(notice_arrival(0.02, "connection lost"))
        recorder.put(notice_arrival(0.03, faults={"thumb": (Fault.LATE,), "index": (Fault.LATE,)}))
        recorder.put(arrival(200, "thumb", "index"))
        recorder.put(arrival(300, "thumb", "index", faults=gap))
    assert load_recording(path).markers == (
        (0.01, "fault index packet_gap"),
        (0.02, "note: connection lost"),
        (0.02, "fault all late"),
        (3.0, "fault index packet_gap"),
    )
    assert recorder.status.faults == {Fault.PACKET_GAP: 3, Fault.LATE: 1}


def test_markers_of_a_replayed_recording_are_recorded_as_markers(path):
    first = path.with_name("first.mcap")
    with Recorder(first, TWO) as recorder:
        for k in range(100):
            recorder.put(arrival(k))
        for time, text in ((0.1, "closing"), (0.5, "mark"), (0.51, "mark"), (0.9, "note: a")):
            recorder.add_marker(text, time)
    with open_source(str(first), speed=0) as source, Recorder(path, TWO) as recorder:
        for one in source:
            recorder.put(one, wait=True)
    got, want = load_recording(path).markers, load_recording(first).markers
    assert [text for _, text in got] == [text for _, text in want]
    np.testing.assert_allclose([t for t, _ in got], [t for t, _ in want], atol=0.011)


def test_the_same_notice_is_a_marker_once_a_second(path):
    with Recorder(path, TWO) as recorder:
        for k in range(250):
            recorder.put(arrival(k, notices=("noise",)))
            recorder.put(notice_arrival(k / 100, f"notice {k}", f"notice {-k}"))
    markers = load_recording(path).markers
    assert [time for time, text in markers if text == "note: noise"] == [0.0, 1.0, 2.0]
    assert len(markers) <= 303


def test_samples_that_cannot_be_stored_are_dropped_and_reported(path):
    wrong = [
        (0.0, readings(1)),
        (-1.0, readings(1)),
        (math.nan, readings(1)),
        (math.inf, readings(1)),
        (9.0, readings(1)[:4]),
        (9.0, readings(0.5, np.float32)),
        (9.0, readings(-1, np.int64)),
        (9.0, readings(np.nan, np.float64)),
        (9.0, readings(1, np.complex128)),
        (9.0, readings("a", "U1")),
    ]
    right = [readings(7, np.int64), readings(8.0, np.float32), readings(9, ">u2")]
    with Recorder(path, TWO) as recorder:
        recorder.put(arrival(0))
        for when, values in wrong:
            recorder.put(Arrival(when, {"thumb": values}, received=when))
        for k, values in enumerate(right):
            recorder.put(Arrival(1.0 + k, {"thumb": values, "pinky": values}, received=0.0))
    thumb = load_recording(path).modules["thumb"]
    assert thumb.times.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert thumb.readings[:, 0, 0].tolist() == [0, 7, 8, 9]
    assert thumb.readings.dtype == np.uint16
    assert recorder.status.n_dropped == len(wrong)
    assert any(t == 0.0 and "sample of thumb" in text for t, text in load_recording(path).markers)


def test_everything_is_on_disk_soon_although_the_source_is_silent(path):
    with Recorder(path, TWO) as recorder:
        recorder.put(arrival(0))
        recorder.add_marker("silence")
        copy = path.with_name("copy.mcap")

        def has_all():
            shutil.copy(path, copy)
            with contextlib.suppress(RecordingError):  # it may be copied in mid-write
                return load_recording(copy).markers == ((0.0, "silence"),)
            return False

        wait_for(has_all)


def test_with_wait_no_sample_is_dropped(path, monkeypatch):
    monkeypatch.setattr(module, "MAX_QUEUED_ARRIVALS", 5)
    with Recorder(path, TWO) as recorder:
        for k in range(100):
            recorder.put(arrival(k), wait=True)
    assert (recorder.status.n_dropped, recorder.status.n_samples) == (0, 100)


def test_a_slow_disk_delays_no_caller_and_fills_no_memory(path, monkeypatch):
    monkeypatch.setattr(module, "MAX_QUEUED_ARRIVALS", 50)
    go_on, entered, append = threading.Event(), threading.Event(), RecordingWriter.append

    def slow(self, *given):
        entered.set()
        go_on.wait(PATIENCE)
        append(self, *given)

    monkeypatch.setattr(RecordingWriter, "append", slow)
    with Recorder(path, TWO) as recorder:
        recorder.put(arrival(0))
        assert entered.wait(PATIENCE)
        for k in range(1, 201):
            recorder.put(arrival(k))  # would block for ever if it waited
        assert recorder.status.n_dropped == 150
        go_on.set()
        wait_for(lambda: recorder.status.n_samples == 51)
        recorder.put(arrival(300))
    recording = load_recording(path)
    assert recording.modules["thumb"].readings[:, 0, 0].tolist() == [*range(51), 300]
    texts = [text for _, text in recording.markers]
    assert any("150 samples dropped" in text for text in texts)


def test_an_existing_file_is_kept_unless_forced(path):
    path.write_text("mine")
    for options in ({}, {"metadata": {"a": object()}, "force": True}):
        with pytest.raises((OutputError, RecordingError)):
            Recorder(path, TWO, **options)
        assert path.read_text() == "mine"
    with Recorder(path, TWO, force=True) as recorder:
        recorder.put(arrival(0))
    assert load_recording(path).complete


@pytest.mark.parametrize("harm", [Path.unlink, lambda path: os.truncate(path, 100)])
def test_a_file_that_another_program_harms_is_reported(path, harm):
    recorder = Recorder(path, TWO)
    recorder.put(arrival(0))
    wait_for(lambda: recorder.status.n_samples == 1)
    harm(path)
    recorder.put(arrival(1))
    with pytest.raises(OutputError, match=f"^cannot write {path}: "):
        recorder.close()
    assert recorder.failed
    assert not path.exists() or path.stat().st_size == 100


def test_with_fsync_what_was_written_a_second_ago_is_on_the_disk(path, monkeypatch):
    """By the record of each wait for the disk: when it ended, and how much was in the file."""
    waits, sync = [], os.fsync

    def record(handle):
        size = os.fstat(handle).st_size
        sync(handle)
        waits.append((time.monotonic(), size))

    assert module.SYNC_INTERVAL + module.FLUSH_INTERVAL < 1.0
    monkeypatch.setattr(os, "fsync", record)
    monkeypatch.setattr(module, "SYNC_INTERVAL", 0.1)
    monkeypatch.setattr(module, "FLUSH_INTERVAL", 0.02)
    with Recorder(path, {"thumb": ANYSKIN}, fsync=True) as recorder:
        for k in range(3):
            n_waits = len(waits)
            recorder.put(arrival(k))
            wait_for(lambda n_waits=n_waits: len(waits) > n_waits)
        wait_for(lambda: waits[-1][1] >= recorder.status.n_bytes and recorder.status.n_samples == 3)
    assert waits[-1][1] == path.stat().st_size


def test_an_error_in_the_thread_is_raised_by_close(path, monkeypatch):
    monkeypatch.setattr(RecordingWriter, "append", lambda *_: 1 / 0)
    recorder = Recorder(path, TWO)
    recorder.put(arrival(0))
    wait_for(lambda: recorder.failed)
    with pytest.raises(ZeroDivisionError):
        recorder.close()


FULL = """
import resource, sys
import numpy as np
from holdfast.devices.sources import Arrival
from holdfast.live.recorder import Recorder
from holdfast.sensors import sensor

recorder = Recorder(sys.argv[1], {"thumb": sensor("anyskin")})
noise = np.random.default_rng(0)
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, resource.RLIM_INFINITY))
for k in range(100_000):
    values = noise.integers(0, 65535, (5, 3)).astype(np.uint16)
    values[0, 0] = k
    recorder.put(Arrival(k / 100, {"thumb": values}, received=0.0), wait=True)
    if recorder.failed:
        break
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
recorder.close()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs limits of POSIX")
def test_a_full_disk_keeps_what_was_written(path):
    """Even if there is space again at the end: closing would make the file look damaged."""
    words = [sys.executable, "-c", FULL, str(path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert f"OutputError: cannot write {path}: " in done.stderr
    recording = load_recording(path)
    assert not recording.complete
    thumb = recording.modules["thumb"]
    np.testing.assert_array_equal(thumb.readings[:, 0, 0], np.arange(thumb.n_samples))
    assert 10_000 < path.stat().st_size <= 30_000


def test_the_time_of_the_session_is_that_of_the_quickest_arrival(tmp_path, monkeypatch):
    with Recorder(tmp_path / "a.mcap", {"thumb": ANYSKIN}) as recorder:
        assert math.isnan(recorder.session_time())
        for now, late in ((5.0, 0.3), (6.0, 0.1), (7.0, 0.2)):  # on their way
            samples = {"thumb": np.zeros((5, 3))}
            recorder.put(Arrival(1000.0 + now - late, samples, received=now))
        monkeypatch.setattr(module.time, "monotonic", lambda: 9.0)
        assert recorder.session_time() == pytest.approx(1008.9)
        monkeypatch.undo()
