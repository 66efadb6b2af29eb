import json
import pickle
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


CLONE = {"url": "file:///home/me/my clone", "dir_info": {"editable": True}}
WHEEL = {"url": "file:///tmp/holdfast-0.1.0-py3-none-any.whl", "archive_info": {}}


@pytest.mark.parametrize(
    ("installer", "origin", "extras", "command"),
    [
        ("uv", CLONE, "hdf5", "uv sync --inexact --extra hdf5"),
        ("uv", CLONE, "twin,plot", "uv sync --inexact --extra twin --extra plot"),
        ("pip", CLONE, "twin,plot", 'pip install -e "/home/me/my clone[twin,plot]"'),
        ("pip", WHEEL, "hdf5", f'pip install "holdfast[hdf5] @ {WHEEL["url"]}"'),
        ("pip", None, "hdf5", 'pip install "holdfast[hdf5]"'),
        ("uv", None, "hdf5", 'uv pip install "holdfast[hdf5]"'),
    ],
)
def test_missing_extras_name_the_command_that_adds_them(
    monkeypatch, installer, origin, extras, command
):
    files = {"INSTALLER": f"{installer}\n", "direct_url.json": origin and json.dumps(origin)}
    found = SimpleNamespace(read_text=files.get)
    bare = SimpleNamespace(read_text={}.get)  # what setuptools leaves in `src`
    monkeypatch.setattr("importlib.metadata.distributions", lambda name: [bare, found])
    failure = errors.MissingExtra("h5py", extras)
    assert "h5py" in str(failure)
    assert str(failure).endswith(f": {command}")


def test_without_an_installation_the_package_is_named(monkeypatch):
    monkeypatch.setattr("importlib.metadata.distributions", lambda name: [])
    assert errors.install_command("hdf5") == 'pip install "holdfast[hdf5]"'


def test_a_missing_extra_can_be_pickled():
    failure = errors.MissingExtra("h5py", "hdf5")
    assert str(pickle.loads(pickle.dumps(failure))) == str(failure)
