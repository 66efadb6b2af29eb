"""Time of the batch features for every even window, relative to a copy of the same bytes.

The features and the copy run in turns. Reported are the shortest times, and the CPU times of a
thread (median): other work on the machine makes them less uncertain than the usual times.

    python benchmarks/batch_windows.py [SAMPLES] [--longest 32] [--rounds 11]
    python benchmarks/batch_windows.py --memory

With `--memory`, what memory alone takes: the copy in as many threads as the features use, and a
loop that only moves what the features read and write (24 and 48 bytes of a sample).
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


def memory(n_samples: int, n_rounds: int) -> None:
    """Print the times of the copy by threads, and of the bytes of the features without them."""
    force = np.ones((n_samples, 3))
    out, source = np.empty((n_samples, 6)), np.ones(n_samples * 9 // 2)
    target = np.empty_like(source)
    tasks = {
        "copy, one thread": lambda: np.copyto(target, source),
        "copy, all threads": lambda: _copy(source, target),
        "the bytes of the features, all threads": lambda: _move(force, out),
        "features, N_w = 14": lambda: fill_features(force, 14, out),
    }
    for task in tasks.values():
        task()
    times = [[measure(task)[0] for task in tasks.values()] for _ in range(n_rounds)]
    shortest = np.min(times, axis=0)
    for name, each in zip(tasks, shortest, strict=True):
        print(
            f"{name}: {1e9 * each / n_samples:.1f} ns a sample, "
            f"{72e-9 * n_samples / each:.1f} GB/s, {each / shortest[0]:.2f} copies"
        )


@numba.njit(parallel=True)
def _copy(source, target):
    n_threads = numba.get_num_threads()
    size = -(-len(source) // n_threads)
    for k in numba.prange(n_threads):
        target[k * size : (k + 1) * size] = source[k * size : (k + 1) * size]


@numba.njit(parallel=True)
def _move(force, out):
    for k in numba.prange(len(force)):
        x, y, z = force[k, 0], force[k, 1], force[k, 2]
        out[k, 0], out[k, 1], out[k, 2] = x, y, z
        out[k, 3], out[k, 4], out[k, 5] = x, y, z


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
    parser.add_argument("--memory", action="store_true")
    options = parser.parse_args()
    if options.memory:
        memory(options.samples, options.rounds)
    else:
        main(options.samples, options.longest, options.rounds)
