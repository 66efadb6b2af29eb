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


def test_the_docstring_names_every_class():
    classes = {
        value
        for value in vars(errors).values()
        if isinstance(value, type) and value is not errors.HoldfastError
    }
    assert classes == set(FAMILIES)
    assert all(family.__name__ in errors.__doc__ for family in FAMILIES)


CLONE = {"url": "file:///home/me/my clone", "dir_info": {"editable": True}}
WHEEL = {"url": "file:///tmp/holdfast-0.1.0-py3-none-any.whl", "archive_info": {}}


@pytest.mark.parametrize(
    ("installer", "origin", "command"),
    [
        ("uv", CLONE, "uv sync --inexact --extra hdf5"),
        ("pip", CLONE, 'pip install -e "/home/me/my clone[hdf5]"'),
        ("pip", WHEEL, f'pip install "holdfast[hdf5] @ {WHEEL["url"]}"'),
        ("pip", None, 'pip install "holdfast[hdf5]"'),
        ("uv", None, 'uv pip install "holdfast[hdf5]"'),
    ],
)
def test_a_missing_extra_names_the_command_that_adds_it(monkeypatch, installer, origin, command):
    files = {"INSTALLER": f"{installer}\n", "direct_url.json": origin and json.dumps(origin)}
    found = SimpleNamespace(read_text=files.get)
    bare = SimpleNamespace(read_text={}.get)  # what setuptools leaves in `src`
    monkeypatch.setattr("importlib.metadata.distributions", lambda name: [bare, found])
    failure = errors.MissingExtra("h5py", "hdf5")
    assert str(failure) == f"this needs the package h5py, which is not installed: {command}"


def test_without_an_installation_the_package_is_named(monkeypatch):
    monkeypatch.setattr("importlib.metadata.distributions", lambda name: [])
    assert errors.install_command("hdf5") == 'pip install "holdfast[hdf5]"'


def test_a_missing_extra_can_be_pickled():
    failure = errors.MissingExtra("h5py", "hdf5")
    assert str(pickle.loads(pickle.dumps(failure))) == str(failure)


def test_several_extras_are_added_by_one_command(monkeypatch):
    origin = {"url": "file:///home/me/clone", "dir_info": {"editable": True}}
    for installer, command in [
        ("uv", "uv sync --inexact --extra twin --extra plot"),
        ("pip", 'pip install -e "/home/me/clone[twin,plot]"'),
    ]:
        files = {"INSTALLER": installer, "direct_url.json": json.dumps(origin)}
        found = SimpleNamespace(read_text=files.get)
        monkeypatch.setattr("importlib.metadata.distributions", lambda name, found=found: [found])
        assert errors.install_command("twin,plot") == command
