from dataclasses import replace
from threading import Thread

import msgspec
import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import load_recording, save_recording
from holdfast.labelling.server import workspace
from holdfast.labelling.server.workspace import Workspace, beside, default_rule, summary_of
from holdfast.live.recorder import Recorder
from holdfast.recordings import Truth
from holdfast.synthetic import synthetic_recording

from .build import FINGERS, NOW, made


def workspace_of(*paths, **words):
    return Workspace(paths, author="ada", clock=lambda: NOW, **words)


def test_a_few_recordings_are_kept_in_memory(tmp_path, monkeypatch):
    paths = [made(tmp_path, f"r{k}", k) for k in range(4)]
    loaded = []
    load = workspace.load_recording
    monkeypatch.setattr(
        workspace,
        "load_recording",
        lambda path, **options: (loaded.append(path.stem), load(path, **options))[1],
    )
    kept = Workspace(paths, author="ada", clock=lambda: NOW)
    assert [kept.summary(k).name for k in range(4)] == ["r0", "r1", "r2", "r3"]
    assert loaded == []  # headers are enough
    for index in (0, 1, 2, 0, 3, 0, 2, 1):
        assert kept.open(index).recording.name == f"r{index}"
    assert loaded == ["r0", "r1", "r2", "r3", "r1"]
    save_recording(synthetic_recording("r1", 9, FINGERS), paths[1], force=True)
    assert kept.open(1).recording.digest == synthetic_recording("r1", 9, FINGERS).digest


def test_the_rule_is_the_one_with_the_best_evidence():
    recording = synthetic_recording("grasp", 0, FINGERS)
    assert default_rule(recording) == "signal"
    assert default_rule(recording, "poses.csv") == "tracking"
    times = recording.modules["thumb"].times
    rest = np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(times), 1))
    seen = Truth(times, {"object_pose": rest}, {"thumb": {"tip_pose": rest}})
    assert default_rule(replace(recording, truth=seen)) == "tracking"


def test_threads_share_what_is_computed_once(tmp_path, monkeypatch):
    kept = workspace_of(made(tmp_path, "one"))
    made_of = []
    signals = workspace.FingerSignals
    monkeypatch.setattr(
        workspace,
        "FingerSignals",
        lambda module, tare: (made_of.append(module), signals(module, tare))[1],
    )
    found = []
    asked = [kept.signals, kept.changes, lambda k: kept.propose(k, "signal", {})] * 2
    threads = [Thread(target=lambda ask=ask: found.append(ask(0))) for ask in asked]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 6
    assert len(made_of) == len(kept.open(0).recording.modules)


def test_a_page_may_use_another_tare_than_the_workspace(tmp_path):
    path = made(tmp_path, "one")
    held = workspace_of(path, tare="first")
    _, first = held.propose(0, "", {})
    _, usual = held.propose(0, "", {"tare": 0.5})
    assert first != usual
    assert workspace_of(path).propose(0, "signal", {})[1] == usual == held.proposals(0)


def test_poses_of_the_workspace(tmp_path):
    poses = tmp_path / "poses.csv"
    rows = "".join(f"{k / 100},0,0,0,1,0,0,{1e-9 * (k % 2)}\n" for k in range(1200))
    poses.write_text("time,x,y,z,qw,qx,qy,qz\n" + rows)
    rule, found = workspace_of(made(tmp_path, "one"), poses=poses).propose(0, "", {})
    assert rule == "tracking"
    assert {label.author for label in found["thumb"]} == {"rule:tracking"}


def test_recordings_that_were_deleted(tmp_path):
    kept = workspace_of(made(tmp_path, "one"))
    assert kept.open(0).recording.name == "one"
    kept.paths[0].unlink()
    for ask in (kept.summary, kept.open, kept.stored, kept.signals):
        with pytest.raises(RecordingError, match=r"one\.parquet: No such file"):
            ask(0)


@pytest.mark.parametrize("name", ["a.mp4", "sub/b.mp4", "./a.mp4", "sub/../a.mp4"])
def test_files_beside_a_recording(tmp_path, name):
    (tmp_path / "sub").mkdir()
    for file in ("a.mp4", "sub/b.mp4"):
        (tmp_path / file).write_bytes(b"video")
    found = beside(tmp_path / "one.parquet", name)
    assert found is not None
    assert found.read_bytes() == b"video"


@pytest.fixture(params=["parquet", "mcap"])
def path(request, tmp_path):
    return made(tmp_path, suffix=f".{request.param}", bare=False)


def check(path):
    found, recording = summary_of(path), load_recording(path)
    assert found.name == recording.name
    assert found.fingers == tuple(recording.modules)
    assert found.digest == recording.digest
    assert found.n_inside == sum(len(module.labels) for module in recording.modules.values())
    assert found.duration == pytest.approx(recording.duration, rel=0.01)


def test_the_header_is_enough(path, monkeypatch):
    check(path)
    monkeypatch.setattr(workspace, "load_recording", lambda *_, **__: pytest.fail("read whole"))
    assert summary_of(path).fingers == FINGERS


def test_a_file_that_was_renamed(path):
    other = path.rename(path.with_stem("other"))
    assert summary_of(other).name == "other"
    check(other)


@pytest.mark.parametrize("path", ["mcap"], indirect=True)
def test_a_file_that_was_cut_is_read_whole(path):
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
def test_files_that_are_not_recordings(tmp_path, name):
    (tmp_path / name).write_bytes(msgspec.json.encode({"a": 1}) * 10)
    with pytest.raises(RecordingError):
        summary_of(tmp_path / name)
    with pytest.raises(RecordingError):
        summary_of(tmp_path / f"gone-{name}")
