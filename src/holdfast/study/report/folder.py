"""The folder of a study, written whole: report, tables, figures and `study.json`."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from holdfast.errors import OutputError
from holdfast.study.report.html_report import Section, report
from holdfast.study.report.images import png_of, svg_of
from holdfast.study.report.result_tables import ResultTable, to_csv, to_json
from holdfast.study.report.table_layouts import to_latex, to_markdown

KEPT = ("work", "data")
"""Results of tasks, and data that were made, in the same folder: never replaced."""
SUMMARY = "study.json"
PARTS = ("tables", "figures", "report.html", SUMMARY)
"""What a study writes; the summary comes last, and says that it is complete."""


def write_study(
    out: str | Path,
    title: str,
    facts: Mapping[str, object],
    sections: Sequence[Section],
    summary: Mapping[str, Any],
    *,
    force: bool = False,
) -> None:
    """Writes `report.html`, `study.json`, and each table and figure, whole or not at all.

    Everything is made in a folder beside first. `OUT/work` and `OUT/data` are left as they are.

    Args:
        out: the folder; it may exist where it holds nothing but `work` and `data`.
        title: of the report.
        facts: what was run, for the head of the report.
        sections: of the report.
        summary: what `study.json` tells beside the tables: versions, seed, data.
        force: replace a study that is there.

    Raises:
        OutputError: as `check_output_folder`, or the disk refuses.
        ValueError: two tables or two figures have one name.
    """
    target = Path(out)
    check_output_folder(target, force=force)
    try:
        target.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".study.", dir=target) as name:
            made, old = Path(name, "new"), Path(name, "old")
            made.mkdir()
            old.mkdir()
            _write_parts(made, title, facts, sections, summary)
            for part in reversed(PARTS):
                if (target / part).exists():
                    (target / part).rename(old / part)
            for part in PARTS:
                (made / part).rename(target / part)
    except OSError as cause:
        raise OutputError(f"cannot write {target}: {cause.strerror or cause}") from cause


def check_output_folder(out: str | Path, *, force: bool = False) -> None:
    """Does nothing where a study may be written to `out`.

    Raises:
        OutputError: its parent does not exist; it is a file; it holds a study and `force` is
            not given; or it holds other things, which nobody wants replaced.
    """
    target = Path(out)
    if not target.parent.is_dir():
        raise OutputError(f"cannot write {target}: the folder {target.parent} does not exist")
    if target.exists() and not target.is_dir():
        raise OutputError(f"{target} is a file; the study is written to a folder")
    held = _held(target)
    if not held:
        return
    if SUMMARY not in held and held - set(PARTS):
        raise OutputError(
            f"{target} holds other things ({min(held - set(PARTS))}, ...) and no study: "
            "choose a folder of its own"
        )
    if not force:
        raise OutputError(f"{target} holds a study already: choose another name, or give --force")


def _held(target: Path) -> set[str]:
    if not target.is_dir():
        return set()
    names = {path.name for path in target.iterdir()}
    return {name for name in names if name not in KEPT and not name.startswith(".study.")}


def _write_parts(
    folder: Path,
    title: str,
    facts: Mapping[str, object],
    sections: Sequence[Section],
    summary: Mapping[str, Any],
) -> None:
    (folder / "report.html").write_text(report(title, facts, sections), encoding="utf-8")
    (folder / "tables").mkdir()
    (folder / "figures").mkdir()
    every = [table for section in sections for table in section.tables]
    for table in every:
        _write_table(folder / "tables", table)
    for section in sections:
        for name, _, figure in section.figures:
            (folder / "figures" / f"{name}.svg").write_text(svg_of(figure, name), encoding="utf-8")
            (folder / "figures" / f"{name}.png").write_bytes(png_of(figure))
    tables = {table.name: to_json(table) for table in every}
    (folder / SUMMARY).write_bytes(_json({"tables": tables, **summary}))


def _write_table(folder: Path, table: ResultTable) -> None:
    told = {"name": table.name, "title": table.title, "note": table.note, "rows": to_json(table)}
    (folder / f"{table.name}.json").write_bytes(_json(told))
    (folder / f"{table.name}.csv").write_text(to_csv(table), encoding="utf-8", newline="")
    (folder / f"{table.name}.tex").write_text(to_latex(table), encoding="utf-8")
    (folder / f"{table.name}.md").write_text(to_markdown(table), encoding="utf-8")


def _json(value: object) -> bytes:
    return msgspec.json.format(msgspec.json.encode(value), indent=1) + b"\n"
