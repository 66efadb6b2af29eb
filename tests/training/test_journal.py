import os
from pathlib import Path

import numpy as np
import pytest

from holdfast.errors import OutputError
from holdfast.parallel import Engine
from holdfast.training.tuning import Journal, search_key

ONE = {"C": 0.1 + 0.2, "class_weight": "balanced"}
TWO = {"C": 1e-4, "class_weight": None}


def test_a_loss_is_found_again_to_the_last_bit(tmp_path):
    path = tmp_path / "search"
    journal = Journal(path, "a")
    assert not path.exists()
    assert journal.find(ONE) is None
    journal.add(ONE, 1 / 3)
    journal.add(TWO, 2 / 3)
    again = Journal(path, "a")
    assert again.find(dict(reversed(ONE.items()))) == 1 / 3
    assert again.find(TWO) == 2 / 3
    assert again.find(ONE | {"C": 0.3}) is None


def test_another_search_finds_nothing(tmp_path):
    Journal(tmp_path / "search", "a").add(ONE, 0.5)
    assert Journal(tmp_path / "search", "b").find(ONE) is None


@pytest.mark.parametrize("cut", range(1, 70, 4))
def test_an_incomplete_line_loses_one_trial(tmp_path, cut):
    path = tmp_path / "search"
    journal = Journal(path, "a")
    journal.add(ONE, 0.25)
    whole = path.stat().st_size
    journal.add(TWO, 0.5)
    os.truncate(path, max(path.stat().st_size - 1 - cut, whole))
    stopped = Journal(path, "a")
    assert (stopped.find(ONE), stopped.find(TWO)) == (0.25, None)
    stopped.add(TWO, 0.5)
    again = Journal(path, "a")
    assert (again.find(ONE), again.find(TWO)) == (0.25, 0.5)


def test_lines_that_are_not_trials_are_ignored(tmp_path):
    path = tmp_path / "search"
    path.write_bytes(b'\x00\xff junk\n{"search": 3}\n[1]\n')
    assert Journal(path, "a").find(ONE) is None


def fill(path, name):
    journal = Journal(path, name)
    for k in range(50):
        journal.add({"C": float(k), "class_weight": "balanced"}, k / 7)


@pytest.mark.slow  # it starts processes
def test_parallel_searches_share_a_file(tmp_path):
    path = tmp_path / "search"
    list(Engine(2).map_ordered(fill, [(path, name) for name in "abcd"]))
    for name in "abcd":
        journal = Journal(path, name)
        found = [journal.find({"C": float(k), "class_weight": "balanced"}) for k in range(50)]
        assert found == [k / 7 for k in range(50)]


def test_the_key_depends_on_the_content():
    array = np.arange(6.0)
    key = search_key(array, "logreg", 0)
    assert key == search_key(array.copy(), "logreg", 0)
    others = [
        search_key(array[::-1], "logreg", 0),
        search_key(array.reshape(2, 3), "logreg", 0),
        search_key(array, "svm", 0),
        search_key(array, "logreg", 1),
    ]
    assert len({key, *others}) == 5


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk():
    with pytest.raises(OutputError, match="/dev/full"):
        Journal.add(_journal_on_full_disk(), ONE, 0.5)


def _journal_on_full_disk():
    journal = Journal(Path("/nowhere/at/all"), "a")
    journal._path = Path("/dev/full")
    return journal


def test_a_folder_in_its_place(tmp_path):
    with pytest.raises(OutputError, match="Is a directory"):
        Journal(tmp_path, "a")
