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
    assert document == {
        "out": str(out),
        "format": "lerobot",
        "fps": 15,
        "episodes": 2,
        "frames": 348,
        "tasks": 2,
    }
    assert main(["import", str(out), str(tmp_path / "back")]) == 0
    for k in range(2):
        back = load_recording(tmp_path / "back" / f"grasp{k}.parquet")
        first = load_recording(grasps / f"grasp{k}.parquet")
        assert back.digest == first.digest
        assert back.metadata == first.metadata
        assert back.modules["thumb"].labels == first.modules["thumb"].labels


def test_options_must_fit(capsys, grasps, tmp_path):
    out = tmp_path / "out"
    cases = {
        ("--format", "csv", "--fps", "3"): "--fps belongs to --format lerobot; csv given",
        ("--format", "csv", "--model", "x"): "--model belongs to --format rerun; csv given",
        ("--format", "lerobot", "--fps", "0"): "--fps: a whole number from 1 to 1000 expected, 0 "
        "given",
    }
    for words, message in cases.items():
        assert refusal(capsys, grasps, out, *words) == message
    message = refusal(capsys, grasps, tmp_path / "a.mcap", "--format", "rerun")
    assert message == f"{tmp_path / 'a.mcap'}: a folder expected for the format rerun, a file given"
    assert list(tmp_path.iterdir()) == []
