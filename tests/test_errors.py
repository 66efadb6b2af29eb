import json
import pickle
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from holdfast import errors

FAMILIES = (
    errors.RecordingError,
    errors.ModelError,
    errors.TrainingError,
    errors.StreamError,
    errors.SourceError,
    errors.EngineError,
    errors.OutputError,
    errors.MissingExtra,
)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_class_is_a_holdfast_error(family):
    assert issubclass(family, errors.HoldfastError)
    assert not issubclass(family, ValueError | TypeError | OSError)


def test_there_are_no_other_classes():
    classes = {value for value in vars(errors).values() if isinstance(value, type)}
    assert classes == {errors.HoldfastError, *FAMILIES}


CLONE = {"url": "file:///home/me/my%20clone", "dir_info": {"editable": True}}
WHEEL = {"url": "file:///tmp/holdfast_tactile-0.1.0-py3-none-any.whl", "archive_info": {}}
INDEX = "holdfast-tactile[hdf5]"
FROM_FILE = f"{INDEX} @ {WHEEL['url']}"
CLONE_ENV, PROJECT_ENV, OTHER_ENV = "/home/me/my clone/.venv", "/home/me/project/.venv", "/env"
PROJECTS = ("/home/me/my clone/uv.lock", "/home/me/project/uv.lock")


@pytest.mark.parametrize(
    ("installer", "origin", "prefix", "extras", "command"),
    [
        ("uv", CLONE, CLONE_ENV, "hdf5", "uv sync --inexact --extra hdf5"),
        ("uv", CLONE, CLONE_ENV, "twin,plot", "uv sync --inexact --extra twin --extra plot"),
        ("uv", CLONE, PROJECT_ENV, "hdf5", "uv add holdfast-tactile --extra hdf5"),
        ("uv", None, PROJECT_ENV, "hdf5", "uv add holdfast-tactile --extra hdf5"),
        ("uv", CLONE, OTHER_ENV, "hdf5", 'uv pip install -e "/home/me/my clone[hdf5]"'),
        ("uv", WHEEL, OTHER_ENV, "hdf5", f'uv pip install "{FROM_FILE}"'),
        ("uv", None, OTHER_ENV, "hdf5", f'uv pip install "{INDEX}"'),
        ("pip", CLONE, CLONE_ENV, "twin,plot", 'pip install -e "/home/me/my clone[twin,plot]"'),
        ("pip", WHEEL, OTHER_ENV, "hdf5", f'pip install "{FROM_FILE}"'),
        ("pip", None, OTHER_ENV, "hdf5", f'pip install "{INDEX}"'),
        (None, None, OTHER_ENV, "hdf5", f'pip install "{INDEX}"'),
    ],
)
@pytest.mark.parametrize("is_active", [True, False], ids=["active", "not active"])
def test_missing_extras_name_the_command_that_adds_them(
    monkeypatch, installer, origin, prefix, extras, command, is_active
):
    files = {"INSTALLER": f"{installer}\n", "direct_url.json": origin and json.dumps(origin)}
    found = [SimpleNamespace(read_text=files.get)] if installer else []
    bare = SimpleNamespace(read_text={}.get)  # what setuptools leaves in `src`
    project, programs = prefix.removesuffix("/.venv"), f"{prefix if is_active else '/usr'}/bin"
    monkeypatch.setattr("importlib.metadata.distributions", lambda name: [bare, *found])
    monkeypatch.setattr("pathlib.Path.exists", lambda path: str(path) in PROJECTS)
    monkeypatch.setattr("pathlib.Path.cwd", lambda: Path(project if is_active else "/elsewhere"))
    monkeypatch.setattr("shutil.which", lambda name: f"{programs}/{name}")
    monkeypatch.setattr(sys, "prefix", prefix)
    monkeypatch.setattr(sys, "executable", f"{prefix}/bin/python")
    monkeypatch.setenv("VIRTUAL_ENV", prefix if is_active else "/other")
    if not is_active:  # the environment or the project is named
        program, _, rest = command.partition(" install")
        if command.startswith(("uv sync", "uv add")):
            command = command.replace(" --extra", f' --project "{project}" --extra', 1)
        elif program == "uv pip":
            command = f'uv pip install --python "{prefix}"{rest}'
        else:
            command = f'"{prefix}/bin/python" -m pip install{rest}'
    failure = errors.MissingExtra("h5py", extras)
    assert "h5py" in str(failure)
    assert str(failure).endswith(f": {command}")


def test_another_project_called_holdfast_is_named(monkeypatch):
    other = SimpleNamespace(
        version="2.1", metadata={"Summary": "Locks"}, read_text={"INSTALLER": "pip"}.get
    )
    monkeypatch.setattr(errors, "installed_distributions", lambda name: iter([other]))
    line = errors.other_project()
    assert "holdfast 2.1 (Locks) is installed" in line
    assert "pip uninstall holdfast, " in line
    monkeypatch.setattr(errors, "installed_distributions", lambda name: iter(()))
    assert errors.other_project() == ""


def test_a_missing_extra_can_be_pickled():
    failure = errors.MissingExtra("h5py", "hdf5")
    assert str(pickle.loads(pickle.dumps(failure))) == str(failure)
