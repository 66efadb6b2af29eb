"""A folder with damaged files: every command lists it, and marks the bad ones."""

import json
import shutil

import pytest

from holdfast.cli import main
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    folder = tmp_path_factory.mktemp("originals")
    for suffix in ("parquet", "mcap"):
        save_recording(synthetic_recording("a", 0, ("thumb",)), folder / f"a.{suffix}")
    return folder


@pytest.fixture
def folder(originals, tmp_path):
    """A folder with a good recording and several that cannot be read."""
    parquet, mcap = ((originals / f"a.{suffix}").read_bytes() for suffix in ("parquet", "mcap"))
    folder = tmp_path / "recordings"
    folder.mkdir()
    shutil.copy(originals / "a.parquet", folder / "good.parquet")
    cut = bytearray(mcap[: len(mcap) // 2])
    cut[cut.index(b"zstd") + 11] = 0xFF  # the highest byte of the length of the first chunk's data
    damaged = bytearray(parquet)
    damaged[len(damaged) // 2] ^= 1
    for name, data in {
        "cut.mcap": bytes(cut),
        "empty.mcap": b"",
        "flipped.parquet": bytes(damaged),
        "half.parquet": parquet[: len(parquet) // 2],
        "text.mcap": b"time,t01_x\n",
    }.items():
        (folder / name).write_bytes(data)
    (folder / "good.labels.json").write_text("[" * 100_000)
    return folder


def test_info_shows_the_good_and_marks_the_bad(folder, capsys):
    (folder / "good.labels.json").unlink()
    assert main(["info", str(folder), "--json"]) == 2
    printed, err = capsys.readouterr()
    found = {each["name"]: each for each in json.loads(printed)["recordings"]}
    assert set(found) == {"cut", "empty", "flipped", "good", "half", "text"}
    assert {name for name, each in found.items() if "error" in each} == set(found) - {"good"}
    assert all(name in found[name]["error"] for name in found if name != "good")
    assert err.count("holdfast: ") == 5
    assert main(["info", str(folder)]) == 2
    assert capsys.readouterr().out.count(" unreadable\n") == 5
