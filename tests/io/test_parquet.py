from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.errors import OutputError, RecordingError
from holdfast.io import load_recording, save_recording
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor


@pytest.fixture
def saved(make_recording, tmp_path):
    """The path of a short recording, and the bytes in its file."""
    path = tmp_path / "a.parquet"
    save_recording(make_recording(90), path)
    return path, path.read_bytes()


@pytest.mark.slow
@settings(max_examples=60)
@given(data=st.data())
def test_what_is_written_is_read(data, recordings, assert_same, tmp_path_factory):
    recording = data.draw(recordings)
    path = tmp_path_factory.mktemp("round") / "trip.parquet"
    save_recording(recording, path)
    assert_same(load_recording(path), recording)


def test_a_whole_recording(make_recording, assert_same, tmp_path):
    recording = make_recording()
    save_recording(recording, tmp_path / "a.parquet")
    loaded = load_recording(tmp_path / "a.parquet")
    assert_same(loaded, recording)
    assert loaded.complete


def test_a_file_renamed_renames_its_recording(make_recording, tmp_path):
    save_recording(make_recording(name="before"), tmp_path / "a.parquet")
    assert load_recording(tmp_path / "a.parquet").name == "before"
    (tmp_path / "a.parquet").rename(tmp_path / "after.parquet")
    assert load_recording(tmp_path / "after.parquet").name == "after"


def test_incomplete_stays_incomplete(make_recording, tmp_path):
    save_recording(make_recording(complete=False), tmp_path / "a.parquet")
    assert not load_recording(tmp_path / "a.parquet").complete


def test_other_byte_order_is_made_native(make_recording, tmp_path):
    recording = make_recording()
    thumb = recording.modules["thumb"]
    swapped = replace(thumb, readings=thumb.readings.astype(">u2"))
    save_recording(replace(recording, modules={"thumb": swapped}), tmp_path / "a.parquet")
    readings = load_recording(tmp_path / "a.parquet").modules["thumb"].readings
    assert readings.dtype == np.uint16
    np.testing.assert_array_equal(readings, thumb.readings)


def test_it_opens_as_a_wide_table(make_recording, tmp_path):
    recording = make_recording()
    save_recording(recording, tmp_path / "a.parquet")
    table = pq.read_table(tmp_path / "a.parquet")
    thumb, index = recording.modules["thumb"], recording.modules["index/1"]
    np.testing.assert_array_equal(table["thumb.t02.z"].to_numpy(), thumb.readings[:, 1, 2])
    held = table["index/1.t05.x"].drop_null()
    np.testing.assert_array_equal(held.to_numpy(), index.readings[:, 4, 0])
    assert table["thumb.t01.x"].type == pa.uint16()
    assert {"truth.time", "truth.hand.phase", "truth.hand.matrix.0.1"} <= set(table.column_names)
    assert "truth.thumb.slip_speed" in table.column_names


def rows_of_groups(path, n):
    times = np.arange(n) / 100
    module = Tactile(sensor("anyskin"), times, np.zeros((n, 5, 3), np.int16))
    save_recording(Recording("a", {"thumb": module}), path)
    file = pq.ParquetFile(path)
    column = file.metadata.row_group(0).column(1)
    assert column.compression == "ZSTD"
    assert "BYTE_STREAM_SPLIT" in column.encodings
    return [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)]


def test_row_groups_have_a_limited_number_of_rows(tmp_path):
    assert rows_of_groups(tmp_path / "a.parquet", 70_000) == [65_536, 4_464]


@pytest.mark.slow
def test_any_flipped_bit_is_found(saved, flipped):
    path, raw = saved
    for _, damaged in flipped(raw, 400):
        path.write_bytes(damaged)
        with pytest.raises(RecordingError, match="damaged"):
            load_recording(path)


def test_a_cut_file_is_refused(saved):
    path, raw = saved
    for size in (4, 11, 12, len(raw) // 2, len(raw) - 9, len(raw) - 1):
        path.write_bytes(raw[:size])
        with pytest.raises(RecordingError, match=f"{path} is cut"):
            load_recording(path)


def test_empty_and_foreign_files_are_refused(tmp_path):
    path, other = tmp_path / "a.parquet", tmp_path / "b.parquet"
    pq.write_table(pa.table({"a": [1]}), other)
    for raw, text in (
        (b"", "is empty"),
        (b"time,t01_x\n", "is no Parquet file"),
        (other.read_bytes(), "no recording of holdfast"),
    ):
        path.write_bytes(raw)
        with pytest.raises(RecordingError, match=rf"a\.parquet .*{text}"):
            load_recording(path)


def test_an_error_leaves_no_file(make_recording, tmp_path):
    recording = make_recording()
    thumb = recording.modules["thumb"]
    half = replace(thumb, readings=np.zeros_like(thumb.readings, np.float16))
    bad = {
        "float16": replace(recording, modules={"thumb": half}),
        "JSON": replace(recording, metadata={"a": object()}),
        "truth": replace(recording, truth=Truth(np.array([1.0, 0.0]))),
    }
    for text, wrong in bad.items():
        with pytest.raises(RecordingError, match=text):
            save_recording(wrong, tmp_path / "a.parquet")
    assert list(tmp_path.iterdir()) == []


def test_arrays_that_would_share_a_column_are_refused(make_recording, tmp_path):
    truth = Truth(np.array([0.0]), {"a.0": np.zeros(1), "a": np.zeros((1, 2))})
    with pytest.raises(RecordingError, match=r"truth\.hand\.a\.0"):
        save_recording(make_recording(truth=truth), tmp_path / "a.parquet")


def test_nothing_is_overwritten_unless_forced(make_recording, tmp_path):
    path = tmp_path / "a.parquet"
    save_recording(make_recording(), path)
    with pytest.raises(OutputError, match="exists already"):
        save_recording(make_recording(), path)
    save_recording(make_recording(seed=1), path, force=True)
    assert load_recording(path).digest == make_recording(seed=1).digest
