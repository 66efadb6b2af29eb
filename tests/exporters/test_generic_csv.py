"""The generic CSV that is exported is what `holdfast import` reads."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import Cause
from holdfast.errors import OutputError, RecordingError
from holdfast.exporters.generic_csv import export
from holdfast.io import import_recordings
from holdfast.recordings import Label, Recording, Tactile
from holdfast.sensors import Sensor, flat_sensor, sensor
from holdfast.synthetic import synthetic_recording

TIMES = np.arange(60) / 100 + 1795364053.125


def tactile(name="anyskin", times=TIMES, dtype=np.float64, **fields):
    skin = name if isinstance(name, Sensor) else sensor(name)
    rng = np.random.default_rng(1)
    readings = rng.normal(0, 1000, (len(times), skin.n_taxels, 3)).astype(dtype)
    return Tactile(skin, times, readings, **fields)


def read(path, **options):
    return list(import_recordings(path, "csv", **options))


def assert_equal(got, want):
    assert got.sensor == want.sensor
    assert got.unit == want.unit
    assert got.times.tolist() == want.times.tolist()
    assert np.array_equal(got.readings, want.readings, equal_nan=True)
    assert got.label_states.tolist() == want.label_states.tolist()


def test_times_readings_sensors_and_labels_come_back(tmp_path):
    grasp = synthetic_recording("grasp", 0, ("thumb", "index"))
    written = export([grasp], tmp_path / "out")
    assert written == (["grasp.csv"], [], ["metadata"])
    (back,) = read(tmp_path / "out")
    assert (back.name, list(back.modules)) == ("grasp", ["thumb", "index"])
    for name, module in grasp.modules.items():
        assert_equal(back.modules[name], module)
        assert back.modules[name].readings.dtype == np.uint16
        causes = [label.cause for label in back.modules[name].labels]
        assert causes == [label.cause for label in module.labels]


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int16, np.int32])
def test_number_types_keep_their_values(tmp_path, dtype):
    module = tactile(dtype=dtype)
    if dtype in (np.float32, np.float64):
        readings = module.readings.copy()
        readings[3, 2] = np.nan
        module = replace(module, readings=readings)
    export([Recording("a", {"finger1": module})], tmp_path / "out")
    (back,) = read(tmp_path / "out")
    assert_equal(back.modules["finger1"], module)


def test_modules_with_other_times_get_a_table_of_their_own(tmp_path):
    slow = tactile(times=TIMES[::2])
    label = Label(TIMES[0], TIMES[10], "UNSTABLE", Cause.SLIP)
    recording = Recording(
        "two",
        {"a": tactile(labels=(label,)), "b/1": slow, "c": tactile("uskin-4x4", unit="N")},
    )
    written = export([recording], tmp_path / "out")
    assert written.files == ["two_a.csv", "two_b_1-26024409.csv"]
    first, second = read(tmp_path / "out")
    assert list(first.modules) == ["a", "c"]
    assert list(second.modules) == ["b/1"]
    for back in (first, second):
        for name, module in back.modules.items():
            assert_equal(module, recording.modules[name])


def test_a_sensor_of_its_own_is_a_file_beside_the_table(tmp_path):
    own = flat_sensor("my skin", 2, 2, 0.004)
    recording = Recording("a", {"thumb": tactile(own)})
    written = export([recording], tmp_path / "out")
    (option,) = written.sensors
    name, path = option.split("=")
    assert (name, path) == ("thumb", str(tmp_path / "out" / "thumb.sensor.json"))
    (back,) = read(tmp_path / "out", sensors={"thumb": Sensor.from_json(path)})
    assert_equal(back.modules["thumb"], recording.modules["thumb"])
    changed = Recording("b", {"thumb": tactile(flat_sensor("my skin", 2, 2, 0.005))})
    with pytest.raises(RecordingError, match="apart"):
        export([recording, changed], tmp_path / "more")
    assert not (tmp_path / "more").exists()


@pytest.mark.parametrize("name", ["=1+1", "a,b", "a=b", " a", "a ", 'a"b', "a\nb", "@a", ""])
def test_a_name_that_no_header_holds_is_refused(tmp_path, name):
    with pytest.raises(RecordingError, match="columns"):
        export([Recording("a", {name: tactile()})], tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_one_table_may_be_a_file(tmp_path):
    recording = Recording("a", {"b": tactile()})
    assert export([recording], tmp_path / "x.csv").files == ["x.csv"]
    (back,) = read(tmp_path / "x.csv")
    assert_equal(back.modules["b"], recording.modules["b"])
    with pytest.raises(OutputError, match="exists already"):
        export([recording], tmp_path / "x.csv")
    export([recording], tmp_path / "x.csv", force=True)
    with pytest.raises(OutputError, match="a folder expected"):
        export([recording, recording], tmp_path / "y.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["x.csv"]
