import json
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from command_line import Verb
from holdfast.cli.terminal import progress
from holdfast.devices.sources import open_source
from holdfast.errors import SourceError
from holdfast.io import save_recording
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

PATIENCE = 30.0
"""Time after which a test fails [s]."""
FAST = 8


@pytest.fixture(scope="module")
def recording():
    """Return six seconds, from before the grasp to after the shaking."""
    whole = synthetic_recording("grasp", 3, ("thumb", "index", "middle", "ring"))
    return replace(whole, modules={n: m.slice(100, 1000) for n, m in whole.modules.items()})


@pytest.fixture(scope="module")
def path(recording, tmp_path_factory):
    path = tmp_path_factory.mktemp("play") / "grasp.parquet"
    save_recording(recording, path)
    return path


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Listener(threading.Thread):
    """Start a client in a thread that connects as soon as possible and reads `n` samples."""

    def __init__(self, uri, n):
        super().__init__()
        self.uri, self.n = uri, n
        self.arrivals, self.sensors = [], {}
        self.start()

    def run(self):
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline and not self.arrivals:
            try:
                with open_source(self.uri) as source:
                    self.sensors = source.sensors
                    while len(self.arrivals) < self.n and time.monotonic() < deadline:
                        arrival = source.read(0.1)
                        if arrival is not None and arrival.samples:
                            self.arrivals.append(arrival)
            except SourceError:
                time.sleep(0.02)


play = Verb("play").run


def test_json_has_the_address_and_the_number_of_packets(capsys, path, monkeypatch):
    monkeypatch.setattr(progress, "END_POLL_INTERVAL", 0.02)
    port = free_port()
    listener = Listener(f"xela://127.0.0.1:{port}", 900)
    words = ("--port", port, "--once", "--separate", "--speed", FAST, "--json")
    code, out, err = play(capsys, path, *words)
    listener.join()
    assert code == 0
    assert "1 client" in err.splitlines()
    begin, end = map(json.loads, out.splitlines())
    assert begin == {
        "uri": f"xela://127.0.0.1:{port}?fingers=1:thumb,2:index,3:middle,4:ring",
        "version": "1.8",
        "sensors": {"1": ["thumb"], "2": ["index"], "3": ["middle"], "4": ["ring"]},
        "source": str(path),
    }
    assert end == {"packets": 900}


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_it_repeats_until_it_is_interrupted(path, ending):
    program = "import sys; from holdfast.cli import main; sys.exit(main())"
    words = ["play", str(path), "--port", "0", "--speed", "50", "--json"]
    process = subprocess.Popen(
        [sys.executable, "-c", program, *words], stdout=subprocess.PIPE, text=True
    )
    with process:
        listener = Listener(json.loads(process.stdout.readline())["uri"], 1500)
        listener.join()
        process.send_signal(ending)
        out, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert json.loads(out)["packets"] >= 1500  # more than the recording has
    times = [a.time for a in listener.arrivals]
    assert len(times) == 1500 and (np.diff(times) > 0).all()


def orca_recording(path, n=300):
    """Three fingers of an ORCA hand at 100 Hz, pressed harder and harder."""
    times = np.arange(n) / 100
    modules = {
        name: Tactile(skin, times, 0.1 * np.arange(n)[:, None, None] * np.ones((skin.n_taxels, 3)))
        for name, skin in (
            ("thumb", sensor("orca-thumb")),
            ("middle", sensor("orca-finger")),
            ("pinky", sensor("orca-pinky")),
        )
    }
    save_recording(Recording("hand", modules), path)
    return path


def test_it_acts_as_an_orca_hand(tmp_path):
    """Each program that opens the port gets the recording from its beginning."""
    program = "import sys; from holdfast.cli import main; sys.exit(main())"
    path = orca_recording(tmp_path / "hand.parquet")
    words = ["play", str(path), "--orca", "--json"]
    process = subprocess.Popen(
        [sys.executable, "-c", program, *words], stdout=subprocess.PIPE, text=True
    )
    with process:
        start = json.loads(process.stdout.readline())
        for _ in range(2):
            listener = Listener(start["uri"], 60)
            listener.join()
            assert {n: s.name for n, s in listener.sensors.items()} == {
                "thumb": "orca-thumb", "middle": "orca-finger", "pinky": "orca-pinky"
            }  # fmt: skip
            counts = [
                np.rint(arrival.samples["middle"][:, 2] / 0.1) for arrival in listener.arrivals
            ]
            assert (np.ptp(counts, axis=1) == 0).all() and (np.diff(counts, axis=0) == 1).all()
            assert counts[0][0] < 100  # of 300
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=PATIENCE)
    assert start["sensors"] == {"1": ["thumb"], "3": ["middle"], "5": ["pinky"]}
    assert json.loads(out)["packets"] >= 120


def test_an_orca_hand_has_no_counts(capsys, path):
    code, _, err = play(capsys, path, "--orca")
    assert code == 2
    assert "thumb in count (twin:?sensor=orca-finger fits)" in err.splitlines()[-1]
