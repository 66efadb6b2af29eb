import json
import socket
import sys
from importlib import metadata

import numpy as np

from holdfast import save_recording
from holdfast.cli import main
from holdfast.devices.sources.xela import addresses
from holdfast.devices.uri import source_states
from holdfast.errors import DISTRIBUTION, EXTRA_PURPOSES, install_command
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor, sensor


def report(capsys):
    assert main(["doctor", "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    return json.loads(out)


def test_the_report(capsys, monkeypatch):
    monkeypatch.setattr("holdfast.devices.sources.xela.addresses.own_address", lambda: None)
    found = report(capsys)
    assert found["holdfast"] == metadata.version("holdfast-tactile")
    assert found["packages"]["numpy"] == np.__version__
    assert found["cpus"] >= 1
    assert found["kernels"] == {"ok": True, "error": None}
    assert set(found["extras"]) == set(EXTRA_PURPOSES)
    assert found["extras"]["hdf5"]["install"] == install_command("hdf5")
    assert {"xela", "serial"} <= set(found["sources"])
    assert "127.0.0.1:5000" in found["sources"]["xela"]
    assert set(found["limits"]) == {"processor", "memory"}
    monkeypatch.setattr("holdfast.io.foreign.limits", lambda: {"processor": True, "memory": False})
    assert main(["doctor"]) == 0
    out = capsys.readouterr().out
    assert found["sources"]["serial"] in out
    assert "NOT memory" in out


def test_missing_packages_are_reported(capsys, monkeypatch):
    known = metadata.version

    def version(package):
        if package != DISTRIBUTION:
            raise metadata.PackageNotFoundError(package)
        return known(package)

    monkeypatch.setattr(metadata, "version", version)
    assert report(capsys)["extras"]["hdf5"]["installed"] is False
    assert main(["doctor"]) == 0
    assert install_command("hdf5") in capsys.readouterr().out


def test_broken_kernels_are_reported_with_exit_code_0(capsys, monkeypatch):
    def broken(force):
        raise RuntimeError("no kernel")

    monkeypatch.setattr("holdfast.detection.haar_features", broken)
    assert report(capsys)["kernels"]["error"] == "RuntimeError: no kernel"
    assert main(["doctor"]) == 0
    assert "RuntimeError: no kernel" in capsys.readouterr().out


def test_where_the_data_are(capsys, monkeypatch, tmp_path):
    for path, found in ((tmp_path, True), (tmp_path / "none", False)):
        monkeypatch.setenv("HOLDFAST_DATA", str(path))
        assert report(capsys)["data"] == {"path": str(path), "found": found}
    monkeypatch.delenv("HOLDFAST_DATA")
    assert report(capsys)["data"] == {"path": None, "found": False}


def test_a_listening_server_is_reported(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setattr(addresses, "PORT", server.getsockname()[1])
        assert source_states()["xela"].startswith("a server listens at 127.0.0.1:")


def test_missing_extras_are_reported(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)
    monkeypatch.delitem(sys.modules, "holdfast.devices.sources.serial", raising=False)
    assert source_states()["serial"] == f"not installed: {install_command('serial')}"


def test_the_modules_of_a_source(capsys, tmp_path):
    plot = tmp_path / "x.svg"
    call = ["doctor", saved(tmp_path, sensor("uskin-4x4"))]
    assert main([*call, "--plot", str(plot)]) == 0
    out, err = capsys.readouterr()
    assert "\nindex " in out
    assert err.endswith("x.svg written\n") and plot.exists()
    assert main([*call, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (list(found["modules"]), found["findings"]) == (["index"], [])


def test_a_module_of_one_taxel_is_said(capsys, tmp_path):
    flat = sensor("anyskin")
    one = Sensor("one", flat.positions[:1], flat.rotations[:1], flat.normal, 100.0, magnetic=True)
    assert main(["doctor", saved(tmp_path, one)]) == 0
    assert "index has one taxel" in capsys.readouterr().out.splitlines()[-1]


def saved(folder, which):
    """Return the path of three seconds of noise of a module."""
    noise = np.random.default_rng(0).normal(0, 3, (300, which.n_taxels, 3))
    module = Tactile(which, np.arange(300) / 100, 33_000 + np.rint(noise))
    save_recording(Recording("open", {"index": module}), folder / "open.parquet")
    return str(folder / "open.parquet")
