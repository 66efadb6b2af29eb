"""Settings of dependencies in the working folder have no effect, in any order of imports."""

import json
import os
import subprocess
import sys

import pytest

from devices.sources import ros_build
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
PLANT = """
import pickle, sys
from pathlib import Path
import holdfast.cli.detect.verb, holdfast.training, holdfast.twin.simulation, holdfast.detector
from numba.core.dispatcher import Dispatcher

class Payload:
    def __reduce__(self):
        return exec, ("import os; open('ran', 'w').close(); os._exit(7)",)

modules = [module for name, module in sys.modules.items() if name.startswith("holdfast")]
kernels = (one for module in modules for one in vars(module).values())
files = [k._cache._cache_file for k in kernels if isinstance(k, Dispatcher)
         and hasattr(k._cache, "_cache_file")]
for file in files:
    Path(file._index_path).parent.mkdir(parents=True, exist_ok=True)
    Path(file._index_path).write_bytes(pickle.dumps(Payload()))
print(len(files))
"""
"""Program that writes a pickle in place of the index of each kernel that numba has cached."""
VERB = "import sys\nfrom holdfast.cli import main\nsys.exit(main())\n"


def run_in(folder, program, *arguments, code=0, **more):
    variables = {name: text for name, text in os.environ.items() if not name.startswith("NUMBA_")}
    command = [sys.executable, "-P", "-c", program, *arguments]
    done = subprocess.run(
        command, cwd=folder, env=variables | more, capture_output=True, text=True, timeout=600,
        check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    return done


def write_bag(path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    types = ros_build.store("xela_server_ros2", ros_build.XELA, ros2=True)
    name = "xela_server_ros2/msg/SensStream"
    plugin = rosbag2.StoragePlugin.MCAP
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        topic = writer.add_connection("/xServTopic", name, typestore=types)
        for k in range(30):
            sample = (1, "uSPa44", k, k / 100, ros_build.counts(16, k), [])
            message = ros_build.sens_stream(types, "xela_server_ros2", sample)
            writer.write(topic, k * 10_000_000, types.serialize_cdr(message, name))


@pytest.fixture
def folder(tmp_path):
    for name, content in HOSTILE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    (tmp_path / "pickles").mkdir()
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


@pytest.mark.timeout(900)  # kernels may be compiled first, and beside other tests
def test_the_verbs_run_no_code_of_the_folder(folder):
    for k in range(4):
        made = synthetic_recording(f"grasp{k}", k, ("thumb", "index"))
        save_recording(made, folder / f"grasp{k}.parquet")
    write_bag(folder / "bag")
    planted = run_in(folder, PLANT, NUMBA_CACHE_DIR="pickles")
    assert int(planted.stdout) > 20
    detect = ("detect", "builtin:noise-floor", "grasp0.parquet", "--json")
    run_in(folder, VERB, *detect, code=7, NUMBA_CACHE_DIR="pickles")
    (folder / "ran").unlink()  # so the pickles are where numba looks for them
    steps = (
        ("import", "bag", "imported"),
        ("simulate", "twin", "--objects", "can", "--cases", "1", "--repeats", "1", "--jobs", "1"),
        ("info", "grasp0.parquet", "--plot", "grasp.png"),
        detect,
        ("train", ".", "-o", "m.json", "--trials", "2", "--jobs", "2"),
    )
    before = {path for path in folder.rglob("*") if "pickles" in path.parts}
    for words in steps:
        run_in(folder, VERB, *words)
    assert not (folder / "ran").exists()
    assert {path for path in folder.rglob("*") if "pickles" in path.parts} == before
