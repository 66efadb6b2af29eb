"""Settings of dependencies in the working folder have no effect, in any order of imports."""

import gc
import json
import os
import pickle
import subprocess
import sys

import pytest
from numba.core.dispatcher import Dispatcher

import holdfast.detector  # noqa: F401 (whose kernels the fixture finds)
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

HOSTILE = {
    ".numba_config.yaml": "cache_dir: pickles\ndisable_jit: 1\ncpu_features: wrong\nopt: 0\n",
    "matplotlibrc": "text.usetex: True\nbackend: module://hostile\nfont.size: 99\n",
    ".dask.yaml": "{{{",
    "dask.yaml": "distributed: {worker: {preload: [hostile.py]}}\n",
    ".config/dask/dask.yaml": "distributed: {worker: {preload: [hostile.py]}}\n",
    ".config/matplotlib/matplotlibrc": "text.usetex: True\n",
    ".netrc": "machine localhost login a password b\n",
    ".env": "NUMBA_DISABLE_JIT=1\nOMP_NUM_THREADS=x\n",
    "alembic.ini": "[alembic]\nscript_location = hostile\n",
    "cyclonedds.xml": "<CycloneDDS",
    "openssl.cnf": "[",
    "setup.cfg": "[",
    "pyproject.toml": "[",
    "MUJOCO_LOG.TXT/file": "",
    "hostile.py": "open('ran', 'w').close()\n",
    "sitecustomize.py": "open('ran', 'w').close()\n",
    "usercustomize.py": "open('ran', 'w').close()\n",
}
"""Content of the files of settings that a dependency reads, or might read, in its folder."""
SHOW = """
import json, os, numba, matplotlib
from numba import config
config.reload_config()
print(json.dumps([config.CACHE_DIR, config.DISABLE_JIT, config.CPU_FEATURES, int(config.OPT),
                  matplotlib.rcParams["text.usetex"], matplotlib.rcParams["font.size"]]))
"""
ORDERS = {
    "holdfast first": "import holdfast.features, holdfast.plots.style",
    "by the laboratory": "import holdfast_lab.figures.dots, holdfast.features",
    "numba first": "import numba, holdfast.features, holdfast.plots.style",
    "a folder that is entered later": (
        "import os; os.chdir('/'); import holdfast.features, holdfast.plots.style; os.chdir({!r})"
    ),
}
DETECT = "import sys\nfrom holdfast.cli import main\nsys.exit(main())\n"


class Payload:
    """An object whose pickle makes a folder where it is loaded."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.makedirs, (str(self.path), 0o777, True)


def run_in(folder, program, *arguments, check=True):
    variables = {name: text for name, text in os.environ.items() if not name.startswith("NUMBA_")}
    command = [sys.executable, "-P", "-c", program, *arguments]
    return subprocess.run(
        command, cwd=folder, env=variables, capture_output=True, text=True, timeout=300, check=check
    )


@pytest.fixture
def folder(tmp_path):
    for name, content in HOSTILE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    (tmp_path / "pickles").mkdir()
    for kernel in (one for one in gc.get_objects() if isinstance(one, Dispatcher)):
        cached = getattr(kernel._cache, "_impl", None)
        if cached is not None:
            file = cached.locator._py_file
            place = tmp_path / "pickles" / cached.locator.get_suitable_cache_subpath(file)
            place.mkdir(exist_ok=True)
            payload = pickle.dumps(Payload(tmp_path / "ran"))
            (place / f"{cached.filename_base}.nbi").write_bytes(payload)
    return tmp_path


@pytest.fixture(scope="module")
def settings(tmp_path_factory):
    """The settings in a folder without files."""
    return json.loads(run_in(tmp_path_factory.mktemp("empty"), SHOW).stdout)


@pytest.mark.parametrize("order", ORDERS)
def test_settings_of_the_folder_have_no_effect(folder, settings, order):
    program = ORDERS[order].format(str(folder)) + SHOW
    assert json.loads(run_in(folder, program).stdout) == settings


def test_a_pipe_in_place_of_settings_is_not_opened(tmp_path, settings):
    os.mkfifo(tmp_path / "matplotlibrc")
    assert json.loads(run_in(tmp_path, f"import holdfast{SHOW}").stdout) == settings


def test_the_verbs_run_no_code_of_the_folder(folder):
    for k in range(4):
        made = synthetic_recording(f"grasp{k}", k, ("thumb", "index"))
        save_recording(made, folder / f"grasp{k}.parquet")
    steps = (
        ("info", "grasp0.parquet", "--plot", "grasp.png"),
        ("detect", "builtin:noise-floor", "grasp0.parquet", "--json"),
        ("train", ".", "-o", "m.json", "--trials", "2", "--jobs", "2"),
        ("simulate", "twin", "--objects", "can", "--cases", "1", "--repeats", "1", "--jobs", "1"),
        ("import", "bag.bag", "out"),
    )
    (folder / "bag.bag").write_bytes(b"#ROSBAG V2.0\n")
    assert any(path.suffix == ".nbi" for path in folder.rglob("*"))
    before = {path for path in folder.rglob("*") if "pickles" in path.parts}
    for words in steps:
        ran = run_in(folder, DETECT, *words, check=False)
        assert ran.returncode == (2 if words[0] == "import" else 0), ran.stderr
    assert not (folder / "ran").exists()
    assert {path for path in folder.rglob("*") if "pickles" in path.parts} == before
