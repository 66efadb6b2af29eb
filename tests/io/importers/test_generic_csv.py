import re

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, Cause
from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.sensors import sensor

ONE = [f"t{k + 1:02d}_{axis}" for k in range(5) for axis in "xyz"]


def write(path, comments, names, rows):
    lines = [*comments, ",".join(names), *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


def test_one_module(tmp_path):
    rows = [[k / 100, *range(k, k + 15)] for k in range(3)]
    write(tmp_path / "a.csv", ["# sensor: anyskin"], ["time", *ONE], rows)
    (recording,) = import_recordings(tmp_path / "a.csv")
    module = recording.modules["finger1"]
    assert (module.sensor.name, module.unit, module.readings.dtype) == ("anyskin", "count", "u2")
    np.testing.assert_array_equal(module.readings[2, 4], [14, 15, 16])


def test_two_modules_with_labels_of_their_own(tmp_path):
    names = [f"{m}.{c.replace('_', '.')}" for m in ("thumb", "index/1") for c in ONE]
    names = ["time", *names, "label", "cause", "thumb.label", "thumb.cause"]
    rows = [
        [0.0, *[0.5] * 30, "stable", "", "", ""],
        [0.01, *[0.5] * 29, "", "Stable", "", "unstable", "slip"],
    ]
    comments = ["# made by hand", "# sensor: thumb=anyskin", "# sensor: index/1=anyskin"]
    write(tmp_path / "a.csv", [*comments, "# unit: index/1=N"], names, rows)
    (recording,) = import_recordings(tmp_path)
    thumb, index = recording.modules["thumb"], recording.modules["index/1"]
    assert (thumb.unit, index.unit) == ("count", "N")
    assert index.label_states.tolist() == [STABLE, STABLE]
    assert thumb.label_states.tolist() == [UNKNOWN, UNSTABLE]
    assert thumb.labels[0].cause is Cause.SLIP
    assert np.isnan(index.readings[1, 4, 2])


def test_the_sensor_can_be_given(tmp_path):
    write(tmp_path / "a.csv", [], ["time", *ONE], [[0, *[1] * 15]])
    with pytest.raises(
        RecordingError, match=r"the sensor of finger1 \(5 taxels\) is missing: --sensor NAME or"
    ):
        list(import_recordings(tmp_path / "a.csv"))
    given = {"finger1": sensor("anyskin")}
    (recording,) = import_recordings(tmp_path / "a.csv", sensors=given)
    assert recording.modules["finger1"].sensor.name == "anyskin"


@pytest.mark.parametrize(
    ("comments", "names", "row", "text"),
    [
        (["# sensor: skin"], ["time", *ONE], [0, *[1] * 15], "unknown sensor 'skin'; built in"),
        (
            ["# sensor: gtac"],
            ["time", *ONE],
            [0, *[1] * 15],
            "finger1: 5 taxels in 15 columns given; 15 taxels x 3 axes from t01 on expected (gtac)",
        ),
        (
            ["# sensor: anyskin"],
            ["time", *ONE[:-1]],
            [0, *[1] * 14],
            "finger1: 5 taxels in 14 columns given; 5 taxels x 3 axes from t01 on expected",
        ),
        (
            ["# sensor: anyskin"],
            ["time", *ONE, "temperature"],
            [0, *[1] * 16],
            "unknown column 'temperature'; 'time', 'MODULE.t01.x'",
        ),
        (
            ["# sensor: anyskin"],
            ["time"],
            [0],
            "no taxel columns such as x1, y1, z1, x2 among 'time'",
        ),
        (
            ["# sensor: anyskin"],
            ["time", *ONE, "label"],
            [0, *[1] * 15, "fine"],
            "row 3: label 'fine' given; no_contact, unstable, stable are known",
        ),
        (
            ["# sensor: anyskin"],
            ["time", *ONE, "label", "cause"],
            [0, *[1] * 15, "unstable", "wind"],
            "row 3: cause 'wind' given; closing, disturbance, slip, lost, released, glitch are "
            "known",
        ),
        (
            ["# sensor: anyskin"],
            ["time", *ONE],
            [0, *[1] * 14, "x"],
            "row 3, column 't05_z': 'x' given, a number expected",
        ),
        (["# sensor: anyskin", "# unit: kg"], ["time", *ONE], [0, *[1] * 15], "'kg' given"),
        (["# sensor: anyskin"], ["time", *ONE], ["", *[1] * 15], "a time is not finite; seconds"),
    ],
)
def test_bad_input_gives_one_line(tmp_path, comments, names, row, text):
    path = tmp_path / "a.csv"
    write(path, comments, names, [row])
    with pytest.raises(RecordingError, match=re.escape(text)) as caught:
        list(import_recordings(path, "csv"))
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


OTHER = [f"F{axis}{k}" for k in range(5) for axis in "xyz"]
ROWS = [[f"{10 * k}", *range(k, k + 15), "cold", "stable"] for k in range(4)]
ANY = {"*": sensor("anyskin")}


def write_other(path, rows=ROWS):
    write(path, [], ["stamp", *OTHER, "note", "label"], rows)
    return path


def test_a_file_of_another_logger_is_guessed_and_reported(tmp_path):
    texts = []
    path = write_other(tmp_path / "a.csv")
    (recording,) = import_recordings(path, sensors=ANY, report=texts.append)
    module = recording.modules["finger1"]
    np.testing.assert_allclose(module.times, [0.0, 0.01, 0.02, 0.03])
    np.testing.assert_array_equal(module.readings[2, 4], [14, 15, 16])
    assert module.label_states.tolist() == [STABLE] * 4
    assert texts == [
        "a.csv: the columns are a guess: 100 Hz, finger1 5 taxels; columns that are not used: note",
        "  the same as --columns 'time=stamp:ms,taxels=F{axis}{taxel},label=label' (give this "
        "option to correct it)",
    ]
    option = texts[1].split("'")[1]
    (again,) = import_recordings(path, sensors=ANY, columns=option, report=pytest.fail)
    assert again.digest == recording.digest


def test_a_guess_is_reported_once_for_equal_files(tmp_path):
    for name in ("a.csv", "b.csv"):
        write_other(tmp_path / name)
    texts = []
    assert len(list(import_recordings(tmp_path, sensors=ANY, report=texts.append))) == 2
    assert len(texts) == 2  # two lines


def test_columns_of_two_modules_with_sensors_of_their_own(tmp_path):
    names = [f"{m}_{k}_{a}" for m in ("left", "right") for k in range(5) for a in "xyz"]
    write(tmp_path / "a.csv", [], ["t", *names], [[k / 50, *range(30)] for k in range(3)])
    given = {"left": sensor("anyskin"), "*": sensor("anyskin")}
    (recording,) = import_recordings(tmp_path / "a.csv", sensors=given)
    assert list(recording.modules) == ["left", "right"]
    assert recording.modules["right"].readings[0, 0].tolist() == [15, 16, 17]


def test_a_sensor_whose_z_falls_when_it_is_pressed(tmp_path):
    path = write_other(tmp_path / "a.csv")
    (recording,) = import_recordings(path, sensors=ANY, columns="signs=+--")
    assert recording.modules["finger1"].readings[1, 1].tolist() == [4, -5, -6]
    with pytest.raises(ValueError, match=r"signs=\+-- or the like expected, '-' given"):
        import_recordings(path, columns="signs=-")


def test_a_file_without_times(tmp_path):
    write(tmp_path / "a.csv", [], OTHER, [list(range(k, k + 15)) for k in range(3)])
    columns = "time=50Hz,taxels=Fx0..Fz4"
    (recording,) = import_recordings(tmp_path / "a.csv", sensors=ANY, columns=columns)
    assert recording.modules["finger1"].times.tolist() == [0.0, 0.02, 0.04]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            {"sensors": {"*": sensor("gtac")}},
            "finger1: 5 taxels in 15 columns given; 15 taxels x 3",
        ),
        ({}, "the sensor of finger1 (5 taxels) is missing"),
        ({"columns": "time=when", "sensors": ANY}, "column 'when' is missing"),
        (
            {"columns": "label=note", "sensors": ANY},
            "a.csv, row 2: label 'cold' given; no_contact,",
        ),
    ],
)
def test_what_other_files_lack(tmp_path, words, text):
    path = write_other(tmp_path / "a.csv")
    with pytest.raises(RecordingError, match=re.escape(text)):
        list(import_recordings(path, **words))


def test_sensors_and_columns_are_for_csv(tmp_path):
    with pytest.raises(
        ValueError, match=r"--sensor and --columns belong to the format csv; 'gtac'"
    ):
        import_recordings(tmp_path, "gtac", sensors=ANY)
