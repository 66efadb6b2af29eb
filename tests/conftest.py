import ast
import functools
import math
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
    """Deletes compiled kernels that are older than a source that they may be made of.

    Numba looks at the file of a kernel only, not at those that it imports, whose functions and
    constants are compiled into it.
    """
    if hasattr(session.config, "workerinput"):
        return
    package = Path(__file__).parents[1] / "src" / "holdfast"
    for folder in package.rglob("__pycache__"):
        for cache in folder.glob("*.nb[ci]"):
            source = folder.parent / f"{cache.name.split('.')[0]}.py"
            if cache.stat().st_mtime < newest(source):
                cache.unlink(missing_ok=True)


@functools.cache
def newest(source):
    """When a file, or one that it imports of the package, or so on, last changed."""
    waiting, seen = [source], set()
    while waiting:
        path = waiting.pop()
        if path not in seen and path.is_file():
            seen.add(path)
            waiting += imported(path)
    return max((path.stat().st_mtime for path in seen), default=math.inf)


@functools.cache
def imported(path):
    """Where the modules are that a file may import of the package, some of which are not."""
    names = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ""
            names += [module, *(f"{module}.{alias.name}" for alias in node.names)]
    source = Path(__file__).parents[1] / "src"
    places = [source.joinpath(*name.split(".")) for name in names if name.startswith("holdfast")]
    return [file for place in places for file in (place.with_suffix(".py"), place / "__init__.py")]
