import subprocess
import sys

import pytest

from holdfast.errors import OutputError, RecordingError
from holdfast.io import load_recording, read_chunks, save_recording


@pytest.mark.parametrize("read", [load_recording, read_chunks])
def test_what_cannot_be_read_is_told(read, tmp_path):
    (tmp_path / "a.csv").write_text("")
    (tmp_path / "b.mcap").mkdir()
    messages = {
        "a.csv": f"cannot read {tmp_path / 'a.csv'}: .csv given, .parquet or .mcap expected "
        "(`holdfast import` brings other formats in)",
        "b.mcap": f"{tmp_path / 'b.mcap'} is a folder; a recording's file expected",
        "c.parquet": f"{tmp_path / 'c.parquet'} does not exist; a recording's file expected",
    }
    for name, text in messages.items():
        with pytest.raises(RecordingError) as caught:
            read(tmp_path / name)
        assert str(caught.value) == text


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
def test_what_the_disk_refuses_is_told(make_recording, tmp_path, monkeypatch, suffix):
    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    path = tmp_path / f"a.{suffix}"
    save_recording(make_recording(150), path)
    monkeypatch.setattr(f"holdfast.io.{suffix}.load", refuse)
    with pytest.raises(RecordingError, match=r"cannot read .*: Permission denied"):
        load_recording(path)


def test_an_unknown_suffix_is_not_written(make_recording, tmp_path):
    with pytest.raises(OutputError, match=r"cannot write .*a\.h5: \.h5 given, \.parquet or \.mcap"):
        save_recording(make_recording(), tmp_path / "a.h5")


def test_import_is_light():
    code = "import sys, holdfast.io; print({'pyarrow', 'mcap', 'h5py', 'scipy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
