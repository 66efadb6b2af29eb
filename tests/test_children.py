"""Child processes import no modules from the working folder, and no settings there run code."""

import json
import os
import subprocess
import sys

import pytest

from holdfast.children import python_command
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording
from holdfast_grip.loop.watchdog import N_SAFE_COMMANDS

OTHER_MODULES = (
    "cloudpickle", "cyclonedds", "glfw", "holdfast", "joblib", "matplotlib", "mcap", "msgspec",
    "mujoco", "numpy", "pyarrow", "rich", "scipy", "sklearn", "threadpoolctl", "typer",
)  # fmt: skip
MARK = "import os\nopen({marker!r}, 'a').write({name!r} + ' ')\n"
COMMAND = "import sys\nfrom holdfast.cli import main\nsys.exit(main())\n"
WATCHDOG = """
import sys
from holdfast_grip import FingerCommand, GripCommand, LoopState
from holdfast_grip.hands import open_hand
from holdfast_grip.loop.watchdog import Watchdog
open_hand(sys.argv[1])
watchdog = Watchdog(sys.argv[1], "open", timeout=3600.0)
watchdog.start()
watchdog.beat(GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(1.3)}))
watchdog.abandon()
"""
GRIPPER = """
import beside
def set_force(scale):
    beside.write(scale)
"""
BESIDE = """
def write(scale):
    with open("commands", "a") as file:
        file.write(f"{scale}\\n")
"""
HOSTILE = {
    "matplotlibrc": "text.usetex: True\nbackend: module://hostile\n",
    ".config/matplotlib/matplotlibrc": "text.usetex: True\n",
    ".netrc": "machine localhost login a password b\n",
    "cyclonedds.xml": "<CycloneDDS",
    "openssl.cnf": "[",
    "pyproject.toml": "[",
    "hostile.py": "open('ran', 'w').close()\n",
    "sitecustomize.py": "open('ran', 'w').close()\n",
    "usercustomize.py": "open('ran', 'w').close()\n",
}
"""Content of the files of settings that a dependency reads, or might read, in its folder."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for seed in range(4):
        made = synthetic_recording(f"grasp{seed}", seed, ("thumb", "index"))
        save_recording(made, folder / f"grasp{seed}.parquet")
    return folder


@pytest.fixture
def run(tmp_path):
    """Runs a program in a folder with a module of each name, as a console script is run."""
    folder, scripts, marker = tmp_path / "data", tmp_path / "scripts", tmp_path / "imported"
    folder.mkdir()
    scripts.mkdir()
    for name in (*sys.stdlib_module_names, *OTHER_MODULES):
        (folder / f"{name}.py").write_text(MARK.format(marker=str(marker), name=name))
    (folder / "my_gripper.py").write_text(GRIPPER)
    (folder / "beside.py").write_text(BESIDE)

    def run(*words, program=COMMAND):
        (scripts / "program.py").write_text(program)
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
        done = subprocess.run(
            [sys.executable, str(scripts / "program.py"), *map(str, words)],
            cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert not marker.exists(), marker.read_text()
        return folder

    return run


def test_training(run, tmp_path, recordings):
    model = tmp_path / "model.json"
    run("train", recordings, "-o", model, "--trials", "0", "--jobs", "2")


def test_the_watchdog_of_a_hand(run):
    """A function of this folder that is named as the hand is the only thing that runs."""
    folder = run("call:my_gripper:set_force", program=WATCHDOG)
    assert len((folder / "commands").read_text().splitlines()) == N_SAFE_COMMANDS


def test_the_twin_that_simulates_the_next_grasp(run):
    """The page and the recorder loop as well; this is the source that both read."""
    program = (
        "import sys\n"
        "from holdfast.devices.sources import open_source\n"
        "with open_source(sys.argv[1], speed=0, loop=True) as source:\n"
        "    while not any('-2' in n for n in source.read(60.0).notices):\n"
        "        pass\n"
    )
    run("twin:?object=can&seed=1", program=program)


def test_settings_in_the_folder_run_no_code(tmp_path, recordings):
    for name, content in HOSTILE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    words = ("info", str(recordings / "grasp0.parquet"), "--plot", "grasp.png")
    subprocess.run([sys.executable, "-P", "-c", COMMAND, *words], cwd=tmp_path, check=True)
    assert not (tmp_path / "ran").exists()


def test_a_child_finds_the_modules_of_its_parent(monkeypatch, tmp_path):
    (tmp_path / "beside.py").write_text("NAME = 'beside'")
    monkeypatch.syspath_prepend(tmp_path)
    program = "import beside, json; print(json.dumps([beside.NAME, sys.argv[1:], sys.path]))"
    done = subprocess.run(python_command(program, "a", "b"), stdout=subprocess.PIPE, check=True)
    assert json.loads(done.stdout) == ["beside", ["a", "b"], sys.path]
