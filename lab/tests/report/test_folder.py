import json

import pytest
from holdfast_lab.report.html_report import ReportFigure, Section

from holdfast.errors import OutputError
from holdfast_lab.report.folder import ReportKind, check_output_folder, write_report

from .test_html_report import drawn, sections

pytestmark = pytest.mark.slow

STUDY = ReportKind("study", "study.json", ("extra.bin",))


def write(out, **options):
    write_report(out, STUDY, "Study", {"seed": 0}, sections(), {"seed": 0}, **options)


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_files_of_the_folder(tmp_path):
    out = tmp_path / "out"
    write(out)
    assert files(out) == [
        "figures/curve-2.png",
        "figures/curve-2.svg",
        "figures/curve.png",
        "figures/curve.svg",
        "report.html",
        "study.json",
        *(
            f"tables/{name}.{kind}"
            for name in ("first", "second")
            for kind in ("csv", "json", "md", "tex")
        ),
    ]
    assert json.loads((out / "study.json").read_text()) == {"seed": 0}
    assert json.loads((out / "tables/first.json").read_text())["rows"][0] == {
        "m": "a", "figure": "x", "ours": 1.0, "paper": 2.0, "difference": -1.0, "n": None,
        "interval": None,
    }  # fmt: skip
    assert (out / "figures/curve.png").read_bytes()[:4] == b"\x89PNG"
    assert (out / "figures/curve.svg").read_text().startswith("<?xml")


def test_stored_results_of_a_stopped_study_stay(tmp_path):
    (tmp_path / "out/work").mkdir(parents=True)
    (tmp_path / "out/work/a.msgpack").write_bytes(b"x")
    check_output_folder(tmp_path / "out", STUDY)
    write(tmp_path / "out")
    assert (tmp_path / "out/work/a.msgpack").read_bytes() == b"x"


def test_a_study_is_only_replaced_by_force(tmp_path):
    out = tmp_path / "out"
    write(out)
    (out / "tables/old.csv").touch()
    (out / "notes.txt").write_text("mine")
    with pytest.raises(
        OutputError, match=r"already holds a study: choose another name, or give --force$"
    ):
        write(out)
    write(out, force=True)
    assert "tables/old.csv" not in files(out) and "notes.txt" in files(out)


def test_other_files_of_a_kind_are_replaced_too(tmp_path):
    out = tmp_path / "out"
    write(out, others={"extra.bin": b"x"})
    assert (out / "extra.bin").read_bytes() == b"x"
    write(out, force=True)
    assert "extra.bin" not in files(out)


def test_a_folder_of_other_files_is_not_changed(tmp_path):
    (tmp_path / "notes.txt").touch()
    message = (
        r"holds other files \(notes.txt, ...\) and no study: "
        "choose a folder that is empty or does not exist$"
    )
    with pytest.raises(OutputError, match=message):
        write(tmp_path, force=True)
    with pytest.raises(OutputError, match=r"is a file; a study is written to a folder$"):
        check_output_folder(tmp_path / "notes.txt", STUDY, force=True)
    with pytest.raises(OutputError, match=r"no does not exist$"):
        check_output_folder(tmp_path / "no/out", STUDY)


def test_a_failed_write_changes_nothing(tmp_path):
    out = tmp_path / "out"
    write(out)
    before = {name: (out / name).read_bytes() for name in files(out)}
    broken = [Section("x", "", [], [ReportFigure("a b", "", drawn())])]
    with pytest.raises(ValueError, match="figure's name"):
        write_report(out, STUDY, "Other", {}, broken, {}, force=True)
    assert {name: (out / name).read_bytes() for name in files(out)} == before
