import pytest

from .build import sliding_recording, tiny_recording


@pytest.fixture(scope="session")
def grasps():
    """Six small recordings of two fingers, with three objects."""
    return [tiny_recording(seed) for seed in range(6)]


@pytest.fixture(scope="session")
def recordings():
    """Six recordings in which a finger slides."""
    return [sliding_recording(seed) for seed in range(6)]
