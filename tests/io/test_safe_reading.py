import os

import pytest

from holdfast.errors import RecordingError
from holdfast.io.safe_reading import MAX_WORK, STEP_WORK, ReadBudget, size_limit, stored_size


@pytest.fixture
def budget(tmp_path, monkeypatch):
    path = tmp_path / "a"
    path.write_bytes(b"x")
    monkeypatch.setenv("HOLDFAST_MAX_BYTES", "100000")
    return ReadBudget(path)


def test_what_is_kept_counts_until_the_end(budget):
    budget.keep(60_000)
    budget.unpack(40_000)
    budget.unpack(40_000)
    with pytest.raises(RecordingError, match=r"takes 0\.1001 MB in memory, 0\.1 MB are allowed"):
        budget.unpack(40_100)
    with pytest.raises(RecordingError, match=r"takes 0\.10024 MB in memory"):
        budget.keep(39_216, 2)


def test_all_that_is_unpacked_counts_as_work(budget):
    for _ in range(MAX_WORK):
        budget.unpack(100_000)
    with pytest.raises(RecordingError, match="takes too long to read: a file of 1e-06 MB has"):
        budget.unpack(1)


def test_every_record_counts_as_work(budget):
    budget.step(MAX_WORK * 100_000 // STEP_WORK)
    with pytest.raises(RecordingError, match="set HOLDFAST_MAX_BYTES to read it anyway"):
        budget.step()


def test_holes_are_no_part_of_a_file(tmp_path):
    path = tmp_path / "a"
    with path.open("wb") as file:
        for k in range(3):
            file.seek(k << 24)
            file.write(b"x" * 4096)
    os.truncate(path, 10**12)
    if path.stat().st_blocks * 512 == path.stat().st_size:
        pytest.skip("the file system has no sparse files")
    assert stored_size(path) < 1 << 20
    assert size_limit(path) == 200_000_000 + 10 * stored_size(path)
    with pytest.raises(RecordingError, match=r"is a sparse file: 1e\+06 MB long, of which 0\.0"):
        ReadBudget(path)
    os.truncate(path, 1 << 27)
    ReadBudget(path)


def test_a_folder_is_as_large_as_its_files(tmp_path):
    for name in "abc":
        (tmp_path / name).write_bytes(b"x" * 10**6)
    assert stored_size(tmp_path) == 3 * 10**6
