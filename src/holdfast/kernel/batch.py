"""Features of whole arrays, computed in C by several threads.

The functions of the extension release the GIL and compute rows by themselves, so the result does
not depend on the number of threads.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from holdfast.kernel import _extension

Floats = npt.NDArray[np.float64]

SERIAL_BYTES = 3 << 20
"""Less is read by one thread, in about a millisecond: on a machine with other work, threads wait
for each other for several."""
PARTS_PER_THREAD = 4
"""The slower thread of two computes fewer parts."""


def max_threads() -> int:
    """Return how many threads a call may use: by OMP_NUM_THREADS, or the processors."""
    text = os.environ.get("OMP_NUM_THREADS", "")  # joblib sets it for the processes it starts
    return max(int(text), 1) if text.isdecimal() else usable_processors()


def usable_processors() -> int:
    """Return the number of processors that this process may use."""
    # A container or `taskset` may allow fewer than the machine has.
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def fill_haar_features(
    force: Floats, window: int, out: Floats, n_threads: int | None = None
) -> None:
    """Fill `out` with the paper's features of a force; see `haar_features`.

    Args:
        force: (n, 3) F_tip, contiguous.
        window: N_w; even, at least 2.
        out: (n, 6), contiguous.
        n_threads: by default as many as pay off.

    Raises:
        TypeError: an array is not float64.
        ValueError: an array has another shape or order in memory; a window that is no pairs.
    """
    _in_parts(
        lambda first, stop: _extension.haar_features(force, out, first, stop, window),
        len(force),
        force.nbytes,
        n_threads,
    )


def fill_fingertip_force(
    readings: Floats,
    baseline: Floats,
    rotations: Floats,
    out: Floats,
    n_threads: int | None = None,
) -> None:
    """Fill `out` with the fingertip force of readings; see `fingertip_force`.

    Args:
        readings: (n, n_taxels, 3) in taxel frames, contiguous.
        baseline: (n_taxels, 3) readings without contact.
        rotations: (n_taxels, 3, 3) from the taxel frame to the fingertip frame.
        out: (n, 3), contiguous.
        n_threads: by default as many as pay off.

    Raises:
        TypeError: an array is not float64.
        ValueError: an array has another shape or order in memory.
    """
    _in_parts(
        lambda first, stop: _extension.fingertip_force(
            readings, baseline, rotations, out, first, stop
        ),
        len(readings),
        readings.nbytes,
        n_threads,
    )


def _in_parts(
    call: Callable[[int, int], None], n: int, n_bytes: int, n_threads: int | None
) -> None:
    """Call a function for all parts of n samples, in threads if there is enough to do."""
    if n_threads is None:
        n_threads = max_threads() if n_bytes > SERIAL_BYTES else 1
    if n_threads == 1:
        call(0, n)
        return
    bounds = np.linspace(0, n, n_threads * PARTS_PER_THREAD + 1).astype(int).tolist()
    # A pool of its own: starting it takes 0.1 ms, and one that is kept breaks in a forked process.
    with ThreadPoolExecutor(n_threads) as pool:
        list(pool.map(call, bounds[:-1], bounds[1:]))
