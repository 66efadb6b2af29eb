import os
from pathlib import Path

import hypothesis
import pytest

# The checks of a submission try the same examples every time; at home they differ.
hypothesis.settings.register_profile("checks", derandomize=True)
if os.environ.get("CI"):
    hypothesis.settings.load_profile("checks")


@pytest.fixture(scope="session")
def data_folder():
    """Where the real recordings are: HOLDFAST_DATA, or the folder shared beside the project."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("HOLDFAST_DATA", beside))
    if not folder.is_dir():
        pytest.skip("no real recordings here: set HOLDFAST_DATA to their folder")
    return folder


def pytest_sessionstart(session):
    """Deletes compiled kernels that are older than a kernel's source.

    Numba looks at the file of a kernel only, not at those that it imports.
    """
    if hasattr(session.config, "workerinput"):
        return
    package = Path(__file__).parents[1] / "src" / "holdfast"
    kernels = [path for path in package.rglob("*.py") if "compiled" in path.read_text()]
    newest = max(path.stat().st_mtime for path in kernels)
    for cache in package.rglob("*.nb[ci]"):
        if cache.stat().st_mtime < newest:
            cache.unlink(missing_ok=True)
