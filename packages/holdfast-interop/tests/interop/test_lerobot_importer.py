"""Recordings come back from a LeRobot data set as they were."""

import json
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast_interop.lerobot import importer as lerobot
from holdfast_interop.lerobot.exporter import export

pytestmark = pytest.mark.slow

DATA = "data/chunk-000/file-000.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"


@pytest.fixture
def data_set(make_recording, tmp_path):
    """The folder of a data set of one recording."""
    export([make_recording()], tmp_path / "set")
    return tmp_path / "set"


def refusal(folder):
    with pytest.raises(RecordingError) as caught:
        list(import_recordings(folder, "lerobot"))
    assert str(folder) in str(caught.value)
    return str(caught.value)


def rewritten(path, change):
    """Write a Parquet file again, as another program would, with a changed table."""
    pq.write_table(change(pq.read_table(path)), path)


@pytest.mark.parametrize("fps", [1, 30, 1000])
@pytest.mark.parametrize("again", [False, True])
def test_several_rates_labels_truth_markers_and_media_come_back(
    make_recording, assert_same, tmp_path, fps, again
):
    recording, folder = make_recording(), tmp_path / "set"
    export([recording], folder, fps=fps)
    if again:  # by another program
        rewritten(folder / DATA, lambda table: table.select(sorted(table.column_names)))
        rewritten(folder / EPISODES, lambda table: table)
    (read,) = import_recordings(folder)
    assert_same(read, recording)


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), fps=st.sampled_from([1, 7]))
def test_any_recording_comes_back(data, fps, recordings, assert_same, tmp_path_factory):
    recording = data.draw(recordings)
    out = tmp_path_factory.mktemp("any") / "set"
    try:
        export([recording], out, fps=fps)
    except RecordingError as refused:
        assume("would share the column" not in str(refused) and "gaps" not in str(refused))
        raise
    (read,) = import_recordings(out)
    assert_same(read, recording)


def test_a_finger_may_be_missing_and_number_types_may_differ(make_recording, assert_same, tmp_path):
    both = make_recording()
    thumb = replace(both, name="can_2", modules={"thumb": both.modules["thumb"]})
    module = both.modules["thumb"]
    floats = replace(module, readings=module.readings.astype(np.float64) + 0.1)
    third = replace(both, name="can_3", modules={"thumb": floats}, truth=None)
    export([thumb, both, third], tmp_path / "set")
    read = list(import_recordings(tmp_path / "set"))
    for got, want in zip(read, [thumb, both, third], strict=True):
        assert_same(got, want)


def test_a_changed_reading_is_found(data_set):
    def change(table):
        name = "observation.tactile.thumb"
        values = table.column(name).to_pylist()
        values[5][-1][0][0] += 1
        column = pa.array(values, table.schema.field(name).type)
        return table.set_column(table.column_names.index(name), name, column)

    rewritten(data_set / DATA, change)
    assert "do not match their digest" in refusal(data_set)


@pytest.mark.parametrize(
    ("path", "change", "message"),
    [
        (EPISODES, lambda t: t.drop_columns(["holdfast.texts"]), "no column 'holdfast.texts'"),
        (EPISODES, lambda t: t.drop_columns(["holdfast.header"]), "and its sensor, as --array"),
        (EPISODES, lambda t: t.slice(0, 0), "0 episodes, its meta/info.json names 1"),
        (DATA, lambda t: t.slice(1), "frames of episode 0"),
        (DATA, lambda t: t.drop_columns(["truth.new"]), "column 'truth.new' is missing"),
        (DATA, lambda t: t.set_column(
            t.column_names.index("truth.new"), "truth.new", pa.array([99] * len(t))
        ), "new samples in a frame expected"),
        (DATA, lambda t: t.set_column(
            t.column_names.index("truth.hand.phase"), "truth.hand.phase",
            pa.array([[9] * len(x) for x in t.column("truth.hand.phase").to_pylist()]),
        ), "a number without a text"),
        (DATA, lambda t: t.set_column(
            t.column_names.index("truth.new"), "truth.new", pa.nulls(len(t), pa.int64())
        ), "missing values"),
    ],
)  # fmt: skip
def test_what_is_missing_or_wrong_is_named(data_set, path, change, message):
    rewritten(data_set / path, change)
    assert message in refusal(data_set)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("codebase_version", "v2.1", "LeRobot v2.1 given, v3.0 expected"),
        ("data_path", "{chunk_index:0999999999d}", "data_path '{chunk_index"),
        ("total_episodes", "many", "is not that of a data set"),
    ],
)
def test_another_description_is_refused(data_set, field, value, message):
    path = data_set / "meta/info.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {field: value}))
    assert message in refusal(data_set)


def test_only_the_folder_of_a_data_set_is_recognised(data_set):
    assert lerobot.can_read(data_set)
    assert not lerobot.can_read(data_set / "data")
    assert not lerobot.can_read(data_set / "meta/info.json")
    assert "has no meta/info.json" in refusal(data_set / "data")
