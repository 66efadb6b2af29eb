"""Tables as labs have them: separators, encodings, times, several sensors and recordings."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.io.importers import generic_csv, table
from holdfast.io.importers.times import clock_seconds
from holdfast.io.importers.table import read_head
from holdfast.sensors import sensor

ANYSKIN = {"*": sensor("anyskin")}
N = 60
TIMES = np.arange(N) / 100
READINGS = np.random.default_rng(1).normal(0, 100, (N, 15)).round(3)
NAMES = [f"B{axis}{taxel} [uT]" for taxel in range(5) for axis in "xyz"]


def rows(separator, mark=".", times=None):
    times = [f"{time:.3f}" for time in TIMES] if times is None else times
    return [
        separator.join([time.replace(".", mark), *(f"{x:.3f}".replace(".", mark) for x in row)])
        for time, row in zip(times, READINGS, strict=True)
    ]


def imported(path, text, encoding="utf-8", **words):
    path.write_bytes(("\r\n".join(text) + "\r\n").encode(encoding))
    return list(import_recordings(path, sensors=ANYSKIN, **words))


def check(recordings, times=TIMES):
    (recording,) = recordings
    (module,) = recording.modules.values()
    np.testing.assert_allclose(module.times - module.times[0], times - times[0], atol=1e-6)
    np.testing.assert_array_equal(module.readings.reshape(N, 15), READINGS)


HEAD = ["Zeit [s]", *NAMES]
DIALECTS = {
    "comma": [",".join(HEAD), *rows(",")],
    "semicolon": [";".join(HEAD), *rows(";", ",")],
    "sep line": ["sep=;", ";".join(HEAD), *rows(";", ",")],
    "tab": ["\t".join(HEAD), *rows("\t")],
    "bar": ["|".join(HEAD), *rows("|")],
    "blanks": ["  ".join(["t", *(name.split()[0] for name in NAMES)]), *rows("   ")],
    "header of numpy": ["# " + ",".join(HEAD), *rows(",")],
    "comma within a name": [";".join([*HEAD[:-1], "Bz4, [uT]"]), *rows(";", ",")],
}


@pytest.mark.parametrize("text", DIALECTS.values(), ids=DIALECTS)
def test_one_table_in_many_dialects(tmp_path, text):
    check(imported(tmp_path / "a.csv", text))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_encodings(tmp_path, encoding):
    text = [line.replace("uT", "\N{MICRO SIGN}T") for line in DIALECTS["semicolon"]]
    check(imported(tmp_path / "a.csv", text, encoding))


@pytest.mark.parametrize("separator", [",", " ", "\t", ";"])
def test_without_a_header_columns_have_numbers(tmp_path, separator):
    text = [
        row.partition(separator)[2] + f"{separator}1921.0{separator}7" for row in rows(separator)
    ]
    check(imported(tmp_path / "skin.txt", text, columns="time=100Hz,taxels=1..15"))
    with pytest.raises(RecordingError, match=r"time=100Hz .* taxels=2\.\.16"):
        imported(tmp_path / "skin.txt", text)


def test_a_run_of_several_modules(tmp_path):
    text = [f"{row},{row.partition(',')[2]}" for row in rows(",")]
    (recording,) = imported(tmp_path / "a.csv", text, columns="time=1,taxels=2..31")
    assert list(recording.modules) == ["finger1", "finger2"]
    first, second = (module.readings for module in recording.modules.values())
    np.testing.assert_array_equal(first, second)


CLOCKS = {
    "clock": [f"23:59:59.{n:03d}" for n in range(700, 1000, 10)]
    + [f"00:00:00.{n:03d}" for n in range(0, 300, 10)],
    "iso": [f"2026-11-21T10:00:00.{n:03d}" for n in range(0, 600, 10)],
    "day": [f"21.11.2026 10:00:00.{n:03d}" for n in range(0, 600, 10)],
    "date": [f"2026-11-21 10:00:00.{n:03d}+01:00" for n in range(0, 600, 10)],
}


@pytest.mark.parametrize("times", CLOCKS.values(), ids=CLOCKS)
def test_times_of_a_clock(tmp_path, times):
    check(imported(tmp_path / "a.csv", [",".join(HEAD), *rows(",", times=times)]))


def test_a_cell_that_is_no_time():
    assert clock_seconds(["0.5"]) is None
    with pytest.raises(RecordingError, match="'12:61'"):
        clock_seconds(["12:00:00", "12:61"])


STAMPS = {
    "stand still": (np.floor(np.arange(N) / 3) * 0.03, r"at sample 1: .* in 68 %.*time=100Hz"),
    "lost digits": (np.full(N, 1.76e9), r"in 100 % of the samples"),
    "set back": (TIMES + 5 - 0.1 * (np.arange(N) > 30), r"at sample 31: 5.21 after 5.3"),
}


@pytest.mark.parametrize(("times", "message"), STAMPS.values(), ids=STAMPS)
def test_stamps_that_do_not_increase_name_what_works(tmp_path, times, message):
    text = [",".join(HEAD), *rows(",", times=[f"{time:.3f}" for time in times])]
    with pytest.raises(RecordingError, match=message):
        imported(tmp_path / "a.csv", text)
    check(imported(tmp_path / "a.csv", text, columns="time=100Hz"))


def test_readings_are_no_times_that_restart(tmp_path):
    """Fifteen readings and a constant: the first column could be that of times, but goes back."""
    text = [row.partition(",")[2] + ",1921.0" for row in rows(",")]
    with pytest.raises(RecordingError, match="'column1': times go back"):
        imported(tmp_path / "skin.txt", text)


@pytest.mark.parametrize("with_column", [False, True])
def test_times_that_restart_are_recordings(tmp_path, with_column):
    times = [f"{time:.3f}" for time in np.tile(np.arange(20) / 100, 3)]
    text = [",".join(HEAD), *rows(",", times=times)]
    names = ["a-1", "a-2", "a-3"]
    if with_column:
        text = [
            text[0] + ",episode_index",
            *(f"{row},{k // 20 + 4}" for k, row in enumerate(text[1:])),
        ]
        names = ["a-4", "a-5", "a-6"]
    recordings = imported(tmp_path / "a.csv", text)
    assert [recording.name for recording in recordings] == names
    for k, recording in enumerate(recordings):
        readings = recording.modules["finger1"].readings.reshape(20, 15)
        np.testing.assert_array_equal(readings, READINGS[20 * k : 20 * k + 20])


def test_rows_of_several_modules(tmp_path):
    head = ["t_ms", "sensor_id", *(f"p{k}_d{a}_mm" for k in range(5) for a in "xyz")]
    head += [f"p{k}_f{a}_N" for k in range(5) for a in "xyz"]
    text = [",".join(head)]
    for k, row in enumerate(READINGS):
        for which in (0, 1):
            cells = ",".join(f"{x:.3f}" for x in row + which)
            text.append(f"{10 * k + which},{which},{cells},{cells}")
    newton = {"*": replace(sensor("anyskin"), unit="N")}
    path = tmp_path / "a.csv"
    path.write_text("\n".join(text) + "\n")
    (recording,) = import_recordings(path, sensors=newton)
    for which, module in enumerate(recording.modules.values()):
        assert module.n_samples == N
        np.testing.assert_allclose(module.readings.reshape(N, 15), READINGS + which, atol=1e-9)
    with pytest.raises(RecordingError, match=r"--columns 'taxels=p"):
        list(import_recordings(path, sensors=ANYSKIN))


def test_a_column_of_episodes_that_is_given_always_counts(tmp_path):
    """Also where the times go on: without it, the file is one recording."""
    text = [",".join([*HEAD, "run"]), *(f"{row},{k // 20}" for k, row in enumerate(rows(",")))]
    assert [one.name for one in imported(tmp_path / "a.csv", text)] == ["a"]
    recordings = imported(tmp_path / "a.csv", text, columns="episode=run")
    assert [recording.name for recording in recordings] == ["a-0", "a-1", "a-2"]
    parts = [one.modules["finger1"].readings.reshape(20, 15) for one in recordings]
    np.testing.assert_array_equal(np.concatenate(parts), READINGS)


@pytest.mark.parametrize("field", ["time", "label", "cause", "module", "episode"])
def test_a_column_that_is_given_must_exist(tmp_path, field):
    with pytest.raises(RecordingError, match="column 'no' is missing"):
        imported(tmp_path / "a.csv", DIALECTS["comma"], columns=f"{field}=no")


FEW_AXES = {
    "in the plane": [f"m{k}_d{axis}" for k in range(20) for axis in "xy"],
    "normal force": [f"fz{k}" for k in range(1, 17)],
    "one number for each taxel": [f"p{k}" for k in range(5)],
    "two numbers for each taxel": [f"s{k}" for k in range(10)],
}


@pytest.mark.parametrize("names", FEW_AXES.values(), ids=FEW_AXES)
def test_data_of_one_or_two_axes_have_an_answer(tmp_path, names):
    text = [",".join(["time", *names]), *(",".join([f"{t}", *["1.5"] * len(names)]) for t in TIMES)]
    with pytest.raises(RecordingError, match="three axes"):
        imported(tmp_path / "a.csv", text)


def test_the_head_of_a_file_is_read_once(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(DIALECTS["comma"]) + "\n")
    heads = []
    for module in (table, generic_csv):
        monkeypatch.setattr(module, "read_head", lambda file: heads.append(file) or read_head(file))
    check(list(generic_csv.read(path, ANYSKIN)))
    assert heads == [path]
