"""Settings of dependencies in the working folder have no effect, in any order of imports."""

import json
import os
import subprocess
import sys

import pytest

import ros_messages
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

HOSTILE = {
    "matplotlibrc": "text.usetex: True\nbackend: module://hostile\nfont.size: 99\n",
    ".dask.yaml": "{{{",
    "dask.yaml": "distributed: {worker: {preload: [hostile.py]}}\n",
    ".config/dask/dask.yaml": "distributed: {worker: {preload: [hostile.py]}}\n",
    ".config/matplotlib/matplotlibrc": "text.usetex: True\n",
    ".netrc": "machine localhost login a password b\n",
    ".env": "OMP_NUM_THREADS=x\n",
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
import json, matplotlib
print(json.dumps([matplotlib.rcParams["text.usetex"], matplotlib.rcParams["font.size"]]))
"""
ORDERS = {
    "holdfast first": "import holdfast.features, holdfast.plots.style",
    "by the laboratory": "import holdfast_lab.figures.dots, holdfast.features",
    "a folder that is entered later": (
        "import os; os.chdir('/'); import holdfast.features, holdfast.plots.style; os.chdir({!r})"
    ),
}
VERB = "import sys\nfrom holdfast.cli import main\nsys.exit(main())\n"


def run_in(folder, program, *arguments):
    command = [sys.executable, "-P", "-c", program, *arguments]
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    return done


def write_bag(path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    types = ros_messages.store("xela_server_ros2", ros_messages.XELA, ros2=True)
    name = "xela_server_ros2/msg/SensStream"
    plugin = rosbag2.StoragePlugin.MCAP
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        topic = writer.add_connection("/xServTopic", name, typestore=types)
        for k in range(30):
            sample = (1, "uSPa44", k, k / 100, ros_messages.counts(16, k), [])
            message = ros_messages.sens_stream(types, "xela_server_ros2", sample)
            writer.write(topic, k * 10_000_000, types.serialize_cdr(message, name))


@pytest.fixture
def folder(tmp_path):
    for name, content in HOSTILE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
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
    write_bag(folder / "bag")
    steps = (
        ("import", "bag", "imported"),
        ("simulate", "twin", "--objects", "can", "--cases", "1", "--repeats", "1", "--jobs", "1"),
        ("info", "grasp0.parquet", "--plot", "grasp.png"),
        ("detect", "builtin:noise-floor", "grasp0.parquet", "--json"),
        ("train", ".", "-o", "m.json", "--trials", "2", "--jobs", "2"),
    )
    for words in steps:
        run_in(folder, VERB, *words)
    assert not (folder / "ran").exists()
