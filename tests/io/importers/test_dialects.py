"""Tables as labs have them: separators, encodings, times, several sensors and recordings."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.io.importers import generic_csv, table
from holdfast.io.importers.table import read_head
from holdfast.io.proposals import ProposalError
from holdfast.sensors import flat_sensor, sensor

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
    return list(import_recordings(path, **{"sensors": ANYSKIN} | words))


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
    with pytest.raises(RecordingError, match=r"taxels=2\.\.16; time=100Hz"):
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


STAMPS = {
    "stand still": (np.floor(np.arange(N) / 3) * 0.03, "stand still at sample 1, in 68 %"),
    "set back": (TIMES + 5 - 0.1 * (np.arange(N) > 30), "go back at sample 31"),
}


@pytest.mark.parametrize(("times", "message"), STAMPS.values(), ids=STAMPS)
def test_stamps_that_do_not_increase_are_a_rate_in_the_proposal(tmp_path, times, message):
    text = [",".join(HEAD), *rows(",", times=[f"{time:.3f}" for time in times])]
    with pytest.raises(ProposalError, match=message):
        imported(tmp_path / "a.csv", text)
    check(imported(tmp_path / "a.csv", text, accept=True))
    check(imported(tmp_path / "a.csv", text, columns="time=100Hz"))


def test_a_row_for_each_taxel_is_no_fast_sensor(tmp_path):
    pairs = itertools.product(range(N), "ab")
    text = ["time,taxel,x,y,z", *(f"{k / 100:.2f},{taxel},1,2,3" for k, taxel in pairs)]
    with pytest.raises(RecordingError, match=r"a row for each taxel at each of the times"):
        imported(tmp_path / "a.csv", text)


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
    head += [f"p{k}_f{a}_mN" for k in range(5) for a in "xyz"]
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
        np.testing.assert_allclose(module.readings.reshape(N, 15), (READINGS + which) / 1000)
    with pytest.raises(RecordingError, match="readings in mN given; count, uT, mT expected"):
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


def test_a_last_line_that_is_cut_is_left_out_and_said(tmp_path):
    texts = []
    check(imported(tmp_path / "a.csv", [*DIALECTS["comma"], "0.6,1.5"], report=texts.append))
    assert "the last row" in texts[0]
    with pytest.raises(RecordingError, match="row 62: 2 cells given, 16 expected"):
        imported(tmp_path / "a.csv", [*DIALECTS["comma"], "0.6,1.5", DIALECTS["comma"][-1]])


def test_other_columns_that_fit_are_asked(tmp_path):
    head = ["t", *(f"{q}{a}{k}" for q in ("d", "f") for k in range(5) for a in "xyz")]
    text = [",".join(head), *(f"{row},{row.partition(',')[2]}" for row in rows(","))]
    with pytest.raises(ProposalError, match=r"fx0\.\.fz4"):
        imported(tmp_path / "a.csv", text)
    check(imported(tmp_path / "a.csv", text, columns="taxels=fx0..fz4"))


def test_of_force_and_torque_of_each_finger_the_force_is_read(tmp_path):
    head = ["t", *(f"{name}_{q}{a}" for name in ("thumb", "index") for q in "FT" for a in "xyz")]
    text = [",".join(head), *(line.rsplit(",", 3)[0] for line in rows(","))]
    (recording,) = imported(tmp_path / "a.csv", text, sensors={"*": flat_sensor("a", 1, 1, 1e-3)})
    for name, first in (("thumb", 0), ("index", 6)):
        readings = recording.modules[name].readings
        np.testing.assert_array_equal(readings[:, 0], READINGS[:, first : first + 3])


def test_the_head_of_a_file_is_read_twice_at_most(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(DIALECTS["comma"]) + "\n")
    heads = []
    monkeypatch.setattr(table, "read_head", lambda file: heads.append(file) or read_head(file))
    check(list(generic_csv.read(path, ANYSKIN)))
    assert heads == [path] * 2
