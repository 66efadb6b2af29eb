"""Latency from packet to estimate: 368 taxels at 150 Hz over a socket.

`holdfast play` sends the whole hand from another process; this process detects the states. With
`--page` it also serves two WebSocket clients, one of which never reads. It reports the latency
from the last byte of a packet to the estimate, the lost packets, and the growth of the memory.

    uv run python benchmarks/live.py --minutes 10
    uv run python benchmarks/live.py --minutes 1 --page
"""

import argparse
import asyncio
import json
import resource
import subprocess
import sys
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from holdfast.detection import Model
from holdfast.devices.sources import open_source
from holdfast.io import save_recording
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamDetector
from holdfast.live.web.service import LiveService
from holdfast.synthetic import synthetic_recording
from holdfast.web.guard import Guard

FINGERS = ("thumb", "index", "middle", "ring")


def main() -> None:
    options = _options()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "hand.parquet"
        save_recording(synthetic_recording("hand", 0, FINGERS), path)
        player = _player(path, options.port)
        try:
            report = _measure(options)
        finally:
            player.terminate()
            player.wait()
    print(json.dumps(report, indent=1))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--port", type=int, default=5055)
    parser.add_argument("--page", action="store_true", help="serve the page, with two clients")
    return parser.parse_args()


def _player(path: Path, port: int) -> "subprocess.Popen[bytes]":
    words = ("play", str(path), "--whole-hand", "--port", str(port))
    holdfast = Path(sys.executable).with_name("holdfast")
    return subprocess.Popen([holdfast, *words], stderr=subprocess.DEVNULL)


def _measure(options: argparse.Namespace) -> dict[str, object]:
    model = Model.load("builtin:twin")
    with _connected(options.port) as source:
        session = Session(StreamDetector(model, source))
        log = np.zeros((int(60 * options.minutes * 400) + 10_000, 2))  # of constant size
        session.add_listener(lambda update: _log(update, log, session.n_packets))
        if options.page:
            threading.Thread(target=_serve, args=(session, model), daemon=True).start()
        session.start()
        time.sleep(5.0)
        begin, n_begin = _resident(), session.n_packets
        end = time.monotonic() + 60 * options.minutes
        half = 0.0
        while time.monotonic() < end:
            time.sleep(1.0)
            if not half and end - time.monotonic() < 30 * options.minutes:
                half = _resident()
        session.stop()
    latencies, times = log[n_begin : session.n_packets].T
    steps = np.diff(times)
    return {
        "taxels": sum(sensor.n_taxels for sensor in source.sensors.values()),
        "minutes": options.minutes,
        "page": options.page,
        "packets": len(latencies),
        "rate": round(1 / float(np.median(steps)), 2),
        "lost": session.n_lost,
        "refused": session.n_refused,
        "failure": repr(session.failure),
        "latency": {
            name: float(np.percentile(latencies, share))
            for name, share in (("p50", 50), ("p99", 99), ("p99.9", 99.9), ("max", 100))
        },
        "resident_megabytes": {"begin": begin, "half": half, "end": _resident()},
    }


def _connected(port: int):
    for _ in range(60):
        try:
            source = open_source(f"xela://127.0.0.1:{port}")
            source.open()
        except Exception:
            time.sleep(0.5)
        else:
            return source
    raise SystemExit("the player did not start")


def _log(update, log, n_packets: int) -> None:
    """Store the latency and the time of packet `n_packets`."""
    arrival = update.arrival
    if arrival is not None and arrival.samples:
        log[n_packets - 1] = time.monotonic() - arrival.received, arrival.time


def _serve(session: Session, model: Model) -> None:
    """Run the web service with a client that reads and one that never reads."""

    async def run() -> None:
        from aiohttp import ClientSession, web

        runner = web.AppRunner(LiveService(session, Guard("127.0.0.1")).app)
        await runner.setup()
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        url = f"http://127.0.0.1:{runner.addresses[0][1]}/api/v1/live"
        async with (
            ClientSession() as client,
            client.ws_connect(url) as reader,
            client.ws_connect(url.replace("live", "estimates")),  # never reads
        ):
            async for _ in reader:
                pass

    asyncio.run(run())


def _resident() -> float:
    """Return the resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return round(pages * resource.getpagesize() / 1e6, 1)


if __name__ == "__main__":
    main()
