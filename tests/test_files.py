import errno
import os
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.errors import OutputError
from holdfast.files import (
    check_regular,
    file_stem,
    lock,
    read_input,
    sync,
    whole_file,
    write_whole,
)
from traps import traps


def test_the_part_has_the_suffix_and_folder_of_the_output(tmp_path):
    with whole_file(tmp_path / "a.parquet") as part:
        assert part.suffix == ".parquet"
        assert part.parent == tmp_path
        assert not (tmp_path / "a.parquet").exists()


def test_the_file_has_the_mode_of_any_new_file(tmp_path):
    write_whole(tmp_path / "a", b"")
    (tmp_path / "b").touch()
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_a_device_or_a_pipe_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OutputError, match="pipe; a file"):
        write_whole(tmp_path / "pipe", b"", force=True)
    assert (tmp_path / "pipe").is_fifo()


def test_missing_folder(tmp_path):
    target = tmp_path / "no" / "a.json"
    with pytest.raises(OutputError, match="no does not exist"):
        write_whole(target, b"")


def test_a_full_disk_leaves_nothing(tmp_path, monkeypatch):
    def full(self, data):
        with self.open("wb") as file:
            file.write(data[:2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match="No space left"):
        write_whole(tmp_path / "a.json", b"{}{}{}")
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
    def read_only(self, mode=0o666, exist_ok=True):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(Path, "touch", read_only)
    with pytest.raises(OutputError, match="Read-only"):
        write_whole(tmp_path / "a", b"")


def test_an_input_that_fails_meanwhile_is_not_blamed_on_the_output(tmp_path):
    with pytest.raises(FileNotFoundError, match="input"), whole_file(tmp_path / "a.json"):
        (tmp_path / "input").read_bytes()
    assert not list(tmp_path.iterdir())


def test_a_folder_is_not_replaced(tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(OutputError, match="Is a directory"):
        write_whole(tmp_path / "a", b"", force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


ODD_NAMES = ["", ".", "..", "../../up", "/abs", "a/b", "a\\b", ".hidden", "x\x00y", "a\n"]
ODD_NAMES += ["-rf", "con", "NUL.x", "a" * 400, "é" * 200, "end.", "end ", "a\ud800", "a\u202eb"]
ODD_NAMES += ["\x1b[31m"]


@pytest.mark.parametrize("name", ["grasp", "can-case1-1", "Möhre 3 (rot)", "a.b", "x..y", "50 %"])
def test_a_valid_name_is_kept(name):
    assert file_stem(name) == name


@given(st.text() | st.sampled_from(ODD_NAMES))
def test_a_stem_is_one_part_of_a_path_that_every_system_accepts(name):
    stem = file_stem(name)
    assert Path(stem).name == stem
    assert stem == stem.strip(" .")
    assert stem.isprintable()
    assert not set(stem) & set('<>:"/\\|?*')
    assert 0 < len(stem.encode()) < 200
    assert file_stem(stem) == stem


def test_different_names_have_different_stems():
    assert len({file_stem(name) for name in ODD_NAMES}) == len(ODD_NAMES)


def test_a_stem_is_a_file_in_its_folder(tmp_path):
    for name in ODD_NAMES:
        write_whole(tmp_path / f"{file_stem(name)}.json", b"{}")
    assert len(list(tmp_path.iterdir())) == len(ODD_NAMES)


def test_the_mask_of_the_process_is_not_touched(tmp_path, monkeypatch):
    def touched(mask):
        raise AssertionError("another thread would create files of any mode meanwhile")

    monkeypatch.setattr(os, "umask", touched)
    write_whole(tmp_path / "a", b"")


@pytest.mark.parametrize("read", [check_regular, lambda path: read_input(path, 10)])
def test_an_input_that_may_never_end_is_refused_at_once(tmp_path, read):
    os.mkfifo(tmp_path / "pipe")
    expected = "it is a pipe or a device; a regular file expected"
    for path in (tmp_path / "pipe", Path("/dev/zero"), Path("/dev/null")):
        with pytest.raises(OSError, match=expected):
            read(path)
    with pytest.raises(OSError, match="a folder"):
        read(tmp_path)
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "none")


@traps
def test_no_link_is_followed_to_a_file_that_only_its_place_names(tmp_path, word, trap):
    trap(tmp_path / "a")
    with pytest.raises(OSError, match=rf"it is a {word}.* expected"):
        read_input(tmp_path / "a", 10, follow=False)


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero")])
@pytest.mark.parametrize("follow", [False, True])
def test_what_takes_the_place_of_a_checked_input_is_refused(tmp_path, monkeypatch, make, follow):
    make(tmp_path / "a")
    monkeypatch.setattr("holdfast.files.check_regular", lambda path, **_: None)
    with pytest.raises(OSError, match=r"regular file|symbolic links"):
        read_input(tmp_path / "a", 10, follow=follow)


def test_a_large_input_is_refused(tmp_path):
    (tmp_path / "a").write_bytes(b"12345678901")
    with pytest.raises(OSError, match="10 bytes"):
        read_input(tmp_path / "a", 10)
    assert read_input(tmp_path / "a", 11) == b"12345678901"


@contextmanager
def opened(path):
    handle = os.open(path, os.O_RDONLY)
    try:
        yield handle
    finally:
        os.close(handle)


def test_a_lock_is_of_one_alone_and_ends_with_its_file(tmp_path):
    with opened(tmp_path) as first, opened(tmp_path) as second:
        lock(first)
        with pytest.raises(BlockingIOError):
            lock(second)
    with opened(tmp_path) as third:
        lock(third, wait=True)


def test_sync_waits_for_files_and_folders_in_order(tmp_path, monkeypatch):
    path = tmp_path / "a"
    path.write_bytes(b"1")
    synced, fsync = [], os.fsync

    def record(handle):
        synced.append(os.fstat(handle).st_ino)
        fsync(handle)

    monkeypatch.setattr(os, "fsync", record)
    with opened(path) as handle:
        sync(handle, tmp_path, path)
    assert synced == [file.stat().st_ino for file in (path, tmp_path, path)]
    with pytest.raises(FileNotFoundError):
        sync(tmp_path / "none")
