import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_folder():
    """Where the real recordings are: HOLDFAST_DATA, or the folder shared beside the project."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("HOLDFAST_DATA", beside))
    if not folder.is_dir():
        pytest.skip("no real recordings here: set HOLDFAST_DATA to their folder")
    return folder
