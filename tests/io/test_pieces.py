from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.errors import RecordingError
from holdfast.io import load_recording, read_chunks, save_labels, save_recording
from holdfast.io.mcap_writer import RecordingWriter
from holdfast.recordings import Label


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
@pytest.mark.parametrize("n_samples", [1, 7, 100, 10_000])
def test_pieces_put_together_are_the_whole(make_recording, tmp_path, suffix, n_samples):
    recording = make_recording(150 if n_samples == 1 else 900)
    path = tmp_path / f"a{suffix}"
    save_recording(recording, path)
    pieces = list(read_chunks(path, n_samples))
    for name, module in recording.modules.items():
        parts = [piece.modules[name] for piece in pieces]
        assert max(part.n_samples for part in parts) <= n_samples
        for field in ("times", "readings", "label_states"):
            got = np.concatenate([getattr(part, field) for part in parts])
            np.testing.assert_array_equal(got, getattr(module, field))
    truth = [piece.truth.hand["object_pose"] for piece in pieces]
    np.testing.assert_array_equal(np.concatenate(truth), recording.truth.hand["object_pose"])
    assert [m for piece in pieces for m in piece.markers] == list(recording.markers)
    assert {piece.name for piece in pieces} == {recording.name}


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_labels_beside_the_file_are_cut_to_the_pieces(make_recording, tmp_path, suffix):
    recording = make_recording()
    path = tmp_path / f"a{suffix}"
    save_recording(recording, path)
    relabelled = recording.with_labels({"thumb": (Label(1.0, 3.0, ContactState.STABLE),)})
    save_labels(relabelled, path)
    states = [piece.modules["thumb"].label_states for piece in read_chunks(path, 100)]
    want = relabelled.modules["thumb"].label_states
    np.testing.assert_array_equal(np.concatenate(states), want)


def test_labels_of_another_recording_are_refused(make_recording, tmp_path):
    save_recording(make_recording(), tmp_path / "a.parquet")
    save_labels(make_recording(seed=1), tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match="labels another recording"):
        list(read_chunks(tmp_path / "a.parquet"))


def test_a_live_recording_without_a_digest_takes_its_labels(make_recording, tmp_path):
    thumb = make_recording().modules["thumb"]
    with RecordingWriter(tmp_path / "a.mcap", {"thumb": thumb.sensor}) as writer:
        writer.append("thumb", thumb.times, thumb.readings)
    recording = load_recording(tmp_path / "a.mcap")
    save_labels(recording.with_labels({"thumb": thumb.labels}), tmp_path / "a.mcap")
    states = [piece.modules["thumb"].label_states for piece in read_chunks(tmp_path / "a.mcap", 99)]
    np.testing.assert_array_equal(np.concatenate(states), thumb.label_states)


def test_a_cut_file_gives_pieces_that_say_so(make_recording, tmp_path):
    path = tmp_path / "a.mcap"
    save_recording(make_recording(), path)
    path.write_bytes(path.read_bytes()[:-3000])
    pieces = list(read_chunks(path, 100))
    assert not any(piece.complete for piece in pieces)
    n_samples = load_recording(path).modules["thumb"].n_samples
    assert sum(piece.modules["thumb"].n_samples for piece in pieces) == n_samples


def test_a_module_that_stops_has_no_samples_in_later_pieces(make_recording, tmp_path):
    recording = make_recording()
    short = recording.modules["index/1"].slice(0, 10)
    modules = {"thumb": recording.modules["thumb"], "index/1": short}
    save_recording(replace(recording, modules=modules), tmp_path / "a.parquet")
    pieces = list(read_chunks(tmp_path / "a.parquet", 100))
    assert [piece.modules["index/1"].n_samples for piece in pieces][:3] == [10, 0, 0]


def test_no_samples_a_piece_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="at least 1 sample a piece expected, 0 given"):
        read_chunks(tmp_path / "a.parquet", 0)


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
@pytest.mark.parametrize("n_samples", [7, 100, 10_000])
def test_pieces_do_not_overlap_in_time(make_recording, tmp_path, suffix, n_samples):
    save_recording(make_recording(), tmp_path / f"a{suffix}")
    pieces = list(read_chunks(tmp_path / f"a{suffix}", n_samples))
    assert all(one.end < two.start for one, two in pairwise(pieces))
