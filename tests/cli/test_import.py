import json

import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.cli.csv_options import CsvOptions
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
    assert (
        FormatOptions(no_limit=no_limit).task(tmp_path, CsvOptions(), force=False).limited
        is not no_limit
    )


def test_imports_a_file(capsys, table, tmp_path):
    document = imported(capsys, table(), tmp_path / "a" / "b")
    path = tmp_path / "a" / "b" / "press.parquet"
    (recording,) = document.pop("recordings")
    assert document == {
        "out": str(path.parent), "n_recordings": 1, "n_modules": 1, "n_samples": 40,
        "hint": HINTS["csv"],
    }  # fmt: skip
    assert recording == {
        "name": "press", "path": str(path), "modules": {"finger1": 40}, "n_samples": 40,
        "duration": pytest.approx(0.39), "n_labels": 1, "complete": True,
    }  # fmt: skip
    assert list(path.parent.iterdir()) == [path]
    assert load_recording(path).modules["finger1"].n_samples == 40


def test_every_format_has_a_hint():
    assert list(HINTS) == list(FORMATS)
    hints = [import_hint(name) for name in (*FORMATS, *IMPORTER_PLUGINS.names())]
    assert all(hint and "\n" not in hint for hint in hints)


def test_the_table(capsys, table, tmp_path):
    table("one.csv")
    table("two.csv", n=30)
    assert main(["import", str(tmp_path / "in"), str(tmp_path / "out"), "--format", "csv"]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["one", "1", "40", "0.39", "1"] in rows and ["two", "1", "30", "0.29", "1"] in rows


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
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    code, out, err = VERB.run(capsys, cut, tmp_path / "out", "--json")
    assert (code, err.count("\n"), str(cut) in err) == (0, 1, True)
    (document,) = json.loads(out)["recordings"]
    assert (document["name"], document["complete"]) == ("cut", False)
    assert load_recording(tmp_path / "out" / "cut.parquet").modules["thumb"].n_samples > 0


class TestOutputs:
    def test_nothing_is_overwritten(self, capsys, table, tmp_path):
        out = tmp_path / "out"
        out.mkdir()
        (out / "two.parquet").write_text("mine")
        table("one.csv")
        table("two.csv")
        assert "two.parquet exists already" in refusal(capsys, tmp_path / "in", out)
        assert [path.name for path in out.iterdir()] == ["two.parquet"]
        assert (out / "two.parquet").read_text() == "mine"
        imported(capsys, tmp_path / "in", out, "--force")
        assert load_recording(out / "two.parquet").name == "two"

    def test_all_or_none(self, capsys, table, tmp_path):
        table("a.csv")
        bad = table("b.csv", extra="\n1,2,3\n1,2,3")
        assert str(bad) in refusal(capsys, tmp_path / "in", tmp_path / "x" / "out")
        assert not (tmp_path / "x").exists()

    def test_two_of_one_name(self, capsys, grasp, tmp_path):
        for stem in "ab":
            save_recording(grasp, tmp_path / f"{stem}.parquet")
        assert "'grasp'" in refusal(capsys, tmp_path, tmp_path / "out")


class TestASensorOfOnesOwn:
    @pytest.fixture
    def press(self, tmp_path):
        """A folder with two files of another logger, in which two axes never change."""
        names = [f"F{axis}{k}" for k in range(9) for axis in "xyz"]
        rows = [[10 * k, *(7 if c % 3 < 2 else k + c for c in range(27))] for k in range(30)]
        text = "\n".join(",".join(map(str, row)) for row in [["timestamp", *names], *rows])
        (tmp_path / "in").mkdir()
        for name in "ab":
            (tmp_path / "in" / f"{name}.csv").write_text(f"{text}\n")
        return tmp_path / "in"

    @pytest.fixture
    def grid(self, capsys, tmp_path):
        assert main(["sensors", "--template", "3x3", "--pitch", "4.7"]) == 0
        (tmp_path / "sensor.json").write_text(capsys.readouterr().out)
        return tmp_path / "sensor.json"

    def test_from_a_file_to_a_recording(self, capsys, press, grid, tmp_path):
        code, _, err = VERB.run(capsys, press, tmp_path / "out", "--sensor", grid)
        assert code == 2
        assert "--columns time=timestamp:ms" in err
        assert not (tmp_path / "out").exists()
        code, _, err = VERB.run(capsys, press, tmp_path / "out", "--sensor", grid, "--accept")
        assert code == 0
        # Findings are reported once.
        assert sum("(and 1 more)" in line for line in err.splitlines()) == 2
        module = load_recording(tmp_path / "out" / "a.parquet").modules["finger1"]
        assert (module.sensor.name, module.rate) == ("grid-3x3", pytest.approx(100.0))

    def test_a_sensor_by_module_and_columns(self, capsys, press, grid, tmp_path):
        columns = "time=timestamp:ms,taxels=Fx0..Fz8"
        words = ["--sensor", f"finger1={grid}", "--columns", columns]
        imported(capsys, press / "a.csv", tmp_path / "out", *words)
        assert (tmp_path / "out" / "a.parquet").exists()

    def test_a_plain_pad_needs_no_file(self, capsys, press, tmp_path):
        words = ["--sensor", "3x3", "--unit", "mN", "--columns", "time=timestamp:ms"]
        imported(capsys, press / "a.csv", tmp_path / "out", *words)
        module = load_recording(tmp_path / "out" / "a.parquet").modules["finger1"]
        assert (module.sensor.n_taxels, module.unit) == (9, "N")
        assert module.readings[1, 0, 2] == pytest.approx(0.003)
        assert "--unit" in refusal(capsys, press / "a.csv", tmp_path / "x", "--sensor", "3x3")
