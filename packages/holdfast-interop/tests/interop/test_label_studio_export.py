import csv
import io
import json
from xml.etree import ElementTree

import numpy as np
import pytest

from holdfast.contact import Cause, ContactState
from holdfast.errors import OutputError, RecordingError
from holdfast.features import haar_features
from holdfast.recordings import Label, Recording, Tactile
from holdfast_interop.label_studio.reading import annotations_of, labels_from_label_studio
from holdfast_interop.label_studio.writing import (
    labelling_config,
    save_label_studio,
    signals_csv,
    task_of,
)
from labelling.tiny import TINY, tiny_recording


def table(text):
    rows = list(csv.DictReader(io.StringIO(text)))
    return {
        name: np.array([float(row[name]) if row[name] else np.nan for row in rows])
        for name in rows[0]
    }


def test_signals_are_the_forces_without_the_baseline_of_the_first_half_second():
    recording = tiny_recording(1)
    readings = recording.modules["index"].readings
    force = (readings - readings[:50].mean(axis=0)).sum(axis=1)
    columns = table(signals_csv(recording, window=8))
    assert list(columns) == ["time", *(f"{f}_{s}" for f in ("thumb", "index") for s in SHOWN)]
    assert columns["time"].tolist() == recording.modules["index"].times.tolist()
    shown = np.column_stack([columns[f"index_F_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(shown, force, rtol=1e-6)
    np.testing.assert_allclose(columns["index_F_a"], np.linalg.norm(force, axis=1), rtol=1e-6)
    np.testing.assert_allclose(columns["index_sigma"], haar_features(force, 8)[:, 5], rtol=1e-6)


SHOWN = ("F_a", "F_x", "F_y", "F_z", "sigma")


def test_a_slower_finger_shows_its_latest_sample():
    ramp = np.arange(4.0)[:, None, None] * np.ones((1, 1, 3))
    modules = {
        "thumb": Tactile(TINY, np.arange(8) * 0.5, np.zeros((8, 1, 3))),
        "index": Tactile(TINY, 0.6 + np.arange(4.0), ramp),
    }
    columns = table(signals_csv(Recording("can", modules), window=2))
    np.testing.assert_equal(columns["index_F_x"], [np.nan, np.nan, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0])


def test_a_finger_without_values_has_empty_cells():
    readings = np.full((100, 1, 3), np.nan)
    recording = Recording("can", {"thumb": Tactile(TINY, np.arange(100) / 100, readings)})
    columns = table(signals_csv(recording))
    assert np.isnan(columns["thumb_F_a"]).all()
    assert np.isfinite(columns["time"]).all()


def test_the_task():
    label = Label(0.5, 1.5, ContactState.UNSTABLE, Cause.SLIP, "marker", 0.5, "ann")
    recording = tiny_recording(1).with_labels({"index": [label]})
    task = task_of(recording, "http://localhost/x.csv")
    assert task["data"] == {
        "csv": "http://localhost/x.csv",
        "recording": "grasp-1",
        "digest": recording.digest,
    }
    assert task["predictions"] == []
    assert task["annotations"] == [
        {
            "result": [
                {
                    "id": "index-0",
                    "type": "timeserieslabels",
                    "from_name": "index",
                    "to_name": "index-signals",
                    "value": {
                        "start": 0.5,
                        "end": 1.5,
                        "instant": False,
                        "timeserieslabels": ["UNSTABLE (slip)"],
                    },
                    "score": 0.5,
                    "meta": {"evidence": "marker", "author": "ann"},
                }
            ]
        }
    ]


def test_the_task_of_a_recording_without_labels():
    bare = tiny_recording(1).with_labels({})
    assert task_of(bare, "x.csv")["annotations"] == []
    assert task_of(bare, "x.csv", predictions=True)["predictions"] == []


def test_the_config_has_the_names_of_tasks_and_signals():
    recording = tiny_recording(1, ("thumb", "index/1", "=1+1"))
    units = {"thumb": "count", "index/1": "N", "=1+1": "N"}
    root = ElementTree.fromstring(labelling_config(units))
    groups = {each.get("name"): each for each in root.iter("TimeSeriesLabels")}
    series = {each.get("name"): each for each in root.iter("TimeSeries")}
    columns = set(table(signals_csv(recording)))
    assert not any(column.startswith("=") for column in columns)
    for result in task_of(recording, "x.csv")["annotations"][0]["result"]:
        group = groups[result["from_name"]]
        assert group.get("toName") == result["to_name"]
        names = {label.get("value") for label in group.iter("Label")}
        assert set(result["value"]["timeserieslabels"]) <= names
        channels = series[result["to_name"]].iter("Channel")
        assert {channel.get("column") for channel in channels} <= columns
    assert {each.get("value") for each in series.values()} == {"$csv"}
    assert {each.get("timeColumn") for each in series.values()} == {"time"}
    assert [c.get("units") for c in series["index/1-signals"].iter("Channel")] == ["N"] * 5


def test_the_config_has_labels_that_are_in_use_and_escapes_names():
    text = labelling_config({'"<&': "count"}, ["NO_CONTACT (lost)"])
    root = ElementTree.fromstring(text)
    assert root.find("TimeSeriesLabels").get("name") == '"<&'
    names = [label.get("value") for label in root.iter("Label")]
    assert names[:3] == ["STABLE", "UNSTABLE", "NO_CONTACT"]
    assert names[-1] == "NO_CONTACT (lost)"
    assert len(names) == len(set(names)) == 10


@pytest.fixture
def grasps():
    return [tiny_recording(seed) for seed in range(2)]


def test_a_folder_for_label_studio(tmp_path, grasps):
    folder = tmp_path / "two grasps"
    path = save_label_studio(grasps, folder)
    assert sorted(each.name for each in folder.iterdir()) == [
        "grasp-0.signals.csv",
        "grasp-1.signals.csv",
        "label-studio.json",
        "label-studio.xml",
    ]
    links = [task["data"]["csv"] for task in json.loads(path.read_text())]
    assert links == [f"/data/local-files/?d=two%20grasps/grasp-{k}.signals.csv" for k in (0, 1)]
    for grasp in grasps:
        back = labels_from_label_studio(path, grasp.with_labels({}))
        assert back == {finger: module.labels for finger, module in grasp.modules.items()}


def test_labels_in_use_are_in_the_written_config(tmp_path, grasps):
    lost = Label(0.5, 1.5, ContactState.NO_CONTACT, Cause.LOST)
    save_label_studio([grasps[0].with_labels({"thumb": [lost]})], tmp_path)
    assert "NO_CONTACT (lost)" in (tmp_path / "label-studio.xml").read_text()


def test_another_place_for_the_signals_and_labels_as_predictions(tmp_path, grasps):
    path = save_label_studio(grasps, tmp_path, url="https://lab/files/", predictions=True)
    task = json.loads(path.read_text())[1]
    assert task["data"]["csv"] == "https://lab/files/grasp-1.signals.csv"
    assert task["annotations"] == []
    assert [each.prediction for each in annotations_of(path, grasps[1])] == [True]


@pytest.mark.parametrize("name", ["label-studio.json", "label-studio.xml", "grasp-1.signals.csv"])
def test_nothing_is_replaced_without_force(tmp_path, grasps, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(OutputError) as error:
        save_label_studio(grasps, tmp_path)
    assert str(error.value) == (
        f"{tmp_path / name} exists already: choose another name, or give --force"
    )
    assert (tmp_path / name).read_text() == "mine"
    save_label_studio(grasps, tmp_path, force=True)
    assert (tmp_path / name).read_text() != "mine"


def test_a_folder_that_cannot_be_created(tmp_path, grasps):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError) as error:
        save_label_studio(grasps, tmp_path / "file" / "folder")
    assert str(error.value) == f"cannot write {tmp_path / 'file' / 'folder'}: Not a directory"


def test_recordings_that_cannot_be_exported(tmp_path, grasps):
    with pytest.raises(RecordingError) as error:
        save_label_studio([grasps[0], grasps[0]], tmp_path / "a")
    assert str(error.value) == "two recordings have the name 'grasp-0'; different names expected"
    with pytest.raises(RecordingError) as error:
        save_label_studio([], tmp_path / "b")
    assert str(error.value) == "no recordings given; at least one expected"


def test_a_name_with_a_path_stays_in_the_folder(tmp_path, grasps):
    save_label_studio([Recording("../can", grasps[0].modules)], tmp_path / "out")
    assert len(list((tmp_path / "out").glob("*.signals.csv"))) == 1
    assert not (tmp_path / "can.signals.csv").exists()
