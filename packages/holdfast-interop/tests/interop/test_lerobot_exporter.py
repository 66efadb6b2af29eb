"""A LeRobot data set has the form that LeRobot expects."""

import json
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from holdfast.errors import OutputError, RecordingError
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import flat_sensor, sensor
from holdfast.synthetic import synthetic_recording
from holdfast_interop.lerobot.exporter import export

DATA = "data/chunk-000/file-000.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
COUNTERS = ("frame_index", "episode_index", "index", "task_index")


@pytest.fixture(scope="module")
def recordings():
    """Two grasps; the second has no thumb and another rate of the index finger."""
    first = synthetic_recording("a", 0, ("thumb", "index"))
    index = synthetic_recording("b", 1, ("index",)).modules["index"]
    slow = Tactile(index.sensor, index.times[::3] + 100.0, index.readings[::3])
    return [first, Recording("b", {"index": slow}, {"task": "lift the cup"})]


@pytest.fixture(scope="module")
def data_set(recordings, tmp_path_factory):
    out = tmp_path_factory.mktemp("lerobot") / "set"
    assert export(recordings, out) == {"episodes": 2, "frames": 692, "tasks": 2}
    return out


@pytest.fixture(scope="module")
def info(data_set):
    return json.loads((data_set / "meta/info.json").read_text())


@pytest.fixture(scope="module")
def table(data_set):
    return pq.read_table(data_set / DATA)


def column(table, name):
    """Return a column as an array, nested lists as its axes."""
    return np.array(table.column(name).to_pylist())


def test_info_has_all_fields(info):
    features = info["features"]
    assert {name: value for name, value in info.items() if name != "features"} == {
        "codebase_version": "v3.0", "robot_type": None, "total_episodes": 2, "total_frames": 692,
        "total_tasks": 2, "chunks_size": 1000, "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200, "fps": 30, "splits": {"train": "0:2"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
    }  # fmt: skip
    one = {"shape": [1], "names": None}
    assert features["timestamp"] == {"dtype": "float32", **one}
    assert all(features[name] == {"dtype": "int64", **one} for name in COUNTERS)
    assert features["observation.tactile.thumb"]["shape"] == [5, 30, 3]
    assert features["observation.tactile.thumb"]["dtype"] == "float32"
    assert features["observation.tactile.index.time"]["shape"] == [5]
    assert not any("/" in name for name in features)


def test_columns_have_the_types_and_shapes_of_the_features(info, table):
    assert table.column_names == list(info["features"])
    for name, feature in info["features"].items():
        values = column(table, name)
        shape = tuple(feature["shape"])
        assert values.shape == (692, *(() if shape == (1,) else shape)), name
        kind = table.schema.field(name).type
        while pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
            kind = kind.value_type
        assert str(kind).replace("double", "float64").replace("float", "float32").replace(
            "float3264", "float64"
        ) == feature["dtype"]  # fmt: skip


def test_an_episode_is_a_row_group_and_says_where_it_is(data_set):
    file = pq.ParquetFile(data_set / DATA)
    assert [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)] == [346, 346]
    rows = pq.read_table(data_set / EPISODES).to_pylist()
    plain = [{k: v for k, v in row.items() if not k.startswith("holdfast.")} for row in rows]
    indices = {
        f"{what}/{part}_index": 0
        for what in ("data", "meta/episodes")
        for part in ("chunk", "file")
    }
    assert plain == [
        {"episode_index": 0, "tasks": ["grasp object 0"], "length": 346, **indices,
         "dataset_from_index": 0, "dataset_to_index": 346},
        {"episode_index": 1, "tasks": ["lift the cup"], "length": 346, **indices,
         "dataset_from_index": 346, "dataset_to_index": 692},
    ]  # fmt: skip


def test_a_frame_has_the_newest_samples_up_to_it(recordings, table):
    index = recordings[0].modules["index"]
    start = recordings[0].start
    times = column(table, "observation.tactile.index.time")
    values = column(table, "observation.tactile.index")
    for frame in (0, 7, 200, 345):
        last = int(np.searchsorted(index.times, start + frame / 30 + 1e-9, side="right"))
        rows = np.maximum(np.arange(last - 5, last), 0)
        assert times[frame].tolist() == index.times[rows].tolist()
        assert values[frame].tolist() == index.readings[rows].tolist()


def test_statistics_are_those_of_the_frames_without_nan(data_set, info, table):
    stats = json.loads((data_set / "meta/stats.json").read_text())
    assert list(stats) == list(info["features"])
    for name in ("observation.tactile.thumb", "observation.tactile.index.time", "timestamp"):
        values = column(table, name).astype(np.float64)
        for key, function in (("mean", np.nanmean), ("std", np.nanstd), ("max", np.nanmax)):
            got, want = np.array(stats[name][key]), function(values, axis=0)
            assert np.allclose(got.reshape(want.shape), want, rtol=1e-9), (name, key)
        assert stats[name]["count"] == [692]


def refusal(error, recordings, out, **options):
    with pytest.raises(error) as caught:
        export(recordings, out, **options)
    assert list(out.parent.iterdir()) == []
    return str(caught.value)


def test_a_rate_is_a_whole_number_from_1(recordings, tmp_path):
    assert "--fps" in refusal(ValueError, recordings, tmp_path / "set", fps=0)


def test_recordings_that_do_not_fit_are_named(recordings, tmp_path):
    index = recordings[1].modules["index"]
    other = Tactile(flat_sensor("small", 2, 2, 0.004), [0.0, 0.1], np.zeros((2, 4, 3)))
    gaps = Tactile(sensor("anyskin"), [0.0, 1e9], np.zeros((2, 5, 3)))
    for modules, text in (
        ({"index": other}, "c: observation.tactile.index"),
        ({"index": replace(index, unit="N")}, "c: index is in N"),
        ({"index/1": index, "index.1": index}, "'observation.tactile.index.1'"),
        ({"skin": gaps}, "c: 3e+10 frames"),
    ):
        given = [recordings[0], Recording("c", modules)]
        assert text in refusal(RecordingError, given, tmp_path / "set")


def test_only_a_data_set_is_replaced(recordings, tmp_path):
    out = tmp_path / "set"
    export(recordings[1:], out)
    with pytest.raises(OutputError, match="exists already"):
        export(recordings[1:], out)
    export(recordings[1:], out, fps=10, force=True)
    assert json.loads((out / "meta/info.json").read_text())["fps"] == 10
    assert [path.name for path in tmp_path.iterdir()] == ["set"]
    for name in ("set/data/video.mp4", "other/meta/info.json", "mine/thesis.txt"):
        file, folder = tmp_path / name, tmp_path / name.partition("/")[0]
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("{}")
        with pytest.raises(OutputError, match="is not such an export"):
            export(recordings[1:], folder, force=True)
        assert file.read_text() == "{}"
