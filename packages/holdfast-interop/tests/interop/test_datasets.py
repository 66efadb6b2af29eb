import json
import shutil

import pytest

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
DETECTED = {
    "uskin-pick-move": ("data_sample_2022-02-22-08-10-01", 5),
    "eflesh-tugs": ("seq_0", 69),
    "gtac-grasps": ("Apple_700_GTAC_20220826_212333", 21),
    "gtac-manipulation": ("translating_strawberry", 3),
}
"""A recording of each set, and how many have checksums."""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOLDFAST_DATASETS", str(tmp_path / "cache"))
    return tmp_path / "cache"


def run(capsys, *words, code=0):
    assert main(["datasets", *map(str, words)]) == code
    out, err = capsys.readouterr()
    return err if code else out


def refused(capsys, *words):
    text = run(capsys, *words, code=2)
    assert text.count("\n") == 1
    return text.removeprefix("holdfast: ").rstrip("\n")


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
    documents = json.loads(run(capsys, "--json"))["datasets"]
    assert [document["name"] for document in documents] == list(public_sets())
    first = documents[0]
    assert (first["n_files"], first["n_checksums"], first["licence"]) == (42, 30, "MIT")
    out = run(capsys)
    assert all(name.partition("-")[0] in out for name in public_sets())
    assert "No address could be tried" in " ".join(out.split())


def test_one_set(capsys):
    document = json.loads(run(capsys, "list", "gtac-grasps", "--json"))
    assert (document["licence"], document["size"]) == ("MIT", 26_000_000)
    assert (document["tried"], document["reason"]) == (True, "")
    assert "GTac_Gripper_V2" in run(capsys, "list", "gtac-grasps")


def test_from_the_registry_to_recordings(capsys, made_up, cache):
    document = json.loads(run(capsys, "get", "made-up", "out", "--json"))
    assert (document["n_files"], document["n_unchecked"], document["n_recordings"]) == (2, 2, 2)
    assert load_recording(document["recordings"][0]["path"]).modules["finger1"].n_samples == 200
    assert sorted(p.name for p in cache.rglob("*")) == ["made-up", "one.csv", "two.csv"]
    assert made_up.requests == ["made-up/one.csv", "made-up/two.csv"]


def test_what_is_printed(capsys, made_up):
    assert main(["datasets", "get", "made-up"]) == 0
    out, err = capsys.readouterr()
    assert "2 recordings with 2 modules and 400 samples in made-up" in out
    assert "2 of 2 files have no known sha256 and were not checked\n" in err
    assert "licence: MIT (https://made-up.example); downloads are in " in err
    assert err.endswith("next: holdfast detect builtin:any made-up/one.parquet\n")


def test_only_some_files(capsys, made_up):
    document = json.loads(run(capsys, "get", "made-up", "a", "--only", "*two*", "--json"))
    assert [recording["name"] for recording in document["recordings"]] == ["two"]
    run(capsys, "get", "made-up", "b")
    document = json.loads(run(capsys, "get", "made-up", "c", "--only", "one.csv", "--json"))
    assert [recording["name"] for recording in document["recordings"]] == ["one"]
    assert len(made_up.requests) == 2
    text = refused(capsys, "get", "made-up", "d", "--only", "three")
    assert text == "made-up: no file is left; it has 2, such as one.csv"
    text = refused(capsys, "get", "made-up", "d", "--with-checksum")
    assert text == "made-up: no file is left; it has 2, such as one.csv"


def test_a_mirror(capsys, made_up, monkeypatch):
    elsewhere = PublicSet(
        **{**{f: getattr(made_up.public, f) for f in made_up.public.__struct_fields__},
           "address": "https://127.0.0.1:9/"}
    )  # fmt: skip
    monkeypatch.setitem(public_sets(), "made-up", elsewhere)
    run(capsys, "get", "made-up", "out", "--mirror", made_up.url)
    assert made_up.requests[0] == "made-up/one.csv"
    assert "https://127.0.0.1:9/one.csv cannot be loaded" not in capsys.readouterr().err


def test_bad_input(capsys, made_up):
    assert refused(capsys, "get").startswith("get NAME expected; there are uskin-pick-move, ")
    assert refused(capsys, "get", "slip").startswith("unknown data set 'slip'; there are uskin-p")
    assert refused(capsys, "list", "slip").startswith("unknown data set 'slip'; there are uskin-p")
    text = refused(capsys, "get", "made-up", "out", "--mirror", "ftp://x")
    assert text == "--mirror: an address such as http://HOST:8000 expected, 'ftp://x' given"
    made_up.replaced["made-up/two.csv"] = csv_of(1).encode() + b"2.0,a\n"
    text = refused(capsys, "get", "made-up", "out")
    assert f"{find_cache()}/two.csv" in text
    assert ".import." not in text


def find_cache():
    from holdfast_interop.datasets.download import download_folder

    return download_folder("made-up")


def test_nothing_is_overwritten(capsys, made_up):
    run(capsys, "get", "made-up", "out")
    assert "exists already" in refused(capsys, "get", "made-up", "out")
    run(capsys, "get", "made-up", "out", "--force")


@pytest.mark.parametrize("name", FOLDERS)
def test_real_recordings_from_a_server_to_a_decision(name, capsys, data_folder, tmp_path):
    """The files that have a checksum: `get`, `info` and `detect`."""
    shutil.copytree(data_folder / FOLDERS[name], tmp_path / "remote" / name)
    recording, n_recordings = DETECTED[name]
    with serving(tmp_path / "remote") as server:
        words = ("get", name, "--with-checksum", "--mirror", server.url, "--json")
        document = json.loads(run(capsys, *words))
        n_files = len(set(server.requests))
    assert (document["n_recordings"], document["n_unchecked"]) == (n_recordings, 0)
    assert n_files == document["n_files"]
    path = tmp_path / name / f"{recording}.parquet"
    assert main(["info", str(path), "--json"]) == 0
    modules = json.loads(capsys.readouterr().out)["modules"]
    public = find_set(name)
    assert {module["sensor"] for module in modules.values()} == set(public.sensors)
    assert len(modules) == public.n_modules
    for module in modules.values():
        assert module["rate"] == pytest.approx(public.rate, rel=0.02)
    words = ["detect", "builtin:any", str(path), "--json", *["--in-contact"] * public.starts_loaded]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "STABLE" in {json.loads(line)["state"] for line in lines}
