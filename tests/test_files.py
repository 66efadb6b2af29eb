import errno
from pathlib import Path

import pytest

from holdfast.errors import OutputError
from holdfast.files import refuse_overwrite, whole_file, write_whole


def test_writes_the_whole(tmp_path):
    write_whole(tmp_path / "model.json", b"{}")
    assert (tmp_path / "model.json").read_bytes() == b"{}"
    assert [path.name for path in tmp_path.iterdir()] == ["model.json"]


def test_the_part_has_the_suffix_and_folder_of_the_output(tmp_path):
    with whole_file(tmp_path / "a.parquet") as part:
        assert part.suffix == ".parquet"
        assert part.parent == tmp_path
        assert not (tmp_path / "a.parquet").exists()


def test_the_file_has_the_mode_of_any_new_file(tmp_path):
    write_whole(tmp_path / "a", b"")
    (tmp_path / "b").touch()
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_existing_output_is_kept(tmp_path):
    target = tmp_path / "a.json"
    target.write_text("old")
    with pytest.raises(OutputError) as refused:
        write_whole(target, b"new")
    assert str(refused.value) == f"{target} exists already: choose another name, or give --force"
    assert target.read_text() == "old"


def test_force_replaces(tmp_path):
    target = tmp_path / "a.json"
    target.write_text("old")
    write_whole(target, b"new", force=True)
    assert target.read_text() == "new"


def test_missing_folder(tmp_path):
    target = tmp_path / "no" / "a.json"
    with pytest.raises(OutputError) as refused:
        write_whole(target, b"")
    assert str(refused.value) == (
        f"cannot write {target}: the folder {tmp_path / 'no'} does not exist"
    )


def test_a_full_disk_leaves_nothing(tmp_path, monkeypatch):
    def full(self, data):
        with self.open("wb") as file:
            file.write(data[:2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError) as refused:
        write_whole(tmp_path / "a.json", b"{}{}{}")
    assert str(refused.value) == f"cannot write {tmp_path / 'a.json'}: No space left on device"
    assert not list(tmp_path.iterdir())


def test_a_full_disk_keeps_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "a.json"
    target.write_text("old")

    def full(self, data):
        raise OSError(errno.ENOSPC, "No space left on device", str(self))

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match="No space left"):
        write_whole(target, b"new", force=True)
    assert target.read_text() == "old"


def test_no_temporary_file_can_be_made(tmp_path, monkeypatch):
    def read_only(*args):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr("tempfile.mkstemp", read_only)
    with pytest.raises(OutputError, match=r"cannot write .*a: Read-only file system$"):
        write_whole(tmp_path / "a", b"")


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt])
def test_a_failure_leaves_no_file(tmp_path, failure):
    with pytest.raises(failure), whole_file(tmp_path / "a.json") as part:
        part.write_text("half")
        raise failure
    assert not list(tmp_path.iterdir())


def test_an_input_that_fails_meanwhile_is_not_blamed_on_the_output(tmp_path):
    with pytest.raises(FileNotFoundError, match="input"), whole_file(tmp_path / "a.json"):
        (tmp_path / "input").read_bytes()
    assert not list(tmp_path.iterdir())


def test_a_folder_is_not_replaced(tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(OutputError, match=r"cannot write .*: Is a directory"):
        write_whole(tmp_path / "a", b"", force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_refuse_overwrite_lets_a_new_name_pass(tmp_path):
    refuse_overwrite(tmp_path / "new")
    assert not (tmp_path / "new").exists()
