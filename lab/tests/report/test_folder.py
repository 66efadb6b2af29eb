import json

import pytest
from matplotlib.figure import Figure

from holdfast.errors import OutputError
from holdfast_lab.report.folder import ReportKind, check_output_folder, write_report
from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.report.sections import ReportFigure, Section

pytestmark = pytest.mark.slow

STUDY = ReportKind("study", "study.json", ("extra.bin",))


def drawn():
    figure = Figure(figsize=(1, 1))
    figure.subplots().plot([1, 2])
    return figure


def table(name):
    return ResultTable(name, name, "", [Row({"m": "a", "figure": "x"}, 1.0, 2.0)], ("m",))


SECTIONS = [
    Section("One", "A text.", [table("first")], [ReportFigure("curve", "A <curve>.", drawn())]),
    Section("Two", "", [table("second")], [ReportFigure("curve-2", "", drawn())]),
]


def write(out, **options):
    write_report(out, STUDY, "Study", {"seed": "0"}, SECTIONS, {"seed": 0}, **options)


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_files_of_the_folder(tmp_path):
    out = tmp_path / "out"
    write(out)
    assert files(out) == [
        "figures/curve-2.png",
        "figures/curve.png",
        "report.md",
        "study.json",
        *(f"tables/{name}.{kind}" for name in ("first", "second") for kind in ("csv", "md")),
    ]
    assert json.loads((out / "study.json").read_text()) == {"seed": 0}
    assert (out / "figures/curve.png").read_bytes()[:4] == b"\x89PNG"
    assert "![curve](figures/curve.png)\n\nA \\<curve\\>.\n" in (out / "report.md").read_text()


def test_a_study_is_only_replaced_by_force(tmp_path):
    out = tmp_path / "out"
    write(out)
    (out / "tables/old.csv").touch()
    (out / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="--force"):
        write(out)
    write(out, force=True)
    assert "tables/old.csv" not in files(out) and "notes.txt" in files(out)


def test_a_folder_of_other_files_is_not_changed(tmp_path):
    (tmp_path / "notes.txt").touch()
    with pytest.raises(OutputError, match=r"notes\.txt"):
        write(tmp_path, force=True)
    with pytest.raises(OutputError, match=r"notes\.txt"):
        check_output_folder(tmp_path / "notes.txt", STUDY, force=True)
    with pytest.raises(OutputError, match="no "):
        check_output_folder(tmp_path / "no/out", STUDY)


def test_a_failed_write_changes_nothing(tmp_path):
    out = tmp_path / "out"
    write(out)
    before = {name: (out / name).read_bytes() for name in files(out)}
    broken = [Section("x", "", [], [ReportFigure("a b", "", drawn())])]
    with pytest.raises(ValueError, match="figure's name"):
        write_report(out, STUDY, "Other", {}, broken, {}, force=True)
    assert {name: (out / name).read_bytes() for name in files(out)} == before
