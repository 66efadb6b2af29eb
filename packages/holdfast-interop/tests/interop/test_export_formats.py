"""The formats of `holdfast export` that this package has."""

import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.io import load_recording, save_recording
from holdfast.synthetic import synthetic_recording


@pytest.fixture(scope="module")
def grasps(tmp_path_factory):
    folder = tmp_path_factory.mktemp("grasps")
    for k in range(2):
        recording = synthetic_recording(f"grasp{k}", k, ("thumb", "index"))
        save_recording(recording, folder / f"grasp{k}.parquet")
    return folder


VERB = Verb("export")
refusal, exported = VERB.refusal, VERB.document


def test_a_data_set_goes_and_comes_back(capsys, grasps, tmp_path):
    out = tmp_path / "set"
    document = exported(capsys, grasps, out, "--format", "lerobot", "--fps", "15")
    assert (document["episodes"], document["frames"], document["tasks"]) == (2, 348, 2)
    assert main(["import", str(out), str(tmp_path / "back")]) == 0
    for k in range(2):
        back = load_recording(tmp_path / "back" / f"grasp{k}.parquet")
        first = load_recording(grasps / f"grasp{k}.parquet")
        assert back.digest == first.digest
        assert back.metadata == first.metadata
        assert back.modules["thumb"].labels == first.modules["thumb"].labels


def test_options_must_fit(capsys, grasps, tmp_path):
    out = tmp_path / "out"
    for words, named in (
        (("--format", "csv", "--fps", "3"), "--fps"),
        (("--format", "csv", "--model", "x"), "--model"),
        (("--format", "lerobot", "--fps", "0"), "--fps"),
        (("--format", "rerun"), "a.mcap"),
    ):
        target = tmp_path / "a.mcap" if "rerun" in words else out
        assert named in refusal(capsys, grasps, target, *words)
    assert list(tmp_path.iterdir()) == []
