import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.io import save_recording
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


def test_tables_say_what_they_leave_out(capsys, grasps, tmp_path):
    assert main(["export", str(grasps), str(tmp_path / "csv"), "--format", "csv"]) == 0
    out, err = capsys.readouterr()
    assert out == f"{tmp_path / 'csv'}: 2 tables\n"
    assert err == "a CSV table has no metadata\n"


def test_options_must_fit(capsys, grasps, tmp_path):
    out = tmp_path / "out"
    assert "csv" in refusal(capsys, grasps, out)
    message = refusal(capsys, tmp_path / "none", out, "--format", "csv")
    assert message == f"there is no folder {tmp_path / 'none'}; a folder of recordings expected"
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(capsys, grasps, tmp_path):
    words = (grasps, tmp_path / "csv", "--format", "csv")
    exported(capsys, *words)
    path = tmp_path / "csv" / "grasp0.csv"
    assert refusal(capsys, *words) == (
        f"{path} exists already: choose another name, or give --force"
    )
    exported(capsys, *words, "--force")


def test_options_of_models_and_of_recordings_are_told_apart(capsys, grasps, tmp_path):
    message = refusal(capsys, grasps, tmp_path / "out", "--format", "csv", "--fingers", "2")
    assert message == (
        "--like, --sensor, --fingers, --float and --in-contact are for models; "
        f"{grasps} is a recording or a folder"
    )
    message = refusal(capsys, "builtin:twin", tmp_path / "model.h", "--format", "csv")
    assert message == "--format, --fps and --model are for recordings; builtin:twin is a model"
