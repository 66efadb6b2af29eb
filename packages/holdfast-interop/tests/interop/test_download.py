import gc
from hashlib import sha256
from pathlib import Path

import pytest

pytest.importorskip("pooch", reason="pooch is not installed")

from holdfast.errors import OutputError, SourceError
from holdfast_interop.datasets import PublicFile, PublicSet
from holdfast_interop.datasets.download import N_RETRIES, download_files
from loopback import serving

# pooch leaves the connection of a failed try to the garbage collector.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

CONTENT = bytes(range(256)) * 1000


@pytest.fixture
def server(tmp_path, monkeypatch):
    (tmp_path / "remote" / "deep").mkdir(parents=True)
    (tmp_path / "remote" / "deep" / "a.bin").write_bytes(CONTENT)
    (tmp_path / "remote" / "b.bin").write_bytes(b"b" * 10)
    monkeypatch.setenv("HOLDFAST_DATASETS", str(tmp_path / "got"))
    monkeypatch.setattr("pooch.core.time.sleep", lambda _: None)  # between two tries
    with serving(tmp_path / "remote") as server:
        yield server
    gc.collect()


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "got" / "made-up"


def get(server):
    """Download a file with a checksum, and one that is stored under another path."""
    known = PublicFile("here/a.bin", "deep/a.bin", sha256(CONTENT).hexdigest())
    files = (known, PublicFile("b.bin"))
    public = PublicSet(
        "made-up", "t", (), 1, 100.0, "none", "MIT", "https://made-up.example",
        256_010, "csv", f"{server.url}/", files,
    )  # fmt: skip
    download_files(public, files, None, lambda files, what, total: files)


def content(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_files_are_stored_under_their_paths_and_not_loaded_again(server, folder, capsys):
    for _ in range(2):
        get(server)
        assert content(folder) == {"here/a.bin": CONTENT, "b.bin": b"b" * 10}
        assert server.requests == ["deep/a.bin", "b.bin"]
    assert capsys.readouterr() == ("", "")


def test_a_damaged_file_is_loaded_again(server, folder):
    get(server)
    (folder / "here" / "a.bin").write_bytes(CONTENT[:-1] + b"x")
    get(server)
    assert content(folder)["here/a.bin"] == CONTENT


def test_a_file_begins_again_after_a_lost_connection(server, folder):
    server.cut_after = [100_000, 70_000]
    get(server)
    assert content(folder)["here/a.bin"] == CONTENT
    assert server.requests == ["deep/a.bin"] * 3 + ["b.bin"]


def test_a_part_of_a_file_is_never_kept_and_the_next_download_has_the_rest(server, folder):
    server.cut_after = [len(CONTENT), *[5] * (1 + N_RETRIES)]
    with pytest.raises(SourceError, match=r"b\.bin"):
        get(server)
    assert content(folder) == {"here/a.bin": CONTENT}
    server.requests.clear()
    get(server)
    assert server.requests == ["b.bin"]


def test_a_wrong_checksum_is_thrown_away(server, folder):
    server.replaced["deep/a.bin"] = CONTENT[:-1] + b"x"
    with pytest.raises(SourceError, match=rf"deep/a\.bin .*{sha256(CONTENT).hexdigest()}"):
        get(server)
    assert content(folder) == {}


@pytest.mark.parametrize("status", [403, 404])
def test_a_server_that_refuses(server, folder, status):
    server.status = status
    with pytest.raises(SourceError, match=rf"{server.url}/deep/a\.bin .*{status}"):
        get(server)
    assert content(folder) == {}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_a_full_disk_leaves_nothing(server, folder, monkeypatch):
    full = lambda path, mode: open("/dev/full", "wb")  # noqa: E731, PTH123, SIM115
    monkeypatch.setattr("pooch.downloaders.open", full, raising=False)
    with pytest.raises(OutputError, match="No space left on device"):
        get(server)
    assert content(folder) == {}


def test_a_folder_that_cannot_be_written(server, tmp_path):
    (tmp_path / "got").write_text("a file")
    with pytest.raises(OutputError, match="made-up"):
        get(server)
