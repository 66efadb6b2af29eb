"""Ten million samples of a fingertip through the detector, in pieces: time and memory.

python benchmarks/stream.py [SAMPLES]
"""

import resource
import sys
import time
from pathlib import Path

import numpy as np

from holdfast.detector import Detector
from holdfast.model import Model
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor

PIECE = 16_384
RATE = 150.0


def resident() -> float:
    """Of this process now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def main(n_samples: int) -> None:
    tip = sensor("uskin-curved")
    detector = Detector(Model.load("builtin:noise-floor"), {"index": tip})
    noise = np.random.default_rng(0).integers(32000, 32004, size=(PIECE, 30, 3)).astype(np.uint16)
    start = time.perf_counter()
    marks = []
    for first in range(0, n_samples, PIECE):
        n = min(PIECE, n_samples - first)
        times = (first + np.arange(n)) / RATE
        detector.run(Recording("stream", {"index": Tactile(tip, times, noise[:n])}))
        marks.append(resident())
    seconds = time.perf_counter() - start
    tenth = len(marks) // 10
    print(f"{n_samples:,} samples in {seconds:.1f} s, {1e6 * seconds / n_samples:.2f} us each")
    print(f"resident after a tenth {marks[tenth]:.0f} MB, at the end {marks[-1]:.0f} MB")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000_000)
