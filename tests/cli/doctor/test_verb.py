import json
import socket
import sys
from importlib import metadata

import numpy as np
import pytest

from holdfast import save_recording
from holdfast.cli import main
from holdfast.devices.sources.xela import places
from holdfast.devices.uri import source_states
from holdfast.errors import EXTRA_PURPOSES, install_command
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor, sensor


@pytest.fixture(autouse=True)
def no_children(monkeypatch):
    """Start no Python for each plug-in: `tests/test_plugins.py` has what the children answer."""
    monkeypatch.setattr("holdfast.children.answer_of_child", lambda *words: "")


def report(capsys):
    assert main(["doctor", "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    return json.loads(out)


def test_versions(capsys):
    found = report(capsys)
    assert found["holdfast"] == metadata.version("holdfast")
    assert found["packages"]["numpy"] == np.__version__
    assert found["cpus"] >= 1


def test_the_limits_of_imports(capsys, monkeypatch):
    found = report(capsys)["limits"]
    assert set(found) == {"processor", "memory"}
    monkeypatch.setattr("holdfast.io.foreign.limits", lambda: {"processor": True, "memory": False})
    assert main(["doctor"]) == 0
    assert "processor (NOT memory)" in capsys.readouterr().out


def test_the_kernel_works(capsys):
    assert report(capsys)["kernels"] == {"ok": True, "error": None}
    assert main(["doctor"]) == 0
    assert [line.split() for line in capsys.readouterr().out.splitlines()][4] == ["kernel", "works"]


def test_every_extra_has_a_purpose_and_a_way_to_get_it(capsys):
    extras = report(capsys)["extras"]
    assert set(extras) == set(EXTRA_PURPOSES)
    assert extras["hdf5"]["install"] == install_command("hdf5")


def test_missing_packages_are_reported(capsys, monkeypatch):
    known = metadata.version

    def version(package):
        if package != "holdfast":
            raise metadata.PackageNotFoundError(package)
        return known(package)

    monkeypatch.setattr(metadata, "version", version)
    found = report(capsys)
    assert found["packages"]["numpy"] is None
    assert found["extras"]["hdf5"]["installed"] is False
    assert main(["doctor"]) == 0
    out = capsys.readouterr().out
    assert "MISSING" in out
    assert install_command("hdf5") in out


def test_broken_kernels_are_reported_with_exit_code_0(capsys, monkeypatch):
    def broken(force):
        raise RuntimeError("no kernel")

    monkeypatch.setattr("holdfast.features.haar_features", broken)
    assert report(capsys)["kernels"]["error"] == "RuntimeError: no kernel"
    assert main(["doctor"]) == 0
    assert "RuntimeError: no kernel" in capsys.readouterr().out


@pytest.mark.parametrize("found", [True, False])
def test_where_the_data_are(capsys, monkeypatch, tmp_path, found):
    path = tmp_path if found else tmp_path / "none"
    monkeypatch.setenv("HOLDFAST_DATA", str(path))
    assert report(capsys)["data"] == {"path": str(path), "found": found}


def test_no_data(capsys, monkeypatch):
    monkeypatch.delenv("HOLDFAST_DATA", raising=False)
    assert report(capsys)["data"] == {"path": None, "found": False}
    assert main(["doctor"]) == 0
    assert "not set" in capsys.readouterr().out


def test_what_can_be_reached(capsys, monkeypatch):
    monkeypatch.setattr("holdfast.devices.sources.xela.places.own_address", lambda: None)
    found = report(capsys)["sources"]
    assert {"xela", "serial"} <= set(found)
    assert "127.0.0.1:5000" in found["xela"]
    assert main(["doctor"]) == 0
    assert found["serial"] in capsys.readouterr().out


def test_a_listening_server_is_reported(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setattr(places, "PORT", server.getsockname()[1])
        assert source_states()["xela"].startswith("a server listens at 127.0.0.1:")


def test_missing_extras_are_reported(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)
    monkeypatch.delitem(sys.modules, "holdfast.devices.sources.serial", raising=False)
    assert source_states()["serial"] == f"not installed: {install_command('serial')}"


def test_the_modules_of_a_source(capsys, tmp_path):
    path, history = tmp_path / "open.parquet", tmp_path / "history.json"
    readings = 33_000 + np.rint(np.random.default_rng(0).normal(0, 3, (300, 16, 3)))
    module = Tactile(sensor("uskin-4x4"), np.arange(300) / 100, readings)
    save_recording(Recording("open", {"index": module}), path)
    call = ["doctor", str(path), "--history", str(history), "--plot", str(tmp_path / "x.svg")]
    assert main(call) == 0
    out, err = capsys.readouterr()
    assert "\nindex " in out
    assert out.endswith("- nothing is wrong, and nothing is worse than at the last check\n")
    assert err.endswith("x.svg written\n") and (tmp_path / "x.svg").exists()
    assert main([*call, "--force", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (list(found["modules"]), found["findings"]) == (["index"], [])
    assert found["last"] == found["date"] and found["history"] == str(history)


def test_a_touched_hand_is_one_line(capsys, tmp_path):
    path, history = tmp_path / "touched.parquet", tmp_path / "history.json"
    readings = 33_000 + np.rint(np.random.default_rng(0).normal(0, 3, (300, 16, 3)))
    readings[200:, 5, 2] += 500  # one step, louder than any noise
    module = Tactile(sensor("uskin-4x4"), np.arange(300) / 100, readings)
    save_recording(Recording("touched", {"index": module}), path)
    assert main(["doctor", str(path), "--history", str(history)]) == 2
    err = capsys.readouterr().err
    assert err.startswith("holdfast: index was touched at 2.1 s: ") and err.count("\n") == 1
    assert not history.exists()


def test_a_module_of_one_taxel_is_one_line(capsys, tmp_path):
    flat = sensor("anyskin")
    one = Sensor("one", flat.positions[:1], flat.rotations[:1], flat.normal, 100.0, magnetic=True)
    readings = np.random.default_rng(0).normal(0, 3, (300, 1, 3))
    path = tmp_path / "one.parquet"
    save_recording(Recording("one", {"index": Tactile(one, np.arange(300) / 100, readings)}), path)
    assert main(["doctor", str(path), "--history", str(tmp_path / "history.json")]) == 0
    out = capsys.readouterr().out
    assert out.endswith("- index has one taxel: a field and a touch look the same in it\n")


def test_a_sensor_without_positions_is_one_line(capsys, tmp_path):
    path = tmp_path / "sensor.json"
    path.write_text('{"name": "x", "rotations": [], "normal": [0, 0, 1], "rate": 100}')
    assert main(["doctor", f"serial:///dev/null?sensor={path}"]) == 2
    assert capsys.readouterr().err == (
        f"holdfast: serial:///dev/null?sensor={path}: {path}: fields ['positions'] are missing in "
        "a sensor; it needs ['name', 'normal', 'positions', 'rate', 'rotations']\n"
    )


def test_options_of_a_check_need_a_source(capsys):
    assert main(["doctor", "--history", "x.json"]) == 2
    assert capsys.readouterr().err == (
        "holdfast: --plot and --history are for the modules of a source; SOURCE expected\n"
    )
