import json
import shutil
import subprocess

import numpy as np
import pytest

from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording
from loopback import serving

from .blocks import BIN

FINGERS = ("thumb", "index", "middle", "ring")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working folder, with the settings of no user."""
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


@pytest.fixture
def hand(tmp_path_factory):
    """The address of a server that sends a grasp, as the one of a hand does."""
    path = tmp_path_factory.mktemp("hand") / "grasp.parquet"
    save_recording(synthetic_recording("grasp", 0, FINGERS), path)
    command = [BIN / "holdfast", "play", path, "--port", "0", "--separate", "--json"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        yield json.loads(server.stdout.readline())["uri"]
    finally:
        server.kill()
        server.communicate()


@pytest.fixture
def public_box(folder, data_folder, monkeypatch):
    """The command that downloads `uskin-pick-move`, from a server on this machine."""
    pytest.importorskip("pooch", reason="pooch is not installed")
    monkeypatch.setenv("HOLDFAST_DATASETS", str(folder / "cache"))
    shutil.copytree(data_folder / "uskin_pick_move", folder / "remote" / "uskin-pick-move")
    with serving(folder / "remote") as server:
        command = "holdfast datasets get uskin-pick-move"
        yield {command: f"{command} --with-checksum --mirror {server.url}"}


@pytest.fixture
def csv_recordings(folder):
    """A function that writes grasps as CSV files to a folder."""

    def write(name):
        (folder / name).mkdir()
        for seed in (0, 1, 2):
            (module,) = synthetic_recording(f"grasp{seed}", seed, ("thumb",)).modules.values()
            columns = np.c_[module.times, module.readings.reshape(module.n_samples, -1)]
            taxels = range(module.sensor.n_taxels)
            names = ["time", *(f"{axis}{taxel}" for taxel in taxels for axis in "xyz")]
            np.savetxt(
                folder / name / f"grasp{seed}.csv", columns, delimiter=",",
                fmt=["%.6f"] + ["%d"] * (columns.shape[1] - 1),
                header=",".join(names), comments="",
            )  # fmt: skip

    return write
