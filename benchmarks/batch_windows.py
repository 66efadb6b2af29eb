"""Time of the batch features for every even window, relative to a copy of the same bytes.

The features and the copy run in turns. Reported are the shortest times, with all threads and with
one, and the CPU time of one thread (median): other work on the machine makes it less uncertain.

    python benchmarks/batch_windows.py [SAMPLES] [--longest 32] [--rounds 11]
"""

import argparse
import time
from collections.abc import Callable

import numpy as np

from holdfast.kernel.batch import fill_haar_features


def main(n_samples: int, longest: int, n_rounds: int) -> None:
    force = np.random.default_rng(0).normal(size=(n_samples, 3))
    out = np.empty((n_samples, 6))
    source = np.ones(n_samples * 9 // 2)  # half of the bytes read and written per sample
    target = np.empty_like(source)
    for window in range(2, longest + 1, 2):
        tasks = (
            lambda w=window: fill_haar_features(force, w, out),
            lambda w=window: fill_haar_features(force, w, out, n_threads=1),
            lambda: np.copyto(target, source),
        )
        rounds = np.array([[measure(task) for task in tasks] for _ in range(n_rounds)])
        features, alone, copy = rounds[:, :, 0].min(axis=0)
        cpu = np.median(rounds[:, 1:, 1], axis=0)
        print(
            f"N_w = {window}: {1e9 * features / n_samples:.1f} ns a sample, "
            f"{features / copy:.2f} copies; one thread {alone / copy:.2f} copies, "
            f"by CPU time {cpu[0] / cpu[1]:.2f}"
        )


def measure(task: Callable[[], object]) -> tuple[float, float]:
    """Return the time of a task, and the CPU time of all threads [s]."""
    start, cpu = time.perf_counter(), time.process_time()
    task()
    return time.perf_counter() - start, time.process_time() - cpu


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("samples", type=int, nargs="?", default=2_000_000)
    parser.add_argument("--longest", type=int, default=32)
    parser.add_argument("--rounds", type=int, default=11)
    options = parser.parse_args()
    main(options.samples, options.longest, options.rounds)
