import logging
import shutil
from collections import namedtuple
from hashlib import sha256
from pathlib import Path

import msgspec
import pytest

pytest.importorskip("pooch", reason="pooch is not installed")

from holdfast.errors import OutputError, SourceError
from holdfast_interop.datasets import PublicFile, PublicSet
from holdfast_interop.datasets.download import (
    DOWNLOAD_CHUNK,
    check_space,
    download,
    download_folder,
)
from loopback import serving

CONTENT = bytes(range(256)) * 1000
POINTER = (
    b"version https://git-lfs.github.com/spec/v1\noid sha256:a2aef56bf4cfc5e2d17ae09772295cb207c7"
    b"33e3a73059913939ba5a7a1e2139\nsize 41105856\n"
)


@pytest.fixture
def server(tmp_path):
    (tmp_path / "remote" / "deep").mkdir(parents=True)
    (tmp_path / "remote" / "deep" / "a.bin").write_bytes(CONTENT)
    (tmp_path / "remote" / "b.bin").write_bytes(b"b" * 10)
    with serving(tmp_path / "remote") as server:
        yield server


def public_set(server, **changes):
    """A set with a file whose checksum is known, and one that is stored under another path."""
    known = {"size": len(CONTENT), "sha256": sha256(CONTENT).hexdigest(), **changes}
    files = (PublicFile("here/a.bin", "deep/a.bin", **known), PublicFile("b.bin"))
    return PublicSet(
        "made-up", "t", (), "none", "MIT", False, importer="csv", size=256_010,
        address=f"{server.url}/", files=files,
    )  # fmt: skip


def get(public, folder, **more):
    return download(public, public.files, folder, **more)


