"""Folder of results: report, tables, figures and a summary, all written or none."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from holdfast.errors import OutputError
from holdfast_lab.report.result_tables import to_csv
from holdfast_lab.report.sections import Section, check_names, markdown_report, png_of
from holdfast_lab.report.table_layouts import to_markdown

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
        return ("tables", "figures", *self.others, "report.md", self.summary)


def write_report(
    out: str | Path,
    kind: ReportKind,
    title: str,
    facts: Mapping[str, str],
    sections: Sequence[Section],
    summary: Mapping[str, Any],
    *,
    others: Mapping[str, bytes] | None = None,
    force: bool = False,
) -> None:
    """Write `report.md`, the summary, and each table and figure; all of them or none.

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
    check_names(sections)
    try:
        target.mkdir(exist_ok=True)
        # Inside the target: files are only renamed at the end, which works within one disk.
        with tempfile.TemporaryDirectory(prefix=TEMPORARY, dir=target) as name:
            new, old = Path(name, "new"), Path(name, "old")
            new.mkdir()
            old.mkdir()
            report = markdown_report(title, facts, sections)
            (new / "report.md").write_text(report, "utf-8", newline="")
            document = msgspec.json.format(msgspec.json.encode(summary), indent=1)
            (new / kind.summary).write_bytes(document + b"\n")
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
            # RFC 4180 ends lines by CR LF; without `newline` Windows would write CR CR LF.
            (tables / f"{table.name}.csv").write_text(to_csv(table), encoding="utf-8", newline="")
            (tables / f"{table.name}.md").write_text(to_markdown(table), encoding="utf-8")
        for figure in section.figures:
            (figures / f"{figure.name}.png").write_bytes(png_of(figure.figure))
