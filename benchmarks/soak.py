"""An accelerated day: 24 hours of a whole hand at 150 Hz through detect, serve and record.

A packet of 368 taxels is decoded as from XELA's server, detected, recorded to MCAP, and shown on
the page to two WebSocket clients, one of which never reads. Packets follow each other as fast as
they are processed; their stamps are 1/150 s apart. A recording ends after `--recording` seconds of
stamps, and its file is removed: the index of an MCAP file stays in memory until it ends. The
report has, for each tenth of the run, memory, file descriptors, threads, the time from packet to
estimate, changes of state a minute, and how far clock and tare have moved since the start: the
time of an estimate against the number of its packet, and a packet of the grasp less its tare
against the same packet of the first grasp.

    uv run python benchmarks/soak.py                      # the whole day
    nice -n 15 uv run python benchmarks/soak.py --minutes 10
    nice -n 15 uv run python benchmarks/soak.py --minutes 10 --from 3.5   # the part after 3.5 hours
"""

import argparse
import asyncio
import json
import resource
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from aiohttp import ClientSession

from holdfast.devices.sources.base import DeviceSource
from holdfast.devices.sources.xela.decoder import XelaDecoder
from holdfast.devices.sources.xela.encoder import XelaEncoder
from holdfast.live.recorder import Recorder
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamDetector, StreamUpdate
from holdfast.live.web.service import LiveService
from holdfast.model import Model
from holdfast.sensors import hand
from holdfast.synthetic import synthetic_recording
from holdfast.web.guard import Guard
from holdfast.web.server import listening

RATE = 150.0
DAY, HOUR = 24 * 3600.0, 3600.0
FINGERS = ("thumb", "index", "middle", "ring")
EPOCH = 1.7e9
STAMP, COUNTER = 1234567890.5, b'"message":'
N_WINDOWS = 10
MAX_AHEAD = 2000
"""Packets that may wait for the recorder before the source waits [packets]."""


class Day(DeviceSource):
    """Source of the packets of a grasp that is repeated, each with a new stamp and counter.

    Attributes:
        n: number of packets so far.
        n_before: number of packets when the recorder was started.
        begun: when the newest packet was begun, by `time.perf_counter` [s].
    """

    paced = False

    def __init__(self, first: int, n_packets: int) -> None:
        super().__init__()
        self.n, self.begun, self.n_packets = first, 0.0, n_packets
        self.recorder: Recorder | None = None
        self.n_before = first
        self._templates = templates()
        self.n_templates = len(self._templates)
        self._decoder = XelaDecoder()
        self._decoder.identify(self._packet(0))
        self.sensors = self._decoder.sensors
        self.begin_reading(0.0)

    @property
    def ended(self) -> bool:
        """Whether the day is over."""
        return self.n >= self.n_packets

    def open(self) -> None:
        """Do nothing: there is no device."""

    def receive(self, timeout: float) -> bool:
        if self.n % 256 == 0:
            self._wait_for_the_recorder()
        packet = self._packet(self.n)
        self.begun = time.perf_counter()
        received = self.n / RATE
        self.queue(self._decoder.decode(packet, received), received)
        self.n += 1
        return True

    def _wait_for_the_recorder(self) -> None:
        """Wait until the recorder has written all but the newest packets."""
        while self.recorder is not None and not self.recorder.status.failure:
            if self.n - self.n_before - self.recorder.status.n_samples < MAX_AHEAD:
                return
            time.sleep(0.002)

    def _packet(self, k: int) -> bytes:
        before, after = self._templates[k % len(self._templates)]
        stamp = b"%.6f" % (EPOCH + k / RATE)
        return (before + b"%d" % (k + 1) + after).replace(b"1234567890.5", stamp)

    def reconnect(self) -> bool:
        return True

    def disconnect(self) -> None:
        pass


def templates() -> list[tuple[bytes, bytes]]:
    """Return the packets of a grasp, each in two parts around its counter."""
    grasp = synthetic_recording("hand", 0, FINGERS)
    sensors = {name: module.sensor for name, module in hand("allegro-uskin").modules.items()}
    encoder, found = XelaEncoder(sensors, whole_hand=True), []
    rest = {name: np.full((s.n_taxels, 3), 32768, np.uint16) for name, s in sensors.items()}
    for k in range(next(iter(grasp.modules.values())).n_samples):
        samples = rest | {name: one.readings[k] for name, one in grasp.modules.items()}
        before, _, after = encoder.packet(samples, STAMP, STAMP).partition(COUNTER)
        found.append((before + COUNTER, after.lstrip(b"0123456789 ")))
    return found


