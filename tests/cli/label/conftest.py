import pytest

from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

from .helpers import FINGERS


@pytest.fixture
def folder(tmp_path):
    """Return a folder with two labelled recordings, one of them MCAP."""
    folder = tmp_path / "recordings"
    folder.mkdir()
    for name, seed, suffix in (("one", 0, ".parquet"), ("two", 1, ".mcap")):
        save_recording(synthetic_recording(name, seed, FINGERS), folder / f"{name}{suffix}")
    return folder
