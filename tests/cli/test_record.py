import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import threading
import time

import numpy as np
import pytest

from command_line import Verb
from holdfast.contact import Fault
from holdfast.devices import sources
from holdfast.devices.sources import Arrival
from holdfast.devices.sources.base import Source, notice_arrival
from holdfast.errors import SourceError
from holdfast.io import load_recording, save_recording
from holdfast.live import recorder_setup
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

ANYSKIN = sensor("anyskin")
PATIENCE = 30.0
RUN = """
import os, sys
from holdfast.cli import main
if sys.stdin.isatty():
    os.close(os.open(os.ttyname(0), os.O_RDWR))  # our terminal, we being in the foreground
sys.exit(main())
"""


@pytest.fixture(scope="module")
def grasp(tmp_path_factory):
    path = tmp_path_factory.mktemp("grasp") / "grasp.parquet"
    save_recording(synthetic_recording("grasp", 1, ("thumb", "index")), path)
    return path


class Device(Source):
    """Source that gives the arrivals of a list, then sends nothing more, or ends."""

    name = "xela://fake"
    paced = False

    def __init__(self, arrivals, ends=True):
        self.sensors = {"thumb": ANYSKIN, "thumb/1": ANYSKIN}
        self.metadata = {"source": "xela://fake", "hand": "allegro"}
        self.left = list(arrivals)
        self.ends = ends

    def open(self):
        if self.left == ["away"]:
            raise SourceError("xela://fake cannot be reached")

    def read(self, timeout):
        if self.left:
            return self.left.pop(0)
        time.sleep(timeout)
        return None

    @property
    def ended(self):
        return self.ends and not self.left

    def close(self):
        self.left = []


@pytest.fixture
def device(monkeypatch):
    """Make `open_source` return a device with these arrivals."""

    def arrange(*arrivals, ends=True):
        made = Device(arrivals, ends)
        monkeypatch.setattr(sources, "open_source", lambda text, speed=1.0, loop=False: made)
        return made

    return arrange


def arrival(k, **fields):
    values = np.full((5, 3), k, np.uint16)
    return Arrival(k / 100, {"thumb": values, "thumb/1": values}, k / 100, **fields)


VERB = Verb("record")
run = VERB.run


def refusal(capsys, *words):
    code, printed, err = run(capsys, *words)
    assert (code, printed) == (2, "")
    return err.splitlines()[-1]


def test_records_a_recording_as_it_is(capsys, grasp, tmp_path):
    out = tmp_path / "copy.mcap"
    code, printed, err = run(capsys, grasp, out, "--speed", "0")
    copy, want = load_recording(out), load_recording(grasp)
    assert code == 0
    assert copy.complete
    for name, module in want.modules.items():
        np.testing.assert_array_equal(copy.modules[name].times, module.times)
        np.testing.assert_array_equal(copy.modules[name].readings, module.readings)
    n = want.modules["thumb"].n_samples
    assert f"{n} samples of 2 modules in {out}" in printed
    assert err.splitlines()[-1] == f"next: holdfast info {out}"


def test_json_of_a_recording_in_a_folder(capsys, device, tmp_path):
    gap = {"thumb": (Fault.PACKET_GAP,)}
    came = [arrival(k) for k in range(50)]
    came += [arrival(k, faults=gap, n_lost=20, n_refused=1) for k in (70,)]
    came += [arrival(k) for k in range(71, 121)]
    device(*came, arrival(3))
    document = VERB.document(capsys, "xela://fake", tmp_path / "a" / "b", "--object", "../a can/")
    (out,) = (tmp_path / "a" / "b").iterdir()
    assert re.fullmatch(r"a_can-\d{8}-\d{6}\.mcap", out.name)
    assert document == {
        "path": str(out),
        "seconds": 1.2,
        "n_samples": {"thumb": 101, "thumb/1": 101},
        "rate": pytest.approx(100 / 1.2),
        "n_gaps": 1,
        "n_lost": 20,
        "n_refused": 1,
        "n_dropped": 1,
        "n_bytes": out.stat().st_size,
        "n_markers": len(load_recording(out).markers),
        "faults": {"packet_gap": 1},
        "complete": True,
    }


def test_metadata_of_the_options(capsys, device, tmp_path):
    device(arrival(0), arrival(1))
    out = tmp_path / "a.mcap"
    words = ("--object", "can", "--case", "2", "--set", "operator=Ann=Bo")
    words += ("--set", "repeat=3", "--set", "object_mass=0.25")
    run(capsys, "xela://fake", out, *words)
    recording = load_recording(out)
    metadata = dict(recording.metadata)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", metadata.pop("recorded_at"))
    assert metadata == {
        "source": "xela://fake",
        "hand": "allegro",
        "object": "can",
        "case": "2",
        "operator": "Ann=Bo",
        "repeat": 3,
        "object_mass": 0.25,
    }
    assert list(tmp_path.iterdir()) == [out]


def test_it_stops_after_the_time(capsys, device, tmp_path):
    device(*(arrival(k) for k in range(100, 1000)), ends=False)
    run(capsys, "xela://fake", tmp_path / "a.mcap", "--seconds", "2")
    times = load_recording(tmp_path / "a.mcap").modules["thumb"].times
    np.testing.assert_array_equal(times, np.arange(100, 300) / 100)


