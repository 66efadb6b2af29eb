"""Training on a dataset larger than memory: one recording at a time is in memory."""

import gc
import os
import subprocess
import sys
import weakref
from collections.abc import Sequence
from pathlib import Path

import pytest

from holdfast.training import Setting, train

from .build import tiny_recording


class Lazy(Sequence):
    """Create a recording at every access, and count those in memory."""

    def __init__(self, n):
        self.n = n
        self.alive = weakref.WeakSet()
        self.most = 0

    def __len__(self):
        return self.n

    def __getitem__(self, index):
        if index >= self.n:
            raise IndexError(index)
        recording = tiny_recording(index)
        self.alive.add(recording)
        gc.collect()  # also frees objects that only refer to each other; older ones are frozen
        self.most = max(self.most, len(self.alive))
        return recording


@pytest.fixture
def frozen():
    """What exists before a test is no concern of the garbage collector during it."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("frozen")
@pytest.mark.parametrize("split", ["recording", "random"])
def test_one_recording_is_in_memory_at_a_time(split):
    recordings = Lazy(5)
    train(recordings, Setting(trials=0, split=split))
    assert recordings.most <= 2  # one, and the last until a loop moves on


PROGRAM = """
import resource, sys
from pathlib import Path
from holdfast.errors import RecordingError
from holdfast.io import load_dataset
from holdfast.training import Setting, train

folder = Path(sys.argv[1])
train(load_dataset(folder)[:2], Setting(trials=0))  # imports and kernels
room = 300_000_000
pages = int(Path("/proc/self/statm").read_text().split()[0])
limit = pages * resource.getpagesize() + room
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
dataset = load_dataset(folder)
try:
    held = list(dataset)
except (MemoryError, RecordingError):
    held = None
assert held is None, "the dataset fits into the room: this proves nothing"
trained = train(dataset, Setting(trials=0))
print(trained.cross_validation.pooled.n)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux")
def test_a_dataset_larger_than_a_limit_on_memory_trains(tmp_path):
    _write_large(tmp_path, n_recordings=12, n_samples=40_000)
    environment = os.environ | {"ARROW_DEFAULT_MEMORY_POOL": "system", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) == 12 * (40_000 - 75 - 13)


def _write_large(folder, n_recordings, n_samples):
    """Recordings of 29 MB each, that compress well: all taxels have the same value."""
    import numpy as np

    from holdfast.contact import ContactState
    from holdfast.io import save_recording
    from holdfast.recordings import Label, Recording, Tactile
    from holdfast.sensors import sensor

    tip = sensor("uskin-curved")
    times = np.arange(n_samples) / 150
    half = n_samples // 2
    for k in range(n_recordings):
        readings = np.full((n_samples, tip.n_taxels, 3), 30_000.0)
        readings += np.random.default_rng(k).integers(0, 40, n_samples)[:, None, None]
        readings[half:, 0, 2] += 500.0 + k
        labels = (
            Label(0.0, times[half], ContactState.NO_CONTACT),
            Label(times[half], times[-1] + 1 / 150, ContactState.STABLE),
        )
        recording = Recording(f"r{k:02d}", {"thumb": Tactile(tip, times, readings, labels=labels)})
        save_recording(recording, folder / f"r{k:02d}.parquet")
