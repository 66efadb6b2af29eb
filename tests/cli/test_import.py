import json
import os
import re
from dataclasses import replace

import numpy as np
import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.cli.import_ import FormatOptions
from holdfast.io import load_recording, save_recording
from holdfast.io.importers import FORMATS, HINTS, IMPORTER_PLUGINS, import_hint
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow

HEADER = "# sensor: anyskin\ntime," + ",".join(
    f"t{taxel:02d}_{axis}" for taxel in range(1, 6) for axis in "xyz"
)


@pytest.fixture(scope="module")
def grasp():
    return synthetic_recording("grasp", 1, ("thumb", "index"))


@pytest.fixture
def table(tmp_path):
    """Return a function that writes a CSV file of an AnySkin, labelled stable."""

    def write(name="press.csv", n=40, extra=""):
        rows = [
            ",".join([f"{k / 100:.2f}", *(str(100 + k + c) for c in range(15)), "stable"])
            for k in range(n)
        ]
        path = tmp_path / "in" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("\n".join([f"{HEADER},label", *rows]) + extra + "\n")
        return path

    return write


VERB = Verb("import")
refusal, imported = VERB.refusal, VERB.document


@pytest.mark.parametrize("no_limit", [False, True])
def test_no_limit_reaches_the_reader(tmp_path, no_limit):
    assert FormatOptions(no_limit=no_limit).task(tmp_path, force=False).limited is not no_limit


def test_imports_a_file(capsys, table, tmp_path):
    document = imported(capsys, table(), tmp_path / "a" / "b")
    path = tmp_path / "a" / "b" / "press.parquet"
    assert document == {
        "out": str(path.parent),
        "n_recordings": 1,
        "n_modules": 1,
        "n_samples": 40,
        "recordings": [
            {
                "name": "press",
                "path": str(path),
                "modules": {"finger1": 40},
                "n_samples": 40,
                "duration": pytest.approx(0.39),
                "n_labels": 1,
                "complete": True,
            }
        ],
        "hint": HINTS["csv"],
    }
    assert list(path.parent.iterdir()) == [path]
    assert load_recording(path).modules["finger1"].n_samples == 40


def test_every_format_has_a_hint():
    assert list(HINTS) == list(FORMATS)
    hints = [import_hint(name) for name in (*FORMATS, *IMPORTER_PLUGINS.names())]
    assert all("--in-contact" in hint and "\n" not in hint for hint in hints)


