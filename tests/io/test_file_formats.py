import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from holdfast.errors import OutputError, RecordingError
from holdfast.io import load_recording, read_chunks, safe_reading, save_labels, save_recording
from holdfast.io.header import encode_header
from holdfast.io.mcap_writer import RecordingWriter
from holdfast.labelling.server.workspace import summary_of


@pytest.mark.parametrize("read", [load_recording, read_chunks])
def test_paths_that_cannot_be_read(read, tmp_path):
    (tmp_path / "a.csv").write_text("")
    (tmp_path / "b.mcap").mkdir()
    messages = {
        "a.csv": "`holdfast import`",
        "b.mcap": "is a folder",
        "c.parquet": "does not exist",
    }
    for name, text in messages.items():
        with pytest.raises(RecordingError, match=f"{tmp_path / name}.*{text}"):
            read(tmp_path / name)


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
def test_an_error_of_the_disk_while_loading(make_recording, tmp_path, monkeypatch, suffix):
    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    path = tmp_path / f"a.{suffix}"
    save_recording(make_recording(150), path)
    monkeypatch.setattr(f"holdfast.io.{suffix}.load", refuse)
    with pytest.raises(RecordingError, match="Permission denied"):
        load_recording(path)


def test_saving_with_an_unknown_suffix(make_recording, tmp_path):
    with pytest.raises(OutputError, match=r"a\.h5"):
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
    assert all(one.end < two.start for one, two in pairwise(chunks))


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
    with pytest.raises(ValueError, match="0 given"):
        read_chunks(tmp_path / "a.parquet", 0)


def read_all(path):
    """Read a file by every way; each returns or raises a `RecordingError` with its name."""
    refusals = []
    for read in (load_recording, lambda file: list(read_chunks(file)), summary_of):
        try:
            read(path)
        except RecordingError as refusal:
            assert str(path) in str(refusal)
            assert "\n" not in str(refusal)
            refusals.append(str(refusal))
    return refusals


DEEP = "[" * 100_000 + "]" * 100_000
LIES = {
    "number": lambda head: head["truth"]["hand"]["matrix"].update(number="object"),
    "number of a module": lambda head: head["modules"]["thumb"].update(number="datetime64[s]"),
    "shape": lambda head: head["truth"]["hand"]["matrix"].update(shape=[-1, 2]),
    "large shape": lambda head: head["truth"]["hand"]["matrix"].update(shape=[1 << 19, 1 << 19]),
    "n_samples": lambda head: head["modules"]["thumb"].update(n_samples=-5),
    "n_rows": lambda head: head["truth"].update(n_rows=1 << 62),
    "positions": lambda head: head["modules"]["thumb"]["sensor"].update(positions=[[]]),
    "rate": lambda head: head["modules"]["thumb"]["sensor"].update(rate=10**400),
    "range": lambda head: head["modules"]["thumb"]["sensor"].update(range={"a": 1}),
    "deep": lambda head: head["metadata"].update(object="DEEP"),
    "deep sensor": lambda head: head["modules"]["thumb"]["sensor"].update(name="DEEP"),
    "label": lambda head: head["modules"]["thumb"]["labels"][0].update(start=5.0),
    "markers": lambda head: head.update(markers=[["a", 1.0]]),
}


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
@pytest.mark.parametrize("older", [True, False])
def test_the_range_of_a_sensor_is_kept(make_recording, tmp_path, monkeypatch, suffix, older):
    def encode(header):
        head = msgspec.json.decode(encode_header(header))
        for module in head["modules"].values():
            module["sensor"]["limits"] = module["sensor"].pop("range")
        return msgspec.json.encode(head)

    recording, path = make_recording(), tmp_path / f"a.{suffix}"
    if older:
        module = "parquet" if suffix == "parquet" else "mcap_writer"
        monkeypatch.setattr(f"holdfast.io.{module}.encode_header", encode)
    save_recording(recording, path)
    again = load_recording(path)
    ranges = [{n: m.sensor.range for n, m in x.modules.items()} for x in (recording, again)]
    assert ranges[0] == ranges[1] and any(ranges[0].values())
    assert again.digest == recording.digest


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
@pytest.mark.parametrize("lie", LIES)
def test_a_header_that_lies_is_refused(make_recording, tmp_path, monkeypatch, suffix, lie):
    def encode(header):
        head = msgspec.json.decode(encode_header(header))
        LIES[lie](head)
        return msgspec.json.encode(head).replace(b'"DEEP"', DEEP.encode())

    module = "parquet" if suffix == "parquet" else "mcap_writer"
    monkeypatch.setattr(f"holdfast.io.{module}.encode_header", encode)
    path = tmp_path / f"a.{suffix}"
    save_recording(make_recording(150), path)
    assert len(read_all(path)) >= 2  # a summary needs only a part of the header


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
def test_a_library_may_raise_any_error(make_recording, tmp_path, monkeypatch, suffix):
    def fail(*_):
        raise AttributeError("'NoneType' object\nhas no attribute")

    path = tmp_path / f"a.{suffix}"
    save_recording(make_recording(150), path)
    monkeypatch.setattr(f"holdfast.io.{suffix}.decode_header", fail)
    text = f"{path} is damaged: 'NoneType' object has no attribute"
    assert read_all(path) == [text] * 3


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
def test_a_pipe_or_a_device_is_refused_at_once(tmp_path, suffix):
    pipe, device = tmp_path / f"pipe.{suffix}", tmp_path / f"device.{suffix}"
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    for path in (pipe, device):
        with pytest.raises(RecordingError, match="is a pipe"):
            load_recording(path)


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
def test_the_size_of_a_recording_that_is_loaded_is_limited(
    make_recording, tmp_path, monkeypatch, suffix
):
    path, recording = tmp_path / f"a.{suffix}", make_recording()
    save_recording(recording, path)
    module = recording.modules["thumb"]
    monkeypatch.setattr(safe_reading, "MAX_RECORDING", module.readings.nbytes)
    with pytest.raises(RecordingError, match="MB"):
        load_recording(path)
    chunks = read_chunks(path, 100)
    assert sum(chunk.modules["thumb"].n_samples for chunk in chunks) == module.n_samples
