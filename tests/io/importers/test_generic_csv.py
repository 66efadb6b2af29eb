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
        RecordingError, match=r"the sensor of finger1 is missing: a line '# sensor: finger"
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
        (["# sensor: anyskin"], ["t", *ONE], [0, *[1] * 15], "unknown column 't'; 'time', 'MOD"),
        (["# sensor: anyskin"], ["time"], [0], "no taxel columns such as 'thumb.t01.x'"),
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
