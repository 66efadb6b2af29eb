"""The verbs that take `--engine` give the same files on a cluster, and refuse a wrong address."""

import msgspec
import pytest

from command_line import Verb
from holdfast import cluster as cluster_module
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording
from holdfast.twin import simulation
from holdfast.twin.profile import profile

pytestmark = pytest.mark.slow

SHORT = msgspec.structs.replace(profile("reference"), idle=(0.2, 0.3), hold=1.0)
HEADER = "# sensor: anyskin\ntime," + ",".join(f"t{n:02d}_{a}" for n in range(1, 6) for a in "xyz")


@pytest.fixture(scope="module")
def cluster():
    """The address of a cluster of two threads of this process."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, protocol="tcp://", host="127.0.0.1",
        dashboard_address="127.0.0.1:0", silence_logs=50,
    ) as running:  # fmt: skip
        yield running.scheduler_address


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A working folder with recordings and a folder to import."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(simulation, "profile", lambda name: SHORT)
    for name in ("data", "in"):
        (tmp_path / name).mkdir()
    for k in range(2):
        save_recording(synthetic_recording(f"grasp-{k}", k, ("thumb",)), f"data/grasp-{k}.parquet")
    for name in "ab":
        rows = "".join(f"{k / 100},{','.join(str(k + c) for c in range(15))}\n" for k in range(40))
        (tmp_path / "in" / f"{name}.csv").write_text(f"{HEADER}\n{rows}")
    return tmp_path


run = Verb().document


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_simulate(capsys, cluster, folder):
    words = ("--objects", "flask", "--cases", 1, "--repeats", 1)
    alone = run(capsys, "simulate", "alone", *words, "--jobs", 1)
    there = run(capsys, "simulate", "there", *words, "--engine", f"dask:{cluster}")
    assert there["recordings"] == alone["recordings"]
    assert contents(folder / "there") == contents(folder / "alone")


def test_import(capsys, cluster, folder):
    alone = run(capsys, "import", "in", "alone")
    there = run(capsys, "import", "in", "there", "--engine", f"dask:{cluster}")
    assert [each["name"] for each in there["recordings"]] == ["a", "b"]
    assert there["recordings"][0]["path"] == "there/a.parquet"
    assert there["n_samples"] == alone["n_samples"] == 80
    assert contents(folder / "there") == contents(folder / "alone")


def test_train_and_evaluate(capsys, cluster, folder):
    words = ("train", "data", "--trials", 0)
    alone = run(capsys, *words, "-o", "alone.json")
    there = run(capsys, *words, "-o", "there.json", "--engine", f"dask:{cluster}")
    assert (folder / "there.json").read_bytes() == (folder / "alone.json").read_bytes()
    assert there["cross_validation"] == alone["cross_validation"]
    words = ("evaluate", "there.json", "data")
    assert run(capsys, *words, "--engine", f"dask:{cluster}") == run(capsys, *words)


def test_no_scheduler_at_the_address(capsys, monkeypatch, folder):
    monkeypatch.setattr(cluster_module, "SCHEDULER_TIMEOUT", 0.5)
    words = ("train", "data", "-o", "model.json", "--engine", "dask:tcp://127.0.0.1:1")
    assert "tcp://127.0.0.1:1" in Verb().refusal(capsys, *words)
    assert not (folder / "model.json").exists()


def test_a_folder_that_the_workers_do_not_share(capsys, cluster, monkeypatch):
    name = "holdfast.simulated_grasps.simulate_grasp"
    monkeypatch.setattr(name, lambda grasp, out, force: [grasp.name])
    words = ("--objects", "flask", "--cases", "1", "--repeats", "1", "--engine", f"dask:{cluster}")
    assert "flask-case1-1.parquet" in Verb("simulate").refusal(capsys, "there", *words)
