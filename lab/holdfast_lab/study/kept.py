"""Values that a worker keeps in memory, because many tasks of a study use them."""

import math
import os
from collections.abc import Callable, Hashable
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

from holdfast.errors import is_installed
from holdfast.recordings import Recording
from holdfast_lab.report.environment import physical_memory

T = TypeVar("T")

MEMORY_SHARE = 0.25
"""Share of the memory of the machine that the kept values of all its workers may use."""
DEFAULT_MEMORY = 4 << 30
"""Memory of a machine that does not say how much it has [byte]."""
CONTAINER_LIMIT = Path("/sys/fs/cgroup/memory.max")
"""File with the memory that a container may use, or `max`; not there outside of Linux."""


class KeptValues:
    """Values by key, in the memory of this process. What no longer fits is not kept.

    The first values stay, because the tasks of a study use their recordings in the same order:
    if the oldest values were dropped, each would be gone before it is used again.

    Args:
        max_bytes: of all values together.
    """

    def __init__(self, max_bytes: float) -> None:
        self._left = max_bytes
        self._kept: dict[Hashable, Any] = {}
        self._lock = Lock()

    def get(self, key: Hashable, make: Callable[[], T], n_bytes: Callable[[T], int]) -> T:
        """Return the value of a key; make it, and keep it if it fits, if there is none.

        Args:
            key: of the value.
            make: function that returns the value.
            n_bytes: function from the value to its size [byte].
        """
        if key in self._kept:
            value: T = self._kept[key]
            return value
        value = make()  # without the lock, or one slow file would stop all threads
        size = n_bytes(value)
        with self._lock:
            # Another thread may have made the same value meanwhile.
            if key not in self._kept and size <= self._left:
                self._kept[key] = value
                self._left -= size
        return value


def recording_bytes(recording: Recording) -> int:
    """Return the size of the arrays of a recording [byte]."""
    n_bytes = sum(m.times.nbytes + m.readings.nbytes for m in recording.modules.values())
    if (truth := recording.truth) is not None:
        n_bytes += truth.times.nbytes
        for arrays in (truth.hand, *truth.fingers.values()):
            n_bytes += sum(array.nbytes for array in arrays.values())
    return n_bytes


def usable_memory(limit: Path = CONTAINER_LIMIT) -> int:
    """Return the memory of this machine, or of the container if it may use less [byte].

    Args:
        limit: see `CONTAINER_LIMIT`.
    """
    memory = physical_memory() or DEFAULT_MEMORY
    try:
        text = limit.read_text().strip()
    except OSError:
        return memory
    return min(memory, int(text)) if text.isdecimal() else memory


def worker_memory() -> KeptValues:
    """Return the memory of this process for kept values, and let the process grow by it."""
    if is_installed("joblib"):
        from joblib.externals.loky import process_executor

        # loky takes a worker that grows by 300 MB for one that leaks, and replaces it with all that
        # it keeps. Where the limit has another name, workers read recordings again and again.
        process_executor._MAX_MEMORY_LEAK_SIZE = math.inf
    return KeptValues(MEMORY_SHARE * usable_memory() / (os.cpu_count() or 1))


WORKER_MEMORY = worker_memory()
"""The values that this process keeps."""
