import json
import shutil
import sys

import msgspec
import numpy as np
import pytest

from holdfast.cli import main
from holdfast.io import load_recording
from holdfast.synthetic import synthetic_recording
from holdfast_interop.datasets import PublicFile, PublicSet, find_set, public_sets, verb
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
            "made-up", "t", ("uskin-curved",), "none", "MIT", False, importer="csv",
            size=2_000_000, address=f"{server.url}/made-up/", page="https://made-up.example",
            files=files,
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
    document = json.loads(run(capsys, "list", "arq-slip-2021", "--json"))
    assert (document["licence"], document["size"]) == ("BSD-3-Clause", 266271772)
    out = run(capsys, "list", "sparsh-skin")
    assert "pickles" in out


def test_from_the_registry_to_recordings(capsys, made_up, cache):
    document = json.loads(run(capsys, "get", "made-up", "out", "--json"))
    assert (document["n_files"], document["n_unchecked"], document["n_recordings"]) == (2, 2, 2)
    assert load_recording(document["recordings"][0]["path"]).modules["finger1"].n_samples == 200
    assert sorted(p.name for p in cache.rglob("*")) == ["made-up", "one.csv", "two.csv"]
    assert made_up.requests == [("made-up/one.csv", 0), ("made-up/two.csv", 0)]


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
    assert made_up.requests[0] == ("made-up/one.csv", 0)
    assert "https://127.0.0.1:9/one.csv cannot be reached" not in capsys.readouterr().err


def test_gigabytes_need_a_yes(capsys, made_up, monkeypatch):
    monkeypatch.setattr(verb, "CONFIRMED_SIZE", 2_000_000)
    text = refused(capsys, "get", "made-up", "out")
    assert text == "made-up has 2 MB: give --yes to download it"
    assert made_up.requests == []
    run(capsys, "get", "made-up", "out", "--yes")
    assert len(made_up.requests) == 2


@pytest.mark.parametrize("answer", [True, False])
def test_a_person_is_asked(capsys, made_up, monkeypatch, answer):
    asked = []
    monkeypatch.setattr(verb, "CONFIRMED_SIZE", 2_000_000)
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(verb.typer, "confirm", lambda text, err: asked.append(text) or answer)
    run(capsys, "get", "made-up", "out")
    assert asked == ["made-up has 2 MB. Download it?"]
    assert bool(made_up.requests) is answer


def test_bad_input(capsys, made_up):
    assert refused(capsys, "get").startswith("get NAME expected; there are uskin-pick-move, ")
    assert refused(capsys, "get", "slip").startswith("unknown data set 'slip'; there are uskin-p")
    assert refused(capsys, "list", "slip").startswith("unknown data set 'slip'; there are uskin-p")
    text = refused(capsys, "get", "arq-slip-2023")
    assert text == (
        "arq-slip-2023 is not downloaded: its data are not in the repository: ask its authors "
        "(https://github.com/ARQ-CRISP); there are also uskin-pick-move, eflesh-tugs, gtac-grasps, "
        "gtac-manipulation, arq-slip-2021, anyskin-slip, made-up"
    )
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
        n_files = len({path for path, _ in server.requests})
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


def skin_csv(seed, n=500):
    """A file of the columns of `anyskin-slip`, 231 Hz: the readings tremble while it slips."""
    draw = np.random.default_rng(seed)
    slips = (np.arange(n) % 100 >= 70) & (np.arange(n) > 150)
    press = np.tile([20, 5, 300], 5) * np.repeat([0.35, 0.8, 1, 0.6, 0.2], 3)
    values = draw.normal(0, 1, (n, 15)) + press * np.clip(np.arange(n) / 20 - 6, 0, 1)[:, None]
    values += slips[:, None] * draw.normal(0, 12, (n, 15))
    names = [f"mag{node}_{axis}" for node in range(1, 6) for axis in "xyz"]
    rows = [
        ",".join([f"{1738576800 + k / 231:.6f}", *(f"{x:.3f}" for x in row), str(int(slips[k]))])
        for k, row in enumerate(values)
    ]
    return "\n".join([",".join(["log_time", *names, "slip"]), *rows]) + "\n"


def test_the_published_split_is_one_command(capsys, tmp_path, monkeypatch):
    public = find_set("anyskin-slip")
    assert len(public.files) == 17
    assert all(file.size and file.sha256 for file in public.files)
    assert set(public.test) < {file.path.removesuffix(".csv") for file in public.files}
    (tmp_path / "remote" / "anyskin-slip").mkdir(parents=True)
    for seed, file in enumerate(public.files):
        (tmp_path / "remote" / "anyskin-slip" / file.path).write_text(skin_csv(seed))
    files = tuple(PublicFile(file.path) for file in public.files)
    with serving(tmp_path / "remote") as server:
        address = f"{server.url}/anyskin-slip/"
        monkeypatch.setitem(
            public_sets(),
            public.name,
            msgspec.structs.replace(public, address=address, files=files),
        )
        document = json.loads(run(capsys, "get", public.name, "--json"))
    assert document["n_recordings"] == 17
    scores = json.loads(run(capsys, "score", public.name, "--json"))
    assert scores["test"] == ["grappe", "socks", "tissues"]
    assert scores["always no slip"]["auc"] == scores["chance"]["auc"] == 0.5
    assert scores["model"]["auc"] > 0.8
    assert scores["model"]["ap"] > 2 * scores["chance"]["ap"]
    out = run(capsys, "score", public.name)
    assert [line.split()[0] for line in out.splitlines()] == ["slip", "model", "always", "chance"]
    (tmp_path / public.name / "socks.parquet").unlink()
    text = refused(capsys, "score", public.name)
    assert text == "anyskin-slip has no recording 'socks', which the split tests on"
    assert refused(capsys, "score", "eflesh-tugs") == "eflesh-tugs has no published split"
