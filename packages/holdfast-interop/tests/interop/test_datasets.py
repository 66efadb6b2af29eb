import json
import shutil
from hashlib import sha256

import msgspec
import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.io import load_recording
from holdfast.synthetic import synthetic_recording
from holdfast_interop.datasets import PublicFile, PublicSet, find_set, public_sets
from loopback import serving

pytestmark = pytest.mark.slow

FOLDERS = {
    "uskin-pick-move": "uskin_pick_move", "eflesh-tugs": "eflesh_slip", "gtac-grasps": "gtac_v2",
    "gtac-manipulation": "gtac",
}  # fmt: skip
"""Folder of the real recordings that has files of a set."""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOLDFAST_DATASETS", str(tmp_path / "cache"))
    return tmp_path / "cache"


VERB = Verb("datasets")
refused, document_of = VERB.refusal, VERB.document


def csv_of(seed):
    thumb = synthetic_recording("grasp", seed=seed).modules["thumb"]
    columns = [f"t{taxel:02}.{axis}" for taxel in range(1, 31) for axis in "xyz"]
    rows = [",".join(["time", *columns])]
    for time, sample in zip(thumb.times[:200], thumb.readings[:200].reshape(-1, 90), strict=True):
        rows.append(",".join(map(str, [time, *sample])))
    return "# sensor: uskin-curved\n" + "\n".join(rows) + "\n"


@pytest.fixture
def made_up(tmp_path, monkeypatch):
    """A set of two files on a server, among those of the registry."""
    (tmp_path / "remote" / "made-up").mkdir(parents=True)
    for name in ("one", "two"):
        (tmp_path / "remote" / "made-up" / f"{name}.csv").write_text(csv_of(len(name)))
    with serving(tmp_path / "remote") as server:
        files = (PublicFile("one.csv"), PublicFile("two.csv"))
        public = PublicSet(
            "made-up", "t", ("uskin-curved",), 1, 150.0, "none", "MIT", "https://made-up.example",
            2_000_000, "csv", f"{server.url}/made-up/", files,
        )  # fmt: skip
        monkeypatch.setitem(public_sets(), "made-up", public)
        server.public = public
        yield server


def test_the_list(capsys):
    documents = document_of(capsys)["datasets"]
    assert [document["name"] for document in documents] == list(public_sets())
    first = documents[0]
    assert (first["n_files"], first["n_checksums"], first["licence"]) == (42, 30, "MIT")
    document = document_of(capsys, "list", "gtac-grasps")
    assert (document["licence"], document["size"], document["tried"]) == ("MIT", 26_000_000, True)


def test_from_the_registry_to_recordings(capsys, made_up, cache):
    document = document_of(capsys, "get", "made-up", "out")
    assert (document["n_files"], document["n_unchecked"], document["n_recordings"]) == (2, 2, 2)
    assert load_recording(document["recordings"][0]["path"]).modules["finger1"].n_samples == 200
    assert sorted(p.name for p in cache.rglob("*")) == ["made-up", "one.csv", "two.csv"]
    assert made_up.requests == ["made-up/one.csv", "made-up/two.csv"]


def test_a_mirror(capsys, made_up, monkeypatch):
    elsewhere = msgspec.structs.replace(made_up.public, address="https://127.0.0.1:9/")
    monkeypatch.setitem(public_sets(), "made-up", elsewhere)
    document_of(capsys, "get", "made-up", "out", "--mirror", made_up.url)
    assert made_up.requests[0] == "made-up/one.csv"


def test_bad_input(capsys, made_up, cache):
    for words, named in (
        (("get",), "get NAME"),
        (("get", "slip"), "'slip'"),
        (("list", "slip"), "'slip'"),
        (("get", "made-up", "out", "--mirror", "ftp://x"), "--mirror"),
    ):
        assert named in refused(capsys, *words)
    rows = csv_of(1).splitlines()
    rows[5] = "a" + rows[5]
    made_up.replaced["made-up/two.csv"] = "\n".join(rows).encode()
    text = refused(capsys, "get", "made-up", "out")
    assert f"{cache}/made-up/two.csv" in text
    assert ".import." not in text


@pytest.mark.parametrize("name", FOLDERS)
def test_checksums_are_those_of_the_real_files(name, data_folder):
    known = {file.path: file.sha256 for file in find_set(name).files if file.sha256}
    assert known
    for path, expected in known.items():
        content = (data_folder / FOLDERS[name] / path).read_bytes()
        assert sha256(content).hexdigest() == expected


def test_real_recordings_from_a_server_to_a_decision(capsys, data_folder, tmp_path):
    """The files that have a checksum: `get`, `info` and `detect`."""
    name, public = "gtac-manipulation", find_set("gtac-manipulation")
    shutil.copytree(data_folder / FOLDERS[name], tmp_path / "remote" / name)
    with serving(tmp_path / "remote") as server:
        words = ("get", name, "--with-checksum", "--mirror", server.url)
        document = document_of(capsys, *words)
        assert len(set(server.requests)) == document["n_files"]
    assert (document["n_recordings"], document["n_unchecked"]) == (3, 0)
    path = tmp_path / name / "translating_strawberry.parquet"
    (module,) = Verb("info").document(capsys, path)["modules"].values()
    assert [module["sensor"]] == list(public.sensors)
    assert module["rate"] == pytest.approx(public.rate, rel=0.02)
    assert main(["detect", "builtin:any", str(path), "--json"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "STABLE" in {json.loads(line)["state"] for line in lines}
