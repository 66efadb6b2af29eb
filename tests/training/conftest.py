import pytest

from .build import tiny_recording


@pytest.fixture(scope="session")
def grasps():
    """Six small recordings of two fingers, with three objects."""
    return [tiny_recording(seed) for seed in range(6)]
