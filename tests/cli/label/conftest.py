import pytest

from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

from .helpers import FINGERS


@pytest.fixture
def folder(tmp_path):
    """Return a folder with two labelled recordings, one of them MCAP."""
    place = tmp_path / "recordings"
    place.mkdir()
    for name, seed, suffix in (("one", 0, ".parquet"), ("two", 1, ".mcap")):
        save_recording(synthetic_recording(name, seed, FINGERS), place / f"{name}{suffix}")
    return place
