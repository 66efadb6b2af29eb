"""Folder of a study: report, tables, figures and `study.json`, all written or none."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from holdfast.errors import OutputError
from holdfast.study.report.html_report import Section, html_report
from holdfast.study.report.images import png_of, svg_of
from holdfast.study.report.result_tables import ResultTable, to_csv, to_json
from holdfast.study.report.table_layouts import to_latex, to_markdown

KEPT = ("work", "data")
"""Results of tasks and recordings of the twin in the same folder; they are never replaced."""
SUMMARY = "study.json"
OUTPUTS = ("tables", "figures", "report.html", SUMMARY)
"""What a study writes; the summary comes last and marks a complete study."""


def write_study(
    out: str | Path,
    title: str,
    facts: Mapping[str, object],
    sections: Sequence[Section],
    summary: Mapping[str, Any],
    *,
    force: bool = False,
) -> None:
    """Write `report.html`, `study.json`, and each table and figure; all of them or none.

    The files are first written to a temporary folder. `OUT/work` and `OUT/data` do not change.

    Args:
        out: the folder; it may exist if it holds nothing but `work` and `data`.
        title: of the report.
        facts: how the study was made, for the head of the report.
        sections: of the report.
        summary: contents of `study.json` beside the tables: versions, seed, data.
        force: replace the study in `out`.

    Raises:
        OutputError: as `check_output_folder`, or the folder cannot be written.
        ValueError: two tables or two figures have the same name.
    """
    target = Path(out)
    check_output_folder(target, force=force)
    try:
        target.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".study.", dir=target) as name:
            new, old = Path(name, "new"), Path(name, "old")
            new.mkdir()
            old.mkdir()
            _write_outputs(new, title, facts, sections, summary)
            for output in reversed(OUTPUTS):
                if (target / output).exists():
                    (target / output).rename(old / output)
            for output in OUTPUTS:
                (new / output).rename(target / output)
    except OSError as cause:
        raise OutputError(f"cannot write {target}: {cause.strerror or cause}") from cause


def check_output_folder(out: str | Path, *, force: bool = False) -> None:
    """Check that a study may be written to `out`.

    Raises:
        OutputError: the parent folder does not exist; `out` is a file; it holds a study and
            `force` is not given; or it holds other files and no study.
    """
    target = Path(out)
    if not target.parent.is_dir():
        raise OutputError(f"cannot write {target}: the folder {target.parent} does not exist")
    if target.exists() and not target.is_dir():
        raise OutputError(f"{target} is a file; a study is written to a folder")
    held = _held(target)
    if not held:
        return
    if SUMMARY not in held and held - set(OUTPUTS):
        raise OutputError(
            f"{target} holds other files ({min(held - set(OUTPUTS))}, ...) and no study: "
            "choose a folder that is empty or does not exist"
        )
    if not force:
        raise OutputError(f"{target} already holds a study: choose another name, or give --force")


def _held(target: Path) -> set[str]:
    if not target.is_dir():
        return set()
    names = {path.name for path in target.iterdir()}
    return {name for name in names if name not in KEPT and not name.startswith(".study.")}


def _write_outputs(
    folder: Path,
    title: str,
    facts: Mapping[str, object],
    sections: Sequence[Section],
    summary: Mapping[str, Any],
) -> None:
    (folder / "report.html").write_text(html_report(title, facts, sections), encoding="utf-8")
    (folder / "tables").mkdir()
    (folder / "figures").mkdir()
    tables = [table for section in sections for table in section.tables]
    for table in tables:
        _write_table(folder / "tables", table)
    for section in sections:
        for name, _, figure in section.figures:
            (folder / "figures" / f"{name}.svg").write_text(svg_of(figure, name), encoding="utf-8")
            (folder / "figures" / f"{name}.png").write_bytes(png_of(figure))
    rows = {table.name: to_json(table) for table in tables}
    (folder / SUMMARY).write_bytes(_json({"tables": rows, **summary}))


def _write_table(folder: Path, table: ResultTable) -> None:
    document = {
        "name": table.name,
        "title": table.title,
        "note": table.note,
        "rows": to_json(table),
    }
    (folder / f"{table.name}.json").write_bytes(_json(document))
    (folder / f"{table.name}.csv").write_text(to_csv(table), encoding="utf-8", newline="")
    (folder / f"{table.name}.tex").write_text(to_latex(table), encoding="utf-8")
    (folder / f"{table.name}.md").write_text(to_markdown(table), encoding="utf-8")


def _json(value: object) -> bytes:
    return msgspec.json.format(msgspec.json.encode(value), indent=1) + b"\n"
