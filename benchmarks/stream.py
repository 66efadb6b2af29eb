"""Time and memory of ten million samples of a fingertip through the detector, in chunks.

python benchmarks/stream.py [SAMPLES]
"""

import argparse
import resource
import time
from pathlib import Path

import numpy as np

from holdfast.detector import Detector
from holdfast.model import Model
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor

CHUNK_SIZE = 16_384
RATE = 150.0


def resident_memory() -> float:
    """Return the resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def main(n_samples: int) -> None:
    tip = sensor("uskin-curved")
    detector = Detector(Model.load("builtin:noise-floor"), {"index": tip})
    noise = (
        np.random.default_rng(0).integers(32000, 32004, size=(CHUNK_SIZE, 30, 3)).astype(np.uint16)
    )
    start = time.perf_counter()
    memory = []
    for first in range(0, n_samples, CHUNK_SIZE):
        n = min(CHUNK_SIZE, n_samples - first)
        times = (first + np.arange(n)) / RATE
        detector.run(Recording("stream", {"index": Tactile(tip, times, noise[:n])}))
        memory.append(resident_memory())
    seconds = time.perf_counter() - start
    tenth = len(memory) // 10
    print(f"{n_samples:,} samples in {seconds:.1f} s, {1e6 * seconds / n_samples:.2f} us each")
    print(f"resident after a tenth {memory[tenth]:.0f} MB, at the end {memory[-1]:.0f} MB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("samples", type=int, nargs="?", default=10_000_000)
    main(parser.parse_args().samples)