def content(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_files_are_stored_under_their_paths_and_not_loaded_again(server, tmp_path, capsys):
    public, sizes = public_set(server), []
    paths = get(public, tmp_path / "got", report=sizes.append)
    assert paths == [tmp_path / "got" / "here" / "a.bin", tmp_path / "got" / "b.bin"]
    assert content(tmp_path / "got") == {"here/a.bin": CONTENT, "b.bin": b"b" * 10}
    assert sum(sizes) == len(CONTENT) + 10
    assert server.requests == [("deep/a.bin", 0), ("b.bin", 0)]
    assert get(public, tmp_path / "got") == paths
    assert len(server.requests) == 2
    assert capsys.readouterr() == ("", "")


def test_a_damaged_file_is_loaded_again(server, tmp_path):
    public = public_set(server)
    path, _ = get(public, tmp_path / "got")
    path.write_bytes(CONTENT[:-1] + b"x")
    get(public, tmp_path / "got")
    assert path.read_bytes() == CONTENT


def test_a_copy_has_the_paths_of_the_folder(server, tmp_path):
    shutil.copytree(tmp_path / "remote" / "deep", tmp_path / "remote" / "copy" / "here")
    shutil.copy(tmp_path / "remote" / "b.bin", tmp_path / "remote" / "copy")
    get(public_set(server), tmp_path / "got", address=f"{server.url}/copy/")
    assert server.requests == [("copy/here/a.bin", 0), ("copy/b.bin", 0)]


def test_a_lost_connection_is_continued(server, tmp_path):
    server.cut_after = [100_000, 70_000]
    get(public_set(server), tmp_path / "got")
    assert content(tmp_path / "got")["here/a.bin"] == CONTENT
    starts = [start for path, start in server.requests if path == "deep/a.bin"]
    assert starts == [0, DOWNLOAD_CHUNK, 2 * DOWNLOAD_CHUNK]  # what is not a whole chunk is lost


def test_the_next_download_continues(server, tmp_path):
    server.cut_after = [100_000, 1, 1]
    with pytest.raises(SourceError, match=r"a.bin cannot be reached \(\w+\); what was loaded is k"):
        get(public_set(server), tmp_path / "got")
    assert content(tmp_path / "got") == {"here/.a.bin.part": CONTENT[:DOWNLOAD_CHUNK]}
    get(public_set(server), tmp_path / "got")
    assert server.requests[3] == ("deep/a.bin", DOWNLOAD_CHUNK)
    assert content(tmp_path / "got")["here/a.bin"] == CONTENT


def test_a_server_without_ranges_sends_the_file_again(server, tmp_path):
    server.ranges, server.cut_after = False, [100_000]
    get(public_set(server), tmp_path / "got")
    assert content(tmp_path / "got")["here/a.bin"] == CONTENT


def test_an_incomplete_file_that_is_too_long_is_dropped(server, tmp_path):
    part = tmp_path / "got" / ".b.bin.part"
    part.parent.mkdir()
    part.write_bytes(b"x" * 20)
    get(public_set(server), tmp_path / "got")
    assert content(tmp_path / "got")["b.bin"] == b"b" * 10


def test_a_wrong_checksum_is_thrown_away(server, tmp_path):
    server.replaced["deep/a.bin"] = CONTENT[:-1] + b"x"
    expected = sha256(CONTENT).hexdigest()
    with pytest.raises(SourceError) as raised:
        get(public_set(server), tmp_path / "got")
    assert str(raised.value) == (
        f"made-up: {server.url}/deep/a.bin has another sha256 than {expected}, which is expected; "
        "the file was thrown away"
    )
    assert content(tmp_path / "got") == {}


def test_a_file_that_is_too_long_is_thrown_away(server, tmp_path):
    server.replaced["deep/a.bin"] = CONTENT + b"x"
    with pytest.raises(SourceError, match="sends more than 256000 bytes; it was thrown away"):
        get(public_set(server), tmp_path / "got")
    assert content(tmp_path / "got") == {}


@pytest.mark.parametrize("sha", [None, sha256(CONTENT).hexdigest()])
def test_a_pointer_of_git_lfs_is_named(server, tmp_path, sha):
    server.replaced["deep/a.bin"] = POINTER
    with pytest.raises(SourceError) as raised:
        get(public_set(server, sha256=sha), tmp_path / "got")
    assert str(raised.value).startswith(
        f"{server.url}/deep/a.bin is a pointer of Git LFS (133 bytes), not the data"
    )
    assert content(tmp_path / "got") == {}


def test_a_set_that_is_gone_names_the_others(server, tmp_path):
    (tmp_path / "remote" / "deep" / "a.bin").unlink()
    with pytest.raises(SourceError) as raised:
        get(public_set(server), tmp_path / "got")
    assert str(raised.value) == (
        f"made-up: here/a.bin is gone (404 at {server.url}/deep/a.bin); there are also "
        "uskin-pick-move, eflesh-tugs, gtac-grasps, gtac-manipulation, arq-slip-2021, "
        "anyskin-slip"
    )


def test_a_server_that_refuses(server, tmp_path):
    server.status = 403
    with pytest.raises(SourceError, match=r"made-up: .*/deep/a.bin answers 403 Forbidden"):
        get(public_set(server), tmp_path / "got")
    assert content(tmp_path / "got") == {}


def test_nobody_listens(server, tmp_path):
    public = public_set(server)
    with pytest.raises(SourceError, match=r"a\.bin cannot be reached"):
        get(public, tmp_path / "got", address="http://127.0.0.1:9/")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_a_full_disk_leaves_nothing(server, tmp_path, monkeypatch):
    part = tmp_path / "got" / "here" / ".a.bin.part"
    part.parent.mkdir(parents=True)
    part.touch()
    full = lambda path, continues: open("/dev/full", "ab")  # noqa: E731, PTH123, SIM115
    monkeypatch.setattr("holdfast_interop.datasets.download.open_part", full)
    with pytest.raises(OutputError, match=r"cannot write .*a.bin: No space left on device$"):
        get(public_set(server), tmp_path / "got")
    assert list(part.parent.iterdir()) == []


def test_room_is_checked_before_anything_is_loaded(server, tmp_path, monkeypatch):
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(1000))
    with pytest.raises(OutputError, match=r"256 kB needed, 1 kB free; set HOLDFAST_DATASETS to a"):
        check_space(public_set(server).files, tmp_path / "got" / "new")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(10**9))
    check_space(public_set(server).files, tmp_path / "got" / "new")


def test_a_folder_that_cannot_be_written(server, tmp_path):
    (tmp_path / "got").write_text("a file")
    with pytest.raises(OutputError, match=r"cannot write .*a\.bin: "):
        get(public_set(server), tmp_path / "got")


