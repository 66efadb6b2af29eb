import re

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, Cause
from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.io.importers.columns import Columns
from holdfast.io.proposals import ProposalError
from holdfast.sensors import flat_sensor, sensor

ONE = [f"t{k + 1:02d}_{axis}" for k in range(5) for axis in "xyz"]


def write(path, comments, names, rows):
    lines = [*comments, ",".join(names), *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


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
    with pytest.raises(ProposalError, match="--sensor anyskin"):
        list(import_recordings(tmp_path / "a.csv"))
    given = {"finger1": sensor("anyskin")}
    (recording,) = import_recordings(tmp_path / "a.csv", sensors=given)
    assert recording.modules["finger1"].sensor.name == "anyskin"


MINE, HEAD, ROW = ["# sensor: anyskin"], ["time", *ONE], [1] * 15
BAD = [
    (["# sensor: skin"], HEAD, [0, *ROW], "'skin'"),
    (["# sensor: gtac"], HEAD, [0, *ROW], "finger1: 5 taxels in 15 columns"),
    (MINE, HEAD[:-1], [0, *ROW[1:]], "'t05_z' is missing"),
    (MINE, ["time"], [0], "no columns are named"),
    (MINE, [*HEAD, "label"], [0, *ROW, "fine"], "sample 1: label 'fine'"),
    (MINE, [*HEAD, "label", "cause"], [0, *ROW, "unstable", "wind"], "sample 1: cause 'wind'"),
    (MINE, HEAD, [0, *ROW[1:], "x"], "column 't05_z': 'x' given"),
    ([*MINE, "# unit: kg"], HEAD, [0, *ROW], "'kg'"),
    (MINE, HEAD, ["", *ROW], "a time is not finite"),
]


@pytest.mark.parametrize(("comments", "names", "row", "text"), BAD)
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


def test_a_file_of_another_logger_and_its_proposal(tmp_path):
    """Times whose name has no unit, in steps of 10: all else is said by the names."""
    texts = []
    path = write_other(tmp_path / "a.csv")
    with pytest.raises(ProposalError, match="time=stamp:ms") as caught:
        list(import_recordings(path, sensors=ANY))
    option = caught.value.proposal.columns
    (recording,) = import_recordings(path, sensors=ANY, columns=option, report=texts.append)
    module = recording.modules["finger1"]
    np.testing.assert_allclose(module.times, [0.0, 0.01, 0.02, 0.03])
    np.testing.assert_array_equal(module.readings[2, 4], [14, 15, 16])
    assert module.label_states.tolist() == [STABLE] * 4
    assert "not used: note" in texts[0]
    (again,) = import_recordings(path, sensors=ANY, accept=True)
    assert again.digest == recording.digest


def test_a_cell_that_is_no_number_counts_where_its_column_is_read(tmp_path):
    rows = [*ROWS, ["40", *range(14), "?", "cold", "stable"]]
    path = write_other(tmp_path / "a.csv", rows)
    with pytest.raises(RecordingError, match=r"row 6, column 'Fz4': '\?' given"):
        list(import_recordings(path, sensors=ANY, columns="time=stamp:ms"))
    one = {"*": flat_sensor("one", 1, 1, 0.001)}
    columns = "time=stamp:ms,taxels=Fx0..Fz0"
    assert len(list(import_recordings(path, sensors=one, columns=columns))) == 1


def test_columns_of_two_modules_with_sensors_of_their_own(tmp_path):
    names = [f"{m}_{k}_{a}" for m in ("left", "right") for k in range(5) for a in "xyz"]
    write(tmp_path / "a.csv", [], ["t", *names], [[k / 50, *range(30)] for k in range(3)])
    given = {"left": sensor("anyskin"), "*": sensor("anyskin")}
    (recording,) = import_recordings(tmp_path / "a.csv", sensors=given)
    assert list(recording.modules) == ["left", "right"]
    assert recording.modules["right"].readings[0, 0].tolist() == [15, 16, 17]


def test_a_sensor_whose_z_falls_when_it_is_pressed(tmp_path):
    path = write_other(tmp_path / "a.csv")
    columns = Columns.parse("time=stamp:ms", "1,-2,-3")
    (recording,) = import_recordings(path, sensors=ANY, columns=columns)
    assert recording.modules["finger1"].readings[1, 1].tolist() == [4, -5, -6]


def test_sensors_and_columns_are_for_csv(tmp_path):
    with pytest.raises(ValueError, match="'gtac'"):
        import_recordings(tmp_path, "gtac", sensors=ANY)


def flat(separator=",", time="time"):
    """Header of the flat CSV that many loggers write, of an AnySkin."""
    return separator.join([time, *(f"t{k}_{axis}" for k in range(5) for axis in "xyz")])


def write_flat(path, header, stamps):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [[str(stamp), *(str(k + c) for c in range(15))] for k, stamp in enumerate(stamps)]
    path.write_text("\n".join([header, *(",".join(row) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize("cells", [("0.01", "1,5"), ("0,01", "1.5")])
def test_decimal_commas_beside_decimal_points(tmp_path, cells):
    stamp, value = cells
    rows = ["0;" + ";".join(["1"] * 15), f"{stamp};" + ";".join([value] * 15)]
    (tmp_path / "a.csv").write_text("\n".join([flat(";"), *rows]))
    with pytest.raises(RecordingError, match=r"a\.csv, row 3: .*decimal=comma"):
        list(import_recordings(tmp_path / "a.csv", sensors=ANY))


def test_a_file_that_names_its_sensor_has_times_in_seconds(tmp_path):
    write_flat(tmp_path / "a.csv", f"# sensor: anyskin\n{flat()}", [0, 10, 20])
    (recording,) = import_recordings(tmp_path / "a.csv")
    assert recording.modules["finger1"].times.tolist() == [0, 10, 20]


DOUBT = [
    ("time", [0, 1, 2], "time=100Hz with the true rate if it counts samples"),
    ("t", [0.0, 0.5, 1.0], "--columns time=t:ms"),
    ("time_ms", [0.0, 0.01, 0.02], "--columns time=time_ms:s"),
    ("time_s", [0, 10, 20], "--columns time=time_s:ms"),
    ("t", [0.0, "nan", 0.02], "a.csv: "),
    ("time", [0.0, "", 0.02], "a.csv: "),
]


@pytest.mark.parametrize(("time", "stamps", "text"), DOUBT)
def test_times_that_are_in_doubt(tmp_path, time, stamps, text):
    write_flat(tmp_path / "a.csv", flat(time=time), stamps)
    with pytest.raises(RecordingError, match=re.escape(text)):
        list(import_recordings(tmp_path / "a.csv", sensors=ANY))


@pytest.mark.parametrize("unit", ["s", "ms"])
def test_columns_end_the_doubt(tmp_path, unit):
    write_flat(tmp_path / "a.csv", flat(), [0, 1, 2])
    columns = f"time=time:{unit}"
    (recording,) = import_recordings(tmp_path / "a.csv", sensors=ANY, columns=columns)
    assert recording.modules["finger1"].times[1] == {"s": 1.0, "ms": 1e-3}[unit]


def test_a_folder_of_folders(tmp_path):
    for name in ("grasp10/log.csv", "grasp9/log.csv", ".hidden/log.csv"):
        write_flat(tmp_path / name, flat(), [0.0, 0.01])
    recordings = list(import_recordings(tmp_path, sensors=ANY))
    assert [recording.name for recording in recordings] == ["grasp9_log", "grasp10_log"]
    write_flat(tmp_path / "grasp10" / "log.csv", flat(), [0.0, 0.01]).rename(
        tmp_path / "grasp10" / "other.csv"
    )
    recordings = list(import_recordings(tmp_path, sensors=ANY))
    assert [recording.name for recording in recordings] == ["log", "other"]


def write_numbers(path, header, *more):
    """Write three samples of an AnySkin, with a time unless the header has none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [",".join(map(str, [f"{k / 100:.2f}", *range(k, k + 15), *more])) for k in range(3)]
    path.write_text("\n".join([*([header] if header else []), *rows]) + "\n")


PLAIN = {
    "numbered": ",".join(["time", *(f"s{k}" for k in range(15))]),
    "numbers as names": ",".join(map(str, range(16))),
    "no header": "",
}


@pytest.mark.parametrize("header", PLAIN.values(), ids=PLAIN)
@pytest.mark.parametrize("name", ["a.csv", "b.CSV", "deeper/a.csv"])
def test_names_that_say_nothing_need_the_columns(tmp_path, header, name):
    write_numbers(tmp_path / name, header)
    with pytest.raises(RecordingError, match=r"taxels=2\.\.16") as caught:
        list(import_recordings(tmp_path, sensors=ANY))
    assert not isinstance(caught.value, ProposalError)
    columns = "time=0,taxels=1..15" if header.startswith("0") else "time=1,taxels=2..16"
    (recording,) = import_recordings(tmp_path, sensors=ANY, columns=columns)
    module = recording.modules["finger1"]
    np.testing.assert_allclose(module.times, [0.0, 0.01, 0.02])
    assert module.readings[2].tolist() == np.arange(2, 17).reshape(5, 3).tolist()
