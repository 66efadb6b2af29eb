"""The verbs that take `--jobs` give the same files by several processes."""

import msgspec
import pytest
from joblib.externals.loky import get_reusable_executor

from command_line import Verb
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording
from holdfast.twin import simulation
from holdfast.twin.profile import profile

pytestmark = pytest.mark.slow

SHORT = msgspec.structs.replace(profile("reference"), idle=(0.2, 0.3), hold=1.0)
HEADER = "# sensor: anyskin\ntime," + ",".join(f"t{n:02d}_{a}" for n in range(1, 6) for a in "xyz")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A working folder with recordings and a folder to import."""
    get_reusable_executor().shutdown()  # its processes are in the folder of an earlier test
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


def test_simulate(capsys, folder):
    words = ("--objects", "flask", "--cases", 1, "--repeats", 1)
    alone = run(capsys, "simulate", "alone", *words, "--jobs", 1)
    there = run(capsys, "simulate", "there", *words, "--jobs", 2)
    assert there["recordings"] == alone["recordings"]
    assert contents(folder / "there") == contents(folder / "alone")


def test_import(capsys, folder):
    alone = run(capsys, "import", "in", "alone")
    there = run(capsys, "import", "in", "there", "--jobs", 2)
    assert [each["name"] for each in there["recordings"]] == ["a", "b"]
    assert there["recordings"][0]["path"] == "there/a.parquet"
    assert there["n_samples"] == alone["n_samples"] == 80
    assert contents(folder / "there") == contents(folder / "alone")


def test_train_and_evaluate(capsys, folder):
    words = ("train", "data", "--trials", 0)
    alone = run(capsys, *words, "-o", "alone.json")
    there = run(capsys, *words, "-o", "there.json", "--jobs", 2)
    assert (folder / "there.json").read_bytes() == (folder / "alone.json").read_bytes()
    assert there["cross_validation"] == alone["cross_validation"]
    words = ("evaluate", "there.json", "data")
    assert run(capsys, *words, "--jobs", 2) == run(capsys, *words)
