import pytest

from holdfast.synthetic import synthetic_recording

from .build import tiny_recording


@pytest.fixture(scope="session")
def grasps():
    """Six small recordings of two fingers, with three objects."""
    return [tiny_recording(seed) for seed in range(6)]


@pytest.fixture(scope="session")
def synthetic():
    """Four recordings of two curved fingertips."""
    return [synthetic_recording(f"grasp-{k}", k, ("thumb", "index")) for k in range(4)]
