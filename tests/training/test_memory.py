"""Training on a dataset larger than memory: one recording at a time is in memory."""

import gc
import weakref
from collections.abc import Sequence

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