def test_an_environment_variable_moves_the_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("HOLDFAST_DATASETS", str(tmp_path))
    assert download_folder("a") == tmp_path / "a"
    monkeypatch.delenv("HOLDFAST_DATASETS")
    assert download_folder("a").parent.name == "holdfast"


def test_the_log_of_pooch_is_as_before(server, tmp_path):
    import pooch

    before = pooch.get_logger().level
    get(public_set(server), tmp_path / "got")
    assert pooch.get_logger().level == before
    assert before < logging.ERROR


def unchecked(server, size=10):
    """A set with one file whose checksum is not known."""
    return msgspec.structs.replace(public_set(server), files=(PublicFile("b.bin", size=size),))


@pytest.mark.parametrize(
    ("size", "headers", "message"),
    [
        (11, {}, "sends 10 bytes, 11 expected; it was thrown away"),
        (11, {"Content-Length": None}, "sends 10 bytes, 11 expected; it was thrown away"),
        (None, {"Content-Length": None}, "sends 10 bytes, no length is known; it was thrown away"),
        (10, {"Content-Encoding": "gzip"}, "sends a body packed by 'gzip'; a plain one expected"),
    ],
)
def test_an_answer_that_is_not_the_plain_whole_file_is_not_kept(
    server, tmp_path, size, headers, message
):
    server.headers = headers
    with pytest.raises(SourceError) as raised:
        get(unchecked(server, size), tmp_path / "got")
    assert str(raised.value) == f"{server.url}/b.bin {message}"
    assert content(tmp_path / "got") == {}


def test_a_short_file_that_was_kept_is_loaded_again(server, tmp_path):
    (tmp_path / "got").mkdir()
    (tmp_path / "got" / "b.bin").write_bytes(b"short")
    get(unchecked(server), tmp_path / "got")
    assert content(tmp_path / "got") == {"b.bin": b"b" * 10}


def test_a_length_that_is_stated_is_enough(server, tmp_path):
    get(unchecked(server, size=None), tmp_path / "got")
    assert content(tmp_path / "got") == {"b.bin": b"b" * 10}


@pytest.mark.parametrize("link", ["symlink_to", "hardlink_to"])
def test_an_incomplete_file_that_is_a_link_is_not_followed(server, tmp_path, link):
    other, part = tmp_path / "other", tmp_path / "got" / ".b.bin.part"
    other.write_bytes(b"b" * 5)
    part.parent.mkdir()
    getattr(part, link)(other)
    get(unchecked(server), tmp_path / "got")
    assert other.read_bytes() == b"b" * 5
    assert content(tmp_path / "got") == {"b.bin": b"b" * 10}
    assert not (tmp_path / "got" / "b.bin").is_symlink()


@pytest.mark.parametrize("slow", ["headers", "body"])
def test_a_server_that_sends_a_byte_at_a_time_is_given_up(server, tmp_path, monkeypatch, slow):
    monkeypatch.setattr("holdfast_interop.datasets.download.ANSWER_LIMIT", 0.3, raising=False)
    server.slow = slow
    with pytest.raises(SourceError) as raised:
        get(public_set(server), tmp_path / "got")
    assert str(raised.value) == (
        f"made-up: {server.url}/deep/a.bin cannot be reached (Timeout); what was loaded is kept, "
        "and the same command continues"
    )


def test_a_server_that_is_slow_all_the_time_is_given_up(server, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "holdfast_interop.datasets.download.FREE_DOWNLOAD_TIME", -1e9, raising=False
    )
    monkeypatch.setattr("holdfast_interop.datasets.download.DOWNLOAD_CHUNK", 1)
    with pytest.raises(SourceError, match=r"a\.bin sends less than 20000 bytes a second; what was"):
        get(public_set(server), tmp_path / "got")
    assert (tmp_path / "got" / "here" / ".a.bin.part").stat().st_size == 1


def test_the_bodies_of_redirections_are_not_read(server, tmp_path):
    server.headers = {"Location": "/deep/a.bin", "Content-Encoding": "gzip"}
    with pytest.raises(SourceError, match=r"b\.bin cannot be reached \(TooManyRedirects\)"):
        get(unchecked(server), tmp_path / "got")
    assert len(server.requests) == 11
