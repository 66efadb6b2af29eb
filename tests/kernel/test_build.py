"""The build of the C kernel (`setup.py`), and the check of its sources at import."""

import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[2]
BUILD_FILES = ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE")
BUILD = "uv sync --inexact --reinstall-package holdfast-tactile, or pip install -e ."


@pytest.fixture(scope="module")
def setup():
    spec = importlib.util.spec_from_file_location("setup", ROOT / "setup.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def no_compiler(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)


@pytest.fixture
def clone(tmp_path):
    for name in BUILD_FILES:
        shutil.copy(ROOT / name, tmp_path)
    ignored = shutil.ignore_patterns("__pycache__", "page", "static", "*.egg-info")
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=ignored)
    return tmp_path


def python(folder, code):
    environment = os.environ | {"PYTHONPATH": str(folder / "src")}
    options = {"capture_output": True, "text": True, "timeout": 250}
    command = (sys.executable, "-c", code)
    return subprocess.run(command, cwd=folder, env=environment, check=False, **options)


def test_after_an_edit_of_c_one_line_names_the_command_that_builds(clone):
    version = "import holdfast.kernel as k; print(k._extension.SOURCES)"
    before = python(clone, version).stdout
    source = clone / "src" / "holdfast" / "kernel" / "haar.c"
    text = source.read_text()
    assert text.count("BLOCK_SAMPLES = 384,") == 1
    source.write_text(text.replace("BLOCK_SAMPLES = 384,", "BLOCK_SAMPLES = 256,"))
    failed = python(clone, version)
    expected = f"the C kernel was built from other sources; build it again: {BUILD}"
    assert failed.stderr.splitlines()[-1].endswith(expected)
    # what `uv sync` and `pip install -e` call
    built = python(clone, "import setup; setup.build_editable('.')")
    assert built.returncode == 0, built.stderr
    after = python(clone, version)
    assert after.stderr == ""
    assert after.stdout != before


def test_a_wheel_has_the_c_files_that_an_exported_header_joins(clone):
    built = python(clone, "import setup; setup.build_wheel('dist')")
    assert built.returncode == 0, built.stderr
    folder = clone / "installed"
    with zipfile.ZipFile(next((clone / "dist").glob("*.whl"))) as wheel:
        wheel.extractall(folder / "src")
    shown = python(folder, "from holdfast.detection import c_header as c; print(c.kernel_text())")
    assert "holdfast_detect(" in shown.stdout, shown.stderr
    assert not (folder / "src" / "holdfast" / "kernel" / "module.c").exists()


@pytest.mark.parametrize(
    ("module", "title"),
    [("kernel._extension", "the C kernel"), ("twin.steps", "the steps of the twin in C")],
)
def test_an_extension_that_is_not_built_names_the_command_that_builds_it(clone, module, title):
    package, name = module.split(".")
    for path in (clone / "src" / "holdfast" / package).glob(f"{name}.*.so"):
        path.unlink()
    failed = python(clone, f"from holdfast.cli import main; import holdfast.{package}")
    last = failed.stderr.splitlines()[-1]
    assert f"{title} cannot be loaded (" in last
    assert last.endswith(f"build it: {BUILD}")


def test_a_build_without_a_compiler_takes_the_one_of_the_package_index(
    setup, no_compiler, monkeypatch
):
    hooks = ("get_requires_for_build_wheel", "get_requires_for_build_editable")
    monkeypatch.chdir(ROOT)
    for hook in hooks:
        monkeypatch.setattr(setup.build_meta, hook, lambda settings: ["other"])
        assert getattr(setup, hook)() == ["other", "ziglang==0.15.2"]
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    assert [getattr(setup, hook)() for hook in hooks] == [["other"]] * 2


@pytest.mark.parametrize(
    ("missing", "named"),
    [("GIL", "GIL"), ("Python.h", "apt install python3-dev"), ("compiler", "apt install gcc")],
)
def test_one_line_says_what_a_build_is_missing(setup, no_compiler, monkeypatch, missing, named):
    if missing == "GIL":
        monkeypatch.setattr(sysconfig, "get_config_var", lambda name: 1)
    if missing == "Python.h":
        monkeypatch.setattr(sysconfig, "get_path", lambda name: "/nowhere")
    with pytest.raises(SystemExit, match=named):
        setup.choose_compiler()


def test_the_compiler_of_the_package_index_is_used_where_it_is_installed(
    setup, no_compiler, monkeypatch
):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: SimpleNamespace(name=name))
    monkeypatch.setenv("CC", "nowhere-cc")
    setup.choose_compiler()
    assert os.environ["CC"].startswith(f"{sys.executable} -m ziglang cc")
