"""Measure what `holdfast record --fsync` costs.

    uv run python benchmarks/record_fsync.py FOLDER

Record 360 taxels at 150 Hz for some seconds into FOLDER, without and with waits for the disk.
"""

import argparse
import os
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from holdfast.devices.sources import Arrival
from holdfast.live.recorder import Recorder
from holdfast.sensors import sensor

RATE = 150.0
SENSORS = {f"finger{k}": sensor("uskin-curved") for k in range(12)}


def main() -> None:
    """Record twice, and print the costs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=5.0)
    options = parser.parse_args()
    waits: list[float] = []
    original = os.fsync

    def timed(handle: int) -> None:
        begin = time.perf_counter()
        original(handle)
        waits.append(time.perf_counter() - begin)

    os.fsync = timed
    for fsync in (False, True):
        waits.clear()
        with TemporaryDirectory(dir=options.folder) as folder:
            begin = time.process_time()
            n_dropped = record(Path(folder) / "a.mcap", options.seconds, fsync)
            cpu = (time.process_time() - begin) / options.seconds
        spent = f"{len(waits)} waits, {1e3 * max(waits, default=0.0):.1f} ms at most, "
        spent += f"median {1e3 * float(np.median(waits or [0.0])):.1f} ms"
        print(f"fsync {fsync}: {100 * cpu:.1f} % of a core, {n_dropped} dropped, {spent}")


def record(path: Path, seconds: float, fsync: bool) -> int:
    """Record in real time; return the number of dropped samples."""
    chance = np.random.default_rng(0)
    shape = (64, len(SENSORS), 30, 3)
    readings = chance.integers(30_000, 30_100, shape).astype(np.uint16)
    begin = time.monotonic()
    with Recorder(path, SENSORS, fsync=fsync) as recorder:
        for k in range(round(seconds * RATE)):
            while time.monotonic() - begin < k / RATE:
                time.sleep(1e-3)
            samples = dict(zip(SENSORS, readings[k % 64], strict=True))
            recorder.put(Arrival(k / RATE, samples, received=time.monotonic()))
    return recorder.status.n_dropped


if __name__ == "__main__":
    main()