def test_the_table(capsys, table, tmp_path):
    table("one.csv")
    table("two.csv", n=30)
    assert main(["import", str(tmp_path / "in"), str(tmp_path / "out"), "--format", "csv"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^one +1 +40 +0.39 +1$", out, re.MULTILINE)
    assert out.endswith(f"2 recordings with 2 modules and 70 samples in {tmp_path / 'out'}\n")


def test_without_labels_and_as_mcap(capsys, table, tmp_path):
    imported(capsys, table(), tmp_path / "out", "--no-labels", "--suffix", "mcap")
    assert load_recording(tmp_path / "out" / "press.mcap").modules["finger1"].labels == ()


def test_own_recordings_are_imported(capsys, grasp, tmp_path):
    save_recording(grasp, tmp_path / "grasp.mcap")
    imported(capsys, tmp_path / "grasp.mcap", tmp_path / "out", "--no-labels")
    got = load_recording(tmp_path / "out" / "grasp.parquet")
    assert got.digest == grasp.digest
    assert got.modules["thumb"].labels == ()
    imported(capsys, tmp_path, tmp_path / "again")
    assert load_recording(tmp_path / "again" / "grasp.parquet").modules["thumb"].labels


def test_a_cut_file_is_recovered(capsys, grasp, tmp_path):
    whole, cut = tmp_path / "grasp.mcap", tmp_path / "cut.mcap"
    save_recording(grasp, whole)
    data = whole.read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    assert main(["import", str(cut), str(tmp_path / "out"), "--json"]) == 0
    out, err = capsys.readouterr()
    assert re.fullmatch(rf"{re.escape(str(cut))} is cut off: \d+\.\d\d s recovered\n", err)
    (document,) = json.loads(out)["recordings"]
    assert (document["name"], document["complete"]) == ("cut", False)
    got = load_recording(tmp_path / "out" / "cut.parquet")
    assert not got.complete
    n = got.modules["thumb"].n_samples
    assert 0 < n < grasp.modules["thumb"].n_samples
    assert np.array_equal(got.modules["thumb"].readings, grasp.modules["thumb"].readings[:n])


class TestOutputs:
    def test_nothing_is_overwritten(self, capsys, table, tmp_path):
        out = tmp_path / "out"
        out.mkdir()
        (out / "two.parquet").write_text("mine")
        table("one.csv")
        table("two.csv")
        assert refusal(capsys, tmp_path / "in", out) == (
            f"{out / 'two.parquet'} exists already: choose another name, or give --force"
        )
        assert [path.name for path in out.iterdir()] == ["two.parquet"]
        assert (out / "two.parquet").read_text() == "mine"
        imported(capsys, tmp_path / "in", out, "--force")
        assert load_recording(out / "two.parquet").name == "two"

    def test_all_or_none(self, capsys, table, tmp_path):
        table("a.csv")
        bad = table("b.csv", extra="\n1,2,3")
        text = refusal(capsys, tmp_path / "in", tmp_path / "x" / "out")
        assert str(bad) in text
        assert not (tmp_path / "x").exists()

    def test_a_full_disk_names_the_file(self, capsys, table, tmp_path, monkeypatch):
        def full(*_, **__):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("holdfast.io.parquet.write_checksum", full)
        out = tmp_path / "out"
        assert refusal(capsys, table(), out) == (
            f"cannot write {out / 'press.parquet'}: No space left on device"
        )
        assert not out.exists()

    def test_out_is_a_file(self, capsys, table, tmp_path):
        out = tmp_path / "out"
        out.write_text("mine")
        assert refusal(capsys, table(), out) == f"{out}: is a file; a folder expected"
        assert refusal(capsys, table(), out / "deeper") == (
            f"cannot write to {out / 'deeper'}: Not a directory"
        )

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
    def test_out_is_read_only(self, capsys, table, tmp_path):
        out = tmp_path / "out"
        out.mkdir(mode=0o500)
        assert refusal(capsys, table(), out) == f"cannot write to {out}: Permission denied"

    def test_a_name_with_a_path(self, capsys, grasp, tmp_path):
        save_recording(replace(grasp, name="../up"), tmp_path / "a.parquet")
        assert main(["import", str(tmp_path / "a.parquet"), str(tmp_path / "out")]) == 0
        assert sorted(path.name for path in tmp_path.iterdir()) == ["a.parquet", "out"]
        (written,) = (tmp_path / "out").iterdir()
        assert load_recording(written).name == "../up"

    def test_two_of_one_name(self, capsys, grasp, tmp_path):
        for stem in "ab":
            save_recording(grasp, tmp_path / f"{stem}.parquet")
        assert refusal(capsys, tmp_path, tmp_path / "out") == (
            "two recordings have the name 'grasp': import them one by one"
        )


def test_refusals(capsys, table, tmp_path):
    out = tmp_path / "out"
    formats = f"{', '.join(FORMATS)}{IMPORTER_PLUGINS.text()}"
    missing, empty, text = tmp_path / "none", tmp_path / "empty", tmp_path / "notes.txt"
    empty.mkdir()
    text.write_text("hello")
    assert refusal(capsys, missing, out) == (
        f"{missing} does not exist; a file or folder to import expected"
    )
    for path in (empty, text):
        assert refusal(capsys, path, out) == (
            f"{path} is of no supported format; there are {formats} (--format); "
            "for a table or arrays of any other logger give --sensor"
        )
    assert refusal(capsys, text, out, "--format", "bag") == (
        f"unknown format 'bag'; there are {formats}"
    )
    assert "'bag' is not one of 'parquet', 'mcap'" in refusal(capsys, text, out, "--suffix", "bag")
    cut = tmp_path / "cut.parquet"
    cut.write_bytes(b"PAR1" + bytes(100))
    assert refusal(capsys, cut, out) == (
        f"{cut} is cut or damaged: 104 bytes without the end of a Parquet file, "
        "from which nothing can be recovered"
    )
    assert not out.exists()


def test_real_uskin(capsys, data_folder, tmp_path):
    document = imported(
        capsys, data_folder / "uskin_pick_move", tmp_path, "--format", "uskin-pick-move"
    )
    assert (document["n_recordings"], document["n_modules"], document["n_samples"]) == (5, 10, 3272)


class TestASensorOfOnesOwn:
    @pytest.fixture
    def press(self, tmp_path):
        names = [f"F{axis}{k}" for k in range(9) for axis in "xyz"]
        rows = [[str(10 * k), *(str(k + c) for c in range(27))] for k in range(30)]
        path = tmp_path / "press.csv"
        path.write_text("\n".join(map(",".join, [["timestamp", *names], *rows])) + "\n")
        return path

    @pytest.fixture
    def grid(self, capsys, tmp_path):
        assert main(["sensors", "--template", "3x3", "--pitch", "4.7"]) == 0
        (tmp_path / "sensor.json").write_text(capsys.readouterr().out)
        return tmp_path / "sensor.json"

    def test_from_a_file_to_a_recording(self, capsys, press, grid, tmp_path):
        assert main(["import", str(press), str(tmp_path / "out"), "--sensor", str(grid)]) == 0
        err = capsys.readouterr().err
        assert "the same as --columns 'time=timestamp:ms,taxels=F{axis}{taxel}'" in err
        module = load_recording(tmp_path / "out" / "press.parquet").modules["finger1"]
        assert (module.sensor.name, module.rate) == ("grid-3x3", pytest.approx(100.0))

    def test_a_sensor_by_module_and_columns(self, press, grid, tmp_path):
        words = ["--sensor", f"finger1={grid}", "--columns", "time=timestamp,taxels=F{axis}{taxel}"]
        assert main(["import", str(press), str(tmp_path / "out"), *words]) == 0
        assert (tmp_path / "out" / "press.parquet").exists()

    def test_findings_are_reported_once(self, capsys, press, grid, tmp_path):
        for name in ("a.csv", "b.csv"):
            lines = press.read_text().splitlines()
            rows = [line.split(",") for line in lines[1:]]
            still = [",".join([row[0], *("7" if k % 3 < 2 else v for k, v in enumerate(row[1:]))])
                     for row in rows]  # fmt: skip
            (tmp_path / "in").mkdir(exist_ok=True)
            (tmp_path / "in" / name).write_text("\n".join([lines[0], *still]) + "\n")
        words = [str(tmp_path / "in"), str(tmp_path / "out"), "--sensor", str(grid)]
        assert main(["import", *words]) == 0
        err = capsys.readouterr().err.splitlines()
        assert err[2:] == [
            "a (and 1 more): finger1: readings along x and y never change; 3 axes are expected",
            "a (and 1 more): no finger is in contact in the whole recording",
            f"hint: {HINTS['csv']}",
        ]

    def test_without_a_sensor(self, capsys, press, tmp_path):
        assert main(["import", str(press), str(tmp_path / "out")]) == 2
        err = capsys.readouterr().err
        assert "the sensor of finger1 (9 taxels) is missing: --sensor NAME or --sensor FILE" in err
        assert not (tmp_path / "out").exists()

    @pytest.mark.parametrize(
        ("words", "text"),
        [
            (("--sensor", "skin"), "unknown sensor 'skin'; built in are uskin-curved, uskin-4x4"),
            (("--sensor", "gtac", "--sensor", "gtac"), "--sensor: two sensors given for all mod"),
            (("--sensor", "none.json"), "none.json: No such file or directory"),
            (("--columns", "F"), "--columns: time=COLUMN, taxels=COLUMN, signs=COLUMN"),
        ],
    )
    def test_wrong_options(self, capsys, press, tmp_path, words, text):
        assert refusal(capsys, press, tmp_path / "out", *words).startswith(text)
