import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.sensors import hand


def write(path, readings, index=0, time="time", times=None):
    n = len(readings)
    names = [f"F{axis}{taxel}" for taxel in range(readings.shape[1] // 3) for axis in "xyz"]
    names.insert(index, time)
    times = np.arange(n) / 100 if times is None else times
    table = np.insert(readings.astype(float), index, times, axis=1)
    np.savetxt(path, table, "%.9g", ",", header=",".join(names), comments="")


@pytest.mark.parametrize("index", [0, 1104, 5])
def test_all_modules_of_the_hand_come_out(tmp_path, index):
    readings = np.arange(3 * 1104).reshape(3, 1104)
    write(tmp_path / "grasp.csv", readings, index, "Time [s]")
    (recording,) = import_recordings(tmp_path / "grasp.csv")
    allegro = hand("allegro-uskin")
    assert recording.name == "grasp"
    assert recording.metadata["hand"] == "allegro-uskin"
    assert list(recording.modules) == list(allegro.modules)
    for name, want in allegro.split(readings.reshape(3, 368, 3)).items():
        np.testing.assert_array_equal(recording.modules[name].readings, want)
        assert recording.modules[name].sensor == allegro.modules[name].sensor
    assert recording.modules["thumb"].readings.dtype == np.uint16
    assert recording.modules["thumb"].unit == "count"
    np.testing.assert_allclose(recording.modules["thumb"].times, [0, 0.01, 0.02])


def test_numbers_that_are_no_counts_are_newtons(tmp_path):
    write(tmp_path / "a.csv", np.full((2, 1104), 0.5))
    (recording,) = import_recordings(tmp_path, "xela-log")
    assert recording.modules["thumb"].unit == "N"


def test_bad_input_is_named(tmp_path):
    path = tmp_path / "a.csv"
    write(path, np.zeros((2, 360)))
    with pytest.raises(RecordingError, match=r"360 .* 1104 .*allegro-uskin"):
        list(import_recordings(path, "xela-log"))
    write(path, np.zeros((2, 1104)), times=[0.5, 0.25])
    with pytest.raises(RecordingError, match=r"a\.csv: times go back at sample 1"):
        list(import_recordings(path, "xela-log"))
