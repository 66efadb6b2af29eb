import msgspec
import pytest

from holdfast.errors import RecordingError
from holdfast.io import load_recording, save_recording
from holdfast.labelling import summary
from holdfast.labelling.summary import summary_of
from holdfast.live.recorder import Recorder
from holdfast.synthetic import synthetic_recording

FINGERS = ("thumb", "index")


@pytest.fixture(params=["parquet", "mcap"])
def path(request, tmp_path):
    path = tmp_path / f"grasp.{request.param}"
    save_recording(synthetic_recording("grasp", 0, FINGERS), path)
    return path


def check(path):
    found, recording = summary_of(path), load_recording(path)
    assert found.name == recording.name
    assert found.fingers == tuple(recording.modules)
    assert found.digest == recording.digest
    assert found.n_inside == sum(len(module.labels) for module in recording.modules.values())
    assert found.duration == pytest.approx(recording.duration, rel=0.01)


def test_the_header_tells_all(path, monkeypatch):
    check(path)
    monkeypatch.setattr(summary, "load_recording", lambda *_, **__: pytest.fail("read whole"))
    assert summary_of(path).fingers == FINGERS


def test_a_file_that_was_renamed(path):
    other = path.rename(path.with_stem("other"))
    assert summary_of(other).name == "other"
    check(other)


def test_a_file_that_was_cut_is_read_whole(tmp_path):
    path = tmp_path / "grasp.mcap"
    save_recording(synthetic_recording("grasp", 0, FINGERS), path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    check(path)


def test_a_recording_without_a_sample(tmp_path):
    recording = synthetic_recording("grasp", 0, FINGERS)
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    recorder = Recorder(tmp_path / "grasp.mcap", sensors)
    recorder.close()
    with pytest.raises(RecordingError):
        summary_of(tmp_path / "grasp.mcap")


@pytest.mark.parametrize("name", ["a.parquet", "a.mcap", "a.txt"])
def test_files_that_are_no_recordings(tmp_path, name):
    (tmp_path / name).write_bytes(msgspec.json.encode({"a": 1}) * 10)
    with pytest.raises(RecordingError):
        summary_of(tmp_path / name)
    with pytest.raises(RecordingError):
        summary_of(tmp_path / f"gone-{name}")
