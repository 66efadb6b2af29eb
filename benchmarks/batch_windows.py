"""Time of the batch features for every even window, relative to a copy of the same bytes.

The features and the copy run in turns. Reported are the shortest times, and the CPU times of a
thread (median): other work on the machine makes them less uncertain than the usual times.

    python benchmarks/batch_windows.py [SAMPLES] [--longest 32] [--rounds 11]
"""

import argparse
import time
from collections.abc import Callable

import numba
import numpy as np

from holdfast.features.haar import fill_features


def main(n_samples: int, longest: int, n_rounds: int) -> None:
    force = np.random.default_rng(0).normal(size=(n_samples, 3))
    out = np.empty((n_samples, 6))
    source = np.ones(n_samples * 9 // 2)  # half of the bytes read and written per sample
    target = np.empty_like(source)
    for window in range(2, longest + 1, 2):
        fill_features(force, window, out)
        rounds = [
            (*measure(lambda w=window: fill_features(force, w, out)), *measure(copy))
            for copy in [lambda: np.copyto(target, source)] * n_rounds
        ]
        shortest, median = np.min(rounds, axis=0), np.median(rounds, axis=0)
        cpu = median[1] / numba.get_num_threads()
        print(
            f"N_w = {window}: {1e9 * shortest[0] / n_samples:.1f} ns a sample, "
            f"{shortest[0] / shortest[2]:.2f} copies; CPU {1e9 * cpu / n_samples:.1f} ns a thread, "
            f"{cpu / median[3]:.2f} copies"
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
