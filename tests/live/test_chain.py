"""The whole chain on this machine: a recording is sent as by a XELA server, detected."""

import json
import math
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest

from holdfast.detection import detect
from holdfast.devices.sources import open_source
from holdfast.live.stream_detector import StreamDetector

from . import build

HOLDFAST = Path(sys.executable).with_name("holdfast")
PATIENCE = 120.0


@contextmanager
def verb(*words):
    """Run a command in a separate process, and yield its first JSON line; end it with Ctrl-C."""
    process = subprocess.Popen(
        [HOLDFAST, *map(str, words), "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    late = threading.Timer(PATIENCE, process.kill)
    late.start()
    try:
        line = process.stdout.readline()
        if not line:
            pytest.fail(f"holdfast {words[0]} printed nothing: {process.stderr.read()}")
        yield json.loads(line)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()
        late.cancel()


FINGERS = ("thumb", "index", "middle", "ring")


@pytest.mark.parametrize("words", [("--separate",), ("--whole-hand", "--version", "1.7")])
def test_estimates_over_the_network_are_those_of_the_recording(tmp_path, monkeypatch, words):
    for name in ("MIN_LATE_DELAY", "MIN_CLOCK_JUMP"):  # a busy machine is late
        monkeypatch.setattr(f"holdfast.devices.sources.timeline.{name}", math.inf)
    monkeypatch.setattr("holdfast.live.stream_detector.MIN_SILENCE_TIMEOUT", PATIENCE)
    path, recording = build.grasp_file(tmp_path, fingers=FINGERS)
    model = build.model()
    with (
        verb("play", path, "--once", "--speed", 3, "--port", 0, *words) as printed,
        open_source(printed["uri"]) as source,
    ):
        detector = StreamDetector(model, source)
        estimates, n_lost = [], 0
        while len(estimates) < recording.modules["thumb"].n_samples:
            arrival, new, _ = detector.read()
            estimates += new
            n_lost += 0 if arrival is None else arrival.n_lost
    assert n_lost == 0
    expected = detect(model, recording)
    assert tuple(detector.fingers) == FINGERS
    for name, trace in expected.fingers.items():
        mine = [one.estimate.fingers[name] for one in estimates]
        assert [one.time - mine[0].time for one in mine] == pytest.approx(
            (trace.times - trace.times[0]).tolist(), abs=1e-6
        )
        on_time = [k for k, one in enumerate(mine) if not one.faults]  # a busy machine is late
        assert len(on_time) > 0.3 * len(mine)
        for k in on_time:
            live, offline = mine[k], trace.estimate(k)
            assert build.same(live, msgspec.structs.replace(offline, time=live.time))
