"""Kills a recorder of a whole hand at 150 Hz again and again: what is lost, what is read back?

python benchmarks/kill_recorder.py [--kills 20] [--flips 150] [--seed 0]

Every value is a function of the number of its sample, so that a wrong one is seen. Exits with
1 where a kill lost more than 0.5 s, a value came back wrong, or a flipped bit was not found.
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
from holdfast.errors import RecordingError
from holdfast.io import load_recording
from holdfast.live.recorder import Recorder
from holdfast.recordings import Recording
from holdfast.sensors import hand
from holdfast.sources import Arrival

RATE = 150.0
MOST_LOST = 0.5
HAND = hand("allegro-uskin")
SENSORS = {name: module.sensor for name, module in HAND.modules.items()}
N_VALUES = HAND.n_taxels * 3
FACTORS = np.arange(1, N_VALUES + 1, dtype=np.uint64) * np.uint64(40503)


def values(k: int) -> dict[str, np.ndarray]:
    """The readings of sample k, by module."""
    flat = (FACTORS * np.uint64(k + 1) >> np.uint64(3)).astype(np.uint16)
    return HAND.split(flat.reshape(-1, 3))


def record(path: str, progress: str) -> None:
    """Records until it is killed; `progress` holds the number of samples that were given."""
    with Path(progress).open("r+b") as file:
        told = mmap.mmap(file.fileno(), 8)
    recorder = Recorder(path, SENSORS)
    due = time.monotonic()
    for k in range(10**9):
        recorder.put(Arrival(k / RATE, values(k), received=time.monotonic()))
        told[:8] = struct.pack("<Q", k + 1)
        due = max(due + 1 / RATE, time.monotonic())  # after a stall it goes on, not faster
        time.sleep(max(due - time.monotonic(), 0.0))


def kill_one(path: Path, seconds: float) -> int:
    """Kills a recorder that has run so long; how many samples it had been given."""
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
    """How much is missing at the end [s]; nothing that is there is wrong."""
    lengths = {name: module.n_samples for name, module in recording.modules.items()}
    for k in range(max(lengths.values())):
        for name, want in values(k).items():
            if k < lengths[name] and not (
                np.array_equal(recording.modules[name].readings[k], want)
                and recording.modules[name].times[k] == k / RATE
            ):
                sys.exit(f"sample {k} of {name} came back wrong")
    if recording.complete:
        sys.exit("a recording that was cut says that it is complete")
    return (n_given - min(lengths.values())) / RATE


def recovered(path: Path, n_given: int) -> float:
    """How much of a file that was cut is missing [s], as read and as imported."""
    try:
        lost = check(load_recording(path), n_given)
    except RecordingError as refusal:
        if not str(refusal).endswith("nothing can be recovered: it has no samples"):
            raise
        return n_given / RATE
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()) as told:
        code = holdfast(["import", str(path), str(path.parent / "out")])
    if code != 0:
        sys.exit(f"a file that was cut could not be imported: {told.getvalue()}")
    if check(load_recording(path.parent / "out" / f"{path.stem}.parquet"), n_given) != lost:
        sys.exit("a file that was cut was not imported as far as it goes")
    return lost


def kills(folder: Path, n: int, chance: random.Random) -> list[float]:
    """Seconds that each of so many kills lost, at random moments of the first three seconds."""
    lost = []
    for number in range(n):
        path = folder / f"cut{number}.mcap"
        n_given = kill_one(path, chance.uniform(0.0, 3.0))
        lost.append(recovered(path, n_given))
    return lost


def flips(folder: Path, n: int, chance: random.Random) -> int:
    """How many of so many flipped bits in a whole file are found."""
    path, damaged = folder / "whole.mcap", folder / "damaged.mcap"
    with Recorder(path, SENSORS) as recorder:
        for k in range(int(2 * RATE)):
            recorder.put(Arrival(k / RATE, values(k), received=k / RATE), wait=True)
            if k % 100 == 50:
                recorder.add_marker(f"mark {k}")
    raw = path.read_bytes()
    return sum(is_refused(damaged, raw, chance.randrange(8 * len(raw))) for _ in range(n))


def is_refused(path: Path, raw: bytes, bit: int) -> bool:
    """Whether these bytes with that bit flipped are no recording."""
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
        f"median {statistics.median(lost):.3f} s; nothing wrong came back"
    )
    print(f"{n_found} of {n_flips} flipped bits found")
    sys.exit(int(max(lost) > MOST_LOST or n_found < n_flips))


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
