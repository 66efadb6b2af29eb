"""LeRobot data sets of other programs: a feature of numbers, its names, and its episodes."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording
from holdfast_interop.lerobot.exporter import export

SKIN = sensor("anyskin")
N = 90
READINGS = np.random.default_rng(7).normal(0, 1, (2, N, 5, 3)).astype(np.float32)
NAMES = [f"{axis}{taxel}" for taxel in range(1, 6) for axis in "xyz"]
BY_AXIS = [f"{axis}{taxel}" for axis in "xyz" for taxel in range(1, 6)]


def data_set(folder, version, values, names=None, **features):
    """Write two episodes of a feature `observation.tactile`, as LeRobot does."""
    shape = list(values.shape[2:])
    features = {"observation.tactile": (shape, names), **features}
    info = {
        "codebase_version": version, "fps": 30, "total_episodes": 2, "total_frames": 2 * N,
        "data_path": "whatever",
        "features": {
            **{k: {"dtype": "float32", "shape": s, "names": n} for k, (s, n) in features.items()},
            "observation.image": {"dtype": "video", "shape": [3, 9, 9], "names": None},
            **{
                k: {"dtype": "int64", "shape": [1], "names": None}
                for k in ("timestamp", "frame_index", "episode_index", "index", "task_index")
            },
        },
    }  # fmt: skip
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    tables = [
        pa.table(
            {
                "observation.tactile": pa.array(values[k].tolist()),
                **{
                    name: pa.array([[0.0] * s[0]] * N)
                    for name, (s, _) in features.items()
                    if name != "observation.tactile"
                },
                "timestamp": pa.array(np.arange(N, dtype=np.float32) / np.float32(30)),
                "frame_index": pa.array(range(N)),
                "episode_index": pa.array([k] * N),
                "index": pa.array(range(k * N, k * N + N)),
                "task_index": pa.array([0] * N),
            }
        )
        for k in range(2)
    ]
    if version.startswith("v3"):
        pq.write_table(pa.concat_tables(tables), folder / "data/chunk-000/file-000.parquet")
    else:
        for k, table in enumerate(tables):
            pq.write_table(table, folder / f"data/chunk-000/episode_{k:06d}.parquet")
    return folder


LAYOUTS = {
    "numbers": (READINGS.reshape(2, N, 15), NAMES),
    "numbers without names": (READINGS.reshape(2, N, 15), None),
    "names in a record": (READINGS.reshape(2, N, 15), {"taxels": NAMES}),
    "axis after axis": (READINGS.swapaxes(2, 3).reshape(2, N, 15), BY_AXIS),
    "taxels and axes": (READINGS, None),
}


@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
@pytest.mark.parametrize(("values", "names"), LAYOUTS.values(), ids=LAYOUTS)
def test_a_feature_becomes_a_recording_for_each_episode(tmp_path, version, values, names):
    folder = data_set(tmp_path / "set", version, values, names, action=([6], None))
    for key in ("observation.tactile", "*"):
        # Numbers without names are proposed.
        accept = key == "*" and names is None and values.ndim == 3
        recordings = list(import_recordings(folder, sensors={key: SKIN}, accept=accept))
        assert [one.name for one in recordings] == ["set-0", "set-1"]
        for one, readings in zip(recordings, READINGS, strict=True):
            module = one.modules["finger1"]
            np.testing.assert_array_equal(module.readings, readings)
            np.testing.assert_allclose(module.times, np.arange(N) / 30, atol=1e-6)


WINDOWS = np.repeat(READINGS.reshape(2, N, 1, 15)[..., :6], 5, 2)
REFUSED = {
    "no sensor": (READINGS, {}, "--sensor anyskin"),
    "another feature": (READINGS, {"observation.touch": SKIN}, "'observation.touch'"),
    "normal force": (READINGS[..., 2], {"observation.tactile": SKIN}, "three axes"),
    "windows": (WINDOWS, {"*": SKIN}, "--axes=1,2,3"),
}


@pytest.mark.parametrize(("values", "sensors", "text"), REFUSED.values(), ids=REFUSED)
@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
def test_refusals_name_the_option(tmp_path, version, values, sensors, text):
    with pytest.raises(RecordingError, match=text):
        list(import_recordings(data_set(tmp_path / "set", version, values), sensors=sensors))


def test_150_hz_beside_video_at_30_hz_are_windows_of_five(tmp_path, assert_same):
    """Every sample is in exactly one frame, and comes back as it was."""
    recording = synthetic_recording("grasp", seed=0)  # 150 Hz
    export([recording], tmp_path / "set", fps=30)
    info = json.loads((tmp_path / "set" / "meta" / "info.json").read_text())
    assert (info["fps"], info["features"]["observation.tactile.thumb"]["shape"]) == (30, [5, 30, 3])
    table = pq.read_table(tmp_path / "set" / "data/chunk-000/file-000.parquet")
    counts = table["observation.tactile.thumb.new"].to_numpy()
    assert set(counts[1:-1].tolist()) == {5}
    assert counts.sum() == recording.modules["thumb"].n_samples
    (read,) = import_recordings(tmp_path / "set")
    assert_same(read, recording)
