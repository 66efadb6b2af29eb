import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.errors import OutputError, RecordingError
from holdfast.io import load_recording, read_chunks, save_labels, save_recording
from holdfast.io.mcap_writer import RecordingWriter
from holdfast.recordings import Label


@pytest.mark.parametrize("read", [load_recording, read_chunks])
def test_paths_that_cannot_be_read(read, tmp_path):
    (tmp_path / "a.csv").write_text("")
    (tmp_path / "b.mcap").mkdir()
    messages = {
        "a.csv": f"cannot read {tmp_path / 'a.csv'}: .csv given, .parquet or .mcap expected "
        "(`holdfast import` converts other formats)",
        "b.mcap": f"{tmp_path / 'b.mcap'} is a folder; a recording's file expected",
        "c.parquet": f"{tmp_path / 'c.parquet'} does not exist; a recording's file expected",
    }
    for name, text in messages.items():
        with pytest.raises(RecordingError) as caught:
            read(tmp_path / name)
        assert str(caught.value) == text


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
def test_an_error_of_the_disk_while_loading(make_recording, tmp_path, monkeypatch, suffix):
    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    path = tmp_path / f"a.{suffix}"
    save_recording(make_recording(150), path)
    monkeypatch.setattr(f"holdfast.io.{suffix}.load", refuse)
    with pytest.raises(RecordingError, match=r"cannot read .*: Permission denied"):
        load_recording(path)


def test_saving_with_an_unknown_suffix(make_recording, tmp_path):
    with pytest.raises(OutputError, match=r"cannot write .*a\.h5: \.h5 given, \.parquet or \.mcap"):
        save_recording(make_recording(), tmp_path / "a.h5")


def test_import_is_light():
    code = "import sys, holdfast.io; print({'pyarrow', 'mcap', 'h5py', 'scipy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
@pytest.mark.parametrize("n_samples", [1, 7, 100, 10_000])
def test_chunks_together_are_the_recording(make_recording, tmp_path, suffix, n_samples):
    recording = make_recording(150 if n_samples == 1 else 900)
    path = tmp_path / f"a{suffix}"
    save_recording(recording, path)
    chunks = list(read_chunks(path, n_samples))
    for name, module in recording.modules.items():
        parts = [chunk.modules[name] for chunk in chunks]
        assert max(part.n_samples for part in parts) <= n_samples
        for field in ("times", "readings", "label_states"):
            got = np.concatenate([getattr(part, field) for part in parts])
            np.testing.assert_array_equal(got, getattr(module, field))
    truth = [chunk.truth.hand["object_pose"] for chunk in chunks]
    np.testing.assert_array_equal(np.concatenate(truth), recording.truth.hand["object_pose"])
    assert [m for chunk in chunks for m in chunk.markers] == list(recording.markers)
    assert {chunk.name for chunk in chunks} == {recording.name}


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_labels_of_the_label_file_are_cut_to_the_chunks(make_recording, tmp_path, suffix):
    recording = make_recording()
    path = tmp_path / f"a{suffix}"
    save_recording(recording, path)
    relabelled = recording.with_labels({"thumb": (Label(1.0, 3.0, ContactState.STABLE),)})
    save_labels(relabelled, path)
    states = [chunk.modules["thumb"].label_states for chunk in read_chunks(path, 100)]
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
    states = [chunk.modules["thumb"].label_states for chunk in read_chunks(tmp_path / "a.mcap", 99)]
    np.testing.assert_array_equal(np.concatenate(states), thumb.label_states)


def test_chunks_of_a_cut_file_are_incomplete(make_recording, tmp_path):
    path = tmp_path / "a.mcap"
    save_recording(make_recording(), path)
    path.write_bytes(path.read_bytes()[:-3000])
    chunks = list(read_chunks(path, 100))
    assert not any(chunk.complete for chunk in chunks)
    n_samples = load_recording(path).modules["thumb"].n_samples
    assert sum(chunk.modules["thumb"].n_samples for chunk in chunks) == n_samples


def test_a_module_that_stops_has_no_samples_in_later_chunks(make_recording, tmp_path):
    recording = make_recording()
    short = recording.modules["index/1"].slice(0, 10)
    modules = {"thumb": recording.modules["thumb"], "index/1": short}
    save_recording(replace(recording, modules=modules), tmp_path / "a.parquet")
    chunks = list(read_chunks(tmp_path / "a.parquet", 100))
    assert [chunk.modules["index/1"].n_samples for chunk in chunks][:3] == [10, 0, 0]


def test_no_samples_in_a_chunk_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="at least 1 sample in a chunk expected, 0 given"):
        read_chunks(tmp_path / "a.parquet", 0)


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
@pytest.mark.parametrize("n_samples", [7, 100, 10_000])
def test_chunks_do_not_overlap_in_time(make_recording, tmp_path, suffix, n_samples):
    save_recording(make_recording(), tmp_path / f"a{suffix}")
    chunks = list(read_chunks(tmp_path / f"a{suffix}", n_samples))
    assert all(one.end < two.start for one, two in pairwise(chunks))
