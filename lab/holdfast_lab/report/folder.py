"""Folder of results: report, tables, figures and a summary, all written or none."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from holdfast.errors import OutputError
from holdfast_lab.report.html_report import Section, html_report
from holdfast_lab.report.result_tables import to_csv, to_json
from holdfast_lab.report.table_layouts import to_latex, to_markdown

TEMPORARY = ".report."
"""First letters of the name of a temporary folder."""
KEPT = ("work", "data")
"""Results of tasks and recordings of the twin in the same folder; they are never replaced."""


class ReportKind(NamedTuple):
    """Kind of results, whose folders have the same files.

    Attributes:
        noun: what a folder holds, for messages: "study".
        summary: name of the JSON file with the summary; it marks a complete folder.
        others: names of files beside the report, tables, figures and the summary.
    """

    noun: str
    summary: str
    others: tuple[str, ...] = ()

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of all that is written; the summary comes last."""
        return ("tables", "figures", *self.others, "report.html", self.summary)


def write_report(
    out: str | Path,
    kind: ReportKind,
    title: str,
    facts: Mapping[str, object],
    sections: Sequence[Section],
    summary: Mapping[str, Any],
    *,
    others: Mapping[str, bytes] | None = None,
    force: bool = False,
) -> None:
    """Write `report.html`, the summary, and each table and figure; all of them or none.

    The files are first written to a temporary folder. `OUT/work` and `OUT/data` do not change.

    Args:
        out: the folder; it may exist if it holds nothing but `work` and `data`.
        kind: of the results.
        title: of the report.
        facts: how the results were made, for the head of the report.
        sections: of the report.
        summary: contents of the JSON file with the summary.
        others: contents of other files, by their names, which are those of the kind.
        force: replace the results in `out`.

    Raises:
        OutputError: as `check_output_folder`, or the folder cannot be written.
        ValueError: two tables or two figures have the same name.
    """
    target = Path(out)
    check_output_folder(target, kind, force=force)
    try:
        target.mkdir(exist_ok=True)
        # Inside the target: files are only renamed at the end, which works within one disk.
        with tempfile.TemporaryDirectory(prefix=TEMPORARY, dir=target) as name:
            new, old = Path(name, "new"), Path(name, "old")
            new.mkdir()
            old.mkdir()
            (new / "report.html").write_text(html_report(title, facts, sections), "utf-8")
            (new / kind.summary).write_bytes(_json(summary))
            for other, data in (others or {}).items():
                (new / other).write_bytes(data)
            _write_tables_and_figures(new, sections)
            # The summary marks a complete folder: the old one goes first, the new one comes last.
            for output in reversed(kind.outputs):
                if (target / output).exists():
                    (target / output).rename(old / output)
            for output in kind.outputs:
                if (new / output).exists():
                    (new / output).rename(target / output)
    except OSError as cause:
        raise OutputError(f"cannot write {target}: {cause.strerror or cause}") from cause


def check_output_folder(out: str | Path, kind: ReportKind, *, force: bool = False) -> None:
    """Check that results may be written to `out`.

    Raises:
        OutputError: the parent folder does not exist; `out` is a file; it holds such results and
            `force` is not given; or it holds other files and no such results.
    """
    target = Path(out)
    if not target.parent.is_dir():
        raise OutputError(f"cannot write {target}: the folder {target.parent} does not exist")
    if target.exists() and not target.is_dir():
        raise OutputError(f"{target} is a file; a {kind.noun} is written to a folder")
    names = {path.name for path in target.iterdir()} if target.is_dir() else set()
    # A temporary folder is what a run that was killed leaves behind.
    held = {name for name in names if name not in KEPT and not name.startswith(TEMPORARY)}
    if not held:
        return
    others = held - set(kind.outputs)
    if kind.summary not in held and others:
        raise OutputError(
            f"{target} holds other files ({min(others)}, ...) and no {kind.noun}: "
            "choose a folder that is empty or does not exist"
        )
    if not force:
        raise OutputError(
            f"{target} already holds a {kind.noun}: choose another name, or give --force"
        )


def _write_tables_and_figures(folder: Path, sections: Sequence[Section]) -> None:
    tables, figures = folder / "tables", folder / "figures"
    tables.mkdir()
    figures.mkdir()
    for section in sections:
        for table in section.tables:
            document = {
                "name": table.name,
                "title": table.title,
                "note": table.note,
                "rows": to_json(table),
            }
            (tables / f"{table.name}.json").write_bytes(_json(document))
            # RFC 4180 ends lines by CR LF; without `newline` Windows would write CR CR LF.
            (tables / f"{table.name}.csv").write_text(to_csv(table), encoding="utf-8", newline="")
            (tables / f"{table.name}.tex").write_text(to_latex(table), encoding="utf-8")
            (tables / f"{table.name}.md").write_text(to_markdown(table), encoding="utf-8")
        for figure in section.figures:
            for suffix, data in figure.files().items():
                (figures / f"{figure.name}.{suffix}").write_bytes(data)


def _json(value: object) -> bytes:
    return msgspec.json.format(msgspec.json.encode(value), indent=1) + b"\n"
