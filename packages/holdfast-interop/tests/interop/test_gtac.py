import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings

NAMED = [f"mag_{axis}{node + 1}" for node in range(15) for axis in "xyz"]


def write(path, names, rows):
    path.write_text("\n".join([",".join(names), *(",".join(map(str, r)) for r in rows)]) + "\n")


def rows(n, n_extra=2, milliseconds=None):
    stamps = [7 * k for k in range(n)] if milliseconds is None else milliseconds
    return [
        [k, *range(-10 + k, 35 + k), *([0] * n_extra), 150, stamp] for k, stamp in enumerate(stamps)
    ]


def test_named_columns(tmp_path):
    write(tmp_path / "egg.csv", ["", *NAMED, "mat1", "mat2", "Hz", "milliseconds"], rows(3))
    (recording,) = import_recordings(tmp_path / "egg.csv")
    module = recording.modules["finger1"]
    assert (recording.name, module.sensor.name) == ("egg", "gtac")
    np.testing.assert_allclose(module.times, [0, 0.007, 0.014])
    assert module.readings.dtype == np.int32
    assert module.readings[0, 1].tolist() == [-7, 6, 5]


def test_numbered_columns_and_a_first_row_without_time(tmp_path):
    names = ["", *map(str, range(49))]
    write(tmp_path / "roll.csv", names, rows(3, milliseconds=["", 4.0, 12.0]))
    (recording,) = import_recordings(tmp_path)
    module = recording.modules["finger1"]
    np.testing.assert_allclose(module.times, [0.004, 0.012])
    assert module.readings[0, 0].tolist() == [-9, 8, 7]
    assert recording.metadata["rows_without_time"] == 1


@pytest.mark.parametrize(
    ("stamps", "text"),
    [
        ([0, "", 14], r"a\.csv, row 3: no time"),
        ([0, 990, 5], r"a\.csv: times go back at sample 2"),
    ],
)
def test_bad_times(tmp_path, stamps, text):
    names = ["", *map(str, range(49))]
    write(tmp_path / "a.csv", names, rows(3, milliseconds=stamps))
    with pytest.raises(RecordingError, match=text):
        list(import_recordings(tmp_path / "a.csv", "gtac"))


GRIPPER2 = ["", *NAMED, "servo_f1", "servo_b1", "Hz", "milliseconds"]


def rows_of_gripper2(n, rate=157):
    return [[k, *range(-10 + k, 35 + k), k // 2, 79, rate, 1] for k in range(n)]


def test_the_second_gripper_has_a_rate_in_place_of_times(tmp_path):
    write(tmp_path / "Apple_4.csv", GRIPPER2, rows_of_gripper2(4))
    (recording,) = import_recordings(tmp_path)
    np.testing.assert_allclose(recording.modules["finger1"].times, np.arange(4) / 157)
    assert recording.modules["finger1"].readings[0, 1].tolist() == [-7, 6, 5]
    assert recording.metadata["clock"] == "none; 157 Hz by its column Hz"
    assert recording.metadata["source"] == "roobooot/GTac_Gripper_V2"
    servos = recording.truth.hand["servo_positions"]
    assert servos.tolist() == [[0, 79], [0, 79], [1, 79], [1, 79]]


@pytest.mark.parametrize("rate", [0, -157, "", "nan", "inf"])
def test_a_second_gripper_without_a_rate(tmp_path, rate):
    table = rows_of_gripper2(4)
    table[2][-2] = rate
    write(tmp_path / "a.csv", GRIPPER2, table)
    with pytest.raises(RecordingError, match=r"a\.csv, row 4, column 'Hz'"):
        list(import_recordings(tmp_path))


def test_the_real_recordings_of_the_second_gripper(data_folder):
    recordings = list(import_recordings(data_folder / "gtac_v2"))
    assert len(recordings) == 21
    for recording in recordings:
        assert recording.modules["finger1"].rate == pytest.approx(157.5, abs=0.6)
        moves = np.diff(recording.truth.hand["servo_positions"], axis=0).any(axis=1)
        assert 0 < np.flatnonzero(moves)[-1] < 0.7 * len(moves)


def test_the_real_recordings(data_folder):
    recordings = list(import_recordings(data_folder / "gtac"))
    assert [r.modules["finger1"].n_samples for r in recordings] == [2990, 2999, 2999]
    assert [r.metadata["rows_without_time"] for r in recordings] == [0, 1, 1]
    for recording in recordings:
        module = recording.modules["finger1"]
        assert recording.duration == pytest.approx(20, abs=2)
        assert module.readings[:5].any() or module.readings.any()