class Soak:
    """Run of a day, with the figures of each of its windows."""

    def __init__(self, folder: Path, options: argparse.Namespace) -> None:
        self._folder, self._minutes = folder, options.minutes
        self._recording_length = round(options.recording * RATE)
        self._first = round(options.start * HOUR * RATE)
        self._source = Day(self._first, round(options.hours * HOUR * RATE))
        self._stream = StreamDetector(Model.load("builtin:twin"), self._source)
        self._session = Session(self._stream)
        self._zero: float | None = None
        self._tared: dict[str, np.ndarray] = {}
        self._n_changes = self._n_counted = 0
        self._clock_drift = self._tare_drift = 0.0
        self._service = LiveService(self._session, Guard("127.0.0.1"), None)
        self._times = np.full(20_000, np.nan)
        self._dropped = self._n_recordings = self._n_read = 0
        self._ended = threading.Event()

    def run(self) -> dict[str, object]:
        """Run, and return the report."""
        page = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)
        self._session.add_listener(self._put)
        self._next_recording()
        page.start()
        begin = time.monotonic()
        self._session.start()
        windows = []
        for k in range(N_WINDOWS):
            self._wait(begin, (k + 1) / N_WINDOWS)
            windows.append(self._figures(time.monotonic() - begin))
        self._ended.set()
        self._session.stop()
        page.join()
        self._stop_recording()
        if self._session.failure is not None:
            raise self._session.failure
        return self._report(windows, time.monotonic() - begin)

    def _wait(self, begin: float, share: float) -> None:
        """Wait for a share of the day, or of the minutes."""
        while (
            self._source.n < self._first + share * (self._source.n_packets - self._first)
            and time.monotonic() - begin < share * 60 * self._minutes
            and not self._session.ended
        ):
            time.sleep(0.05)

    def _put(self, update: StreamUpdate) -> None:
        """Record an arrival, and take the time from packet to estimate."""
        self._times[self._source.n % len(self._times)] = time.perf_counter() - self._source.begun
        if update.arrival is not None:
            if self._source.recorder is not None:
                self._source.recorder.put(update.arrival)
            self._compare(update)
        if self._source.n % self._recording_length == 0:
            self._next_recording()

    def _compare(self, update: StreamUpdate) -> None:
        """Count the changes of state, and compare clock and tare with those of the first grasp."""
        self._n_changes += len(update.events)
        n, period = self._source.n, self._source.n_templates
        if len(update.estimates) == 1:  # and not those of the start, which wait for the rate
            zero = update.estimates[0].estimate.time - n / RATE
            self._zero = zero if self._zero is None else self._zero
            self._clock_drift = max(self._clock_drift, abs(zero - self._zero))
        if n % period == 0 and update.arrival is not None:
            tared = self._stream.subtract_tare(update.arrival.samples)
            for finger, values in tared.items():
                first = self._tared.setdefault(finger, values)
                moved = float(np.abs(values - first).max())
                self._tare_drift = max(self._tare_drift, moved)

    def _next_recording(self) -> None:
        self._stop_recording()
        path = self._folder / f"{self._n_recordings}.mcap"
        self._n_recordings += 1
        self._source.n_before = self._source.n
        self._source.recorder = Recorder(path, self._source.sensors)

    def _stop_recording(self) -> None:
        recorder, self._source.recorder = self._source.recorder, None
        if recorder is not None:
            recorder.close()
            self._dropped += recorder.status.n_dropped
            recorder.path.unlink()

    async def _serve(self) -> None:
        """Run the page with a client that reads and one that never does."""
        async with listening(self._service.app, "127.0.0.1", 0) as url, ClientSession() as client:
            live = f"{url}api/v1/live"
            async with (
                client.ws_connect(live, max_msg_size=0) as reader,
                client.ws_connect(live.replace("live", "estimates"), autoping=False),
            ):
                async for _ in reader:
                    self._n_read += 1
                    if self._ended.is_set():
                        return

    def _figures(self, seconds: float) -> dict[str, float]:
        if self._session.failure is not None:
            raise self._session.failure
        known = self._times[np.isfinite(self._times)]
        p50, p99 = np.percentile(known, (50, 99)).tolist()
        minutes = (self._source.n - max(self._n_counted, self._first)) / RATE / 60.0
        n_changes, self._n_changes, self._n_counted = self._n_changes, 0, self._source.n
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return {
            "seconds": round(seconds, 1),
            "hours_of_stamps": round(self._source.n / RATE / HOUR, 3),
            "resident_megabytes": round(pages * resource.getpagesize() / 1e6, 1),
            "descriptors": len(list(Path("/proc/self/fd").iterdir())),
            "threads": threading.active_count(),
            "p50": round(p50, 6),
            "p99": round(p99, 6),
            "changes_a_minute": round(n_changes / max(minutes, 1e-9), 2),
            "clock_drift": round(self._clock_drift, 6),
            "tare_drift": round(self._tare_drift, 6),
        }

    def _report(self, windows: list[dict[str, float]], seconds: float) -> dict[str, object]:
        stamps = (self._source.n - self._first) / RATE
        return {
            "taxels": sum(sensor.n_taxels for sensor in self._source.sensors.values()),
            "packets": self._source.n - self._first,
            "from_hours": self._first / RATE / HOUR,
            "share_of_the_day": round(stamps / DAY, 4),
            "speed": round(stamps / seconds, 1),
            "refused": self._session.n_refused,
            "lost": self._session.n_lost,
            "dropped_by_the_recorder": self._dropped,
            "recordings": self._n_recordings,
            "documents_read": self._n_read,
            "windows": windows,
        }


def main() -> None:
    """Run for a day of stamps, or for some minutes, and print the report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=float("inf"))
    parser.add_argument("--hours", type=float, default=24.0, help="length of the day")
    parser.add_argument("--from", dest="start", type=float, default=0.0, help="hour of the start")
    parser.add_argument("--recording", type=float, default=HOUR, help="length of recordings [s]")
    options = parser.parse_args()
    with TemporaryDirectory() as folder:
        report = Soak(Path(folder), options).run()
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
