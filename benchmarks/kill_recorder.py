"""Kill a recorder of a whole hand at 150 Hz many times, and check what can be read back.

python benchmarks/kill_recorder.py [--kills 20] [--flips 150] [--seed 0]

Every value is a function of the number of its sample, so that a wrong value is found. The exit
code is 1 if a kill lost more than 0.5 s, a value was wrong, or a flipped bit was not found.
"""

import argparse
import mmap
import random
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np

from holdfast.cli import main as holdfast
from holdfast.devices.sources import Arrival
from holdfast.errors import RecordingError
from holdfast.io import load_recording
from holdfast.live.recorder import Recorder
from holdfast.recordings import Recording
from holdfast.sensors import hand

RATE = 150.0
MAX_LOST_TIME = 0.5
HAND = hand("allegro-uskin")
SENSORS = {name: module.sensor for name, module in HAND.modules.items()}
N_VALUES = HAND.n_taxels * 3
FACTORS = np.arange(1, N_VALUES + 1, dtype=np.uint64) * np.uint64(40503)


def values(k: int) -> dict[str, np.ndarray]:
    """Return the readings of sample k, by module."""
    flat = (FACTORS * np.uint64(k + 1) >> np.uint64(3)).astype(np.uint16)
    return HAND.split(flat.reshape(-1, 3))


def record(path: str, progress: str) -> None:
    """Record until the process is killed; `progress` holds the number of recorded samples."""
    with Path(progress).open("r+b") as file:
        counter = mmap.mmap(file.fileno(), 8)
    recorder = Recorder(path, SENSORS)
    due = time.monotonic()
    for k in range(10**9):
        recorder.put(Arrival(k / RATE, values(k), received=time.monotonic()))
        counter[:8] = struct.pack("<Q", k + 1)
        due = max(due + 1 / RATE, time.monotonic())  # after a delay, continue at the same rate
        time.sleep(max(due - time.monotonic(), 0.0))


def kill_one(path: Path, seconds: float) -> int:
    """Kill a recorder after `seconds`, and return how many samples it had recorded."""
    progress = path.with_suffix(".progress")
    progress.write_bytes(bytes(8))
    words = [sys.executable, __file__, "--record", str(path), str(progress)]
    with subprocess.Popen(words) as process:
        while process.poll() is None and progress.read_bytes() == bytes(8):
            time.sleep(0.01)
        time.sleep(seconds)
        if process.poll() is not None:
            sys.exit("the recorder ended before it was killed")
        process.kill()
    return struct.unpack("<Q", progress.read_bytes())[0]


def check(recording: Recording, n_given: int) -> float:
    """Check the values, and return how much is missing at the end [s]."""
    lengths = {name: module.n_samples for name, module in recording.modules.items()}
    for k in range(max(lengths.values())):
        for name, want in values(k).items():
            if k < lengths[name] and not (
                np.array_equal(recording.modules[name].readings[k], want)
                and recording.modules[name].times[k] == k / RATE
            ):
                sys.exit(f"sample {k} of {name} came back wrong")
    if recording.complete:
        sys.exit("a recording that was cut is marked as complete")
    return (n_given - min(lengths.values())) / RATE


def recovered(path: Path, n_given: int) -> float:
    """Return how much of a cut file is missing [s], after reading and after importing it."""
    try:
        lost = check(load_recording(path), n_given)
    except RecordingError as refusal:
        if not str(refusal).endswith("nothing can be recovered: it has no samples"):
            raise
        return n_given / RATE
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()) as errors:
        code = holdfast(["import", str(path), str(path.parent / "out")])
    if code != 0:
        sys.exit(f"a file that was cut could not be imported: {errors.getvalue()}")
    if check(load_recording(path.parent / "out" / f"{path.stem}.parquet"), n_given) != lost:
        sys.exit("a file that was cut was not imported completely")
    return lost


def kills(folder: Path, n: int, chance: random.Random) -> list[float]:
    """Return the seconds lost by each of `n` kills, at random times in the first three seconds."""
    lost = []
    for number in range(n):
        path = folder / f"cut{number}.mcap"
        n_given = kill_one(path, chance.uniform(0.0, 3.0))
        lost.append(recovered(path, n_given))
    return lost


def flips(folder: Path, n: int, chance: random.Random) -> int:
    """Return how many of `n` flipped bits in a complete file are found."""
    path, damaged = folder / "whole.mcap", folder / "damaged.mcap"
    with Recorder(path, SENSORS) as recorder:
        for k in range(int(2 * RATE)):
            recorder.put(Arrival(k / RATE, values(k), received=k / RATE), wait=True)
            if k % 100 == 50:
                recorder.add_marker(f"mark {k}")
    raw = path.read_bytes()
    return sum(is_refused(damaged, raw, chance.randrange(8 * len(raw))) for _ in range(n))


def is_refused(path: Path, raw: bytes, bit: int) -> bool:
    """Return whether the file is refused when one bit is flipped."""
    copy = bytearray(raw)
    copy[bit // 8] ^= 1 << bit % 8
    path.write_bytes(copy)
    try:
        load_recording(path)
    except RecordingError:
        return True
    return False


def main(n_kills: int, n_flips: int, seed: int) -> None:
    chance = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        lost = kills(Path(name), n_kills, chance) or [0.0]
        n_found = flips(Path(name), n_flips, chance)
    print(
        f"{n_kills} kills lost {min(lost):.3f} to {max(lost):.3f} s, "
        f"median {statistics.median(lost):.3f} s; no value was wrong"
    )
    print(f"{n_found} of {n_flips} flipped bits found")
    sys.exit(int(max(lost) > MAX_LOST_TIME or n_found < n_flips))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--flips", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--record", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.record:
        record(*given.record)
    main(given.kills, given.flips, given.seed)