def test_it_stops_although_the_source_is_silent(capsys, device, tmp_path, monkeypatch):
    monkeypatch.setattr(recorder_setup, "EXTRA_TIME", 0.1)
    device(arrival(0), notice_arrival(0.0, "connection\x1b lost"), ends=False)
    code, _, err = run(capsys, "xela://fake", tmp_path / "a.mcap", "--seconds", "0.3")
    assert code == 0
    assert "connection? lost" in err.splitlines()
    recording = load_recording(tmp_path / "a.mcap")
    assert (recording.complete, recording.modules["thumb"].n_samples) == (True, 1)


def test_a_file_is_replaced_only_by_samples_and_with_force(capsys, device, tmp_path):
    out = tmp_path / "a.mcap"
    out.write_text("mine")
    device("away")
    assert refusal(capsys, "xela://fake", out, "--force").endswith("cannot be reached")
    assert out.read_text() == "mine"
    device(arrival(0))
    assert run(capsys, "xela://fake", out, "--force")[0] == 0
    assert load_recording(out).complete
    device(notice_arrival(0.0, "hello"))
    assert "xela://fake" in refusal(capsys, "xela://fake", tmp_path / "b.mcap")
    assert list(tmp_path.iterdir()) == [out]


class Child:
    """The verb in another process, on another terminal."""

    def __init__(self, *words, stdin=None):
        self.master, self.terminal = pty.openpty()
        self.before = termios.tcgetattr(self.terminal)
        self.output = b""
        self.process = subprocess.Popen(
            [sys.executable, "-c", RUN, "record", *map(str, words)],
            stdin=self.terminal if stdin is None else stdin,
            stdout=subprocess.PIPE,
            stderr=self.terminal,
            start_new_session=True,
            env=os.environ | {"TERM": "xterm", "COLUMNS": "200"},
        )

    def wait_for(self, *words):
        end = time.monotonic() + PATIENCE
        while not all(one in self.output for one in words):
            assert time.monotonic() < end, self.output
            if select.select([self.master], [], [], 0.1)[0]:
                self.output += os.read(self.master, 65536)

    def finish(self):
        """Return the exit code and the output; the terminal must be restored."""
        reader = threading.Thread(target=self._swallow, daemon=True)
        reader.start()
        printed = self.process.communicate(timeout=PATIENCE)[0]
        assert termios.tcgetattr(self.terminal) == self.before
        os.close(self.terminal)
        reader.join(PATIENCE)
        os.close(self.master)
        return self.process.returncode, printed.decode()

    def _swallow(self):
        try:
            while data := os.read(self.master, 65536):
                self.output += data
        except OSError:
            pass


def test_keys_set_markers_and_stop_and_the_terminal_is_restored(grasp, tmp_path):
    out = tmp_path / "a.mcap"
    child = Child(grasp, out, "--json")
    child.wait_for(b"keys: c closing", b" Hz")
    os.write(child.master, b"cl")
    child.wait_for(b"markers 2")
    os.write(child.master, b"D r3xq")
    code, printed = child.finish()
    assert (code, json.loads(printed)["n_markers"]) == (0, 6)
    recording = load_recording(out)
    assert [text for _, text in recording.markers] == [
        *("closing", "locked", "disturbance", "mark", "released", "mark 3")
    ]


@pytest.mark.parametrize("number", [None, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_or_a_signal_stops_it(number, grasp, tmp_path):
    out = tmp_path / "a.mcap"
    child = Child(grasp, out)
    child.wait_for(b" Hz")
    if number is None:
        os.write(child.master, b"\x03")
    else:
        os.kill(child.process.pid, number)
    code, printed = child.finish()
    assert (code, printed.count("\n")) == (0, 1)
    assert load_recording(out).complete


def test_lines_of_a_pipe_set_markers(grasp, tmp_path):
    out = tmp_path / "a.mcap"
    words = [sys.executable, "-c", RUN, "record", str(grasp), str(out), "--seconds", "3"]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdin.write(b"closing\n\nq\n\xff half a ")
        process.stdin.flush()
        assert process.stderr.readline()
        process.stdin.write(b"line")
        process.stdin.close()
        assert b"Ctrl-C stops" in process.stderr.read()
    assert process.returncode == 0
    texts = [text for _, text in load_recording(out).markers]
    assert texts == ["closing", "q", "\ufffd half a line"]


def test_a_camera_is_recorded_beside_the_samples(grasp, tmp_path, capsys):
    cv2 = pytest.importorskip("cv2")
    film = tmp_path / "camera.avi"
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"MJPG"), 50.0, (64, 48))
    for _ in range(20):
        writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    out = tmp_path / "run.mcap"
    assert run(capsys, grasp, out, "--camera", film, "--seconds", "2")[0] == 0
    stamps = np.array((tmp_path / "run.times").read_text().split(), float)
    assert load_recording(out).start - 0.1 < stamps[0] < stamps[-1]  # the clock of the samples
    assert (tmp_path / "run.mp4").stat().st_size > 0
