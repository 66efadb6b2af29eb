"""Values that a worker keeps: the same ones again, up to a number of bytes."""

import math
from pathlib import Path

import pytest
from joblib.externals.loky import process_executor

from holdfast_lab.study.evaluation.recording_features import prepared_recordings
from holdfast_lab.study.kept import KeptValues
from holdfast_lab.study.plan import scan_corpus

from .example_recordings import save_synthetic


def one_byte(_):
    return 1


def test_a_value_is_made_once():
    kept, made = KeptValues(10), []
    for _ in range(3):
        assert kept.get("a", lambda: made.append("a") or [5], one_byte) == [5]
    assert made == ["a"]


def test_what_does_not_fit_is_made_again_and_what_fits_stays():
    kept, made = KeptValues(2), []
    for key in "abcabc":
        kept.get(key, lambda key=key: made.append(key), one_byte)
    assert made == ["a", "b", "c", "c"]


def test_a_worker_may_grow_by_what_it_keeps():
    """The limit of loky by the name that `worker_memory` sets."""
    limit = (Path(process_executor.__file__)).read_text("utf-8").count("< _MAX_MEMORY_LEAK_SIZE")
    assert limit
    assert math.isinf(process_executor._MAX_MEMORY_LEAK_SIZE)


@pytest.fixture
def corpus(tmp_path):
    save_synthetic(tmp_path, [1, 2])
    return scan_corpus("main", tmp_path)


def test_a_recording_is_prepared_once(corpus):
    first, again = (list(prepared_recordings(corpus)) for _ in range(2))
    assert len(first) == 2
    assert all(a is b for a, b in zip(first, again, strict=True))
    assert first[0].hand.recording is corpus.load()[0]


def test_a_changed_corpus_is_read_again(corpus, tmp_path):
    before = next(prepared_recordings(corpus))
    for path in tmp_path.glob("*.parquet"):
        path.unlink()
    save_synthetic(tmp_path, [3, 4])
    after = next(prepared_recordings(scan_corpus("main", tmp_path)))
    assert before.hand.recording.digest != after.hand.recording.digest
