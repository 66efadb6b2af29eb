"""Publish a comparison of grip laws in docs/study/, and write the page that quotes it.

    python benchmarks/publish_trial.py publish TRIALS
    python benchmarks/publish_trial.py render

`publish` copies trial.json, the tables and trials as CSV, the film and some figures from the
folder of a finished `holdfast trial` to docs/study/grip/, in place of the old ones, and writes the
page; `render` writes the page again. docs/study/grip-trials.md is written from grip-trials.md.j2 in
that folder. Change the template, not the page: every figure in it is taken from trial.json, and
lab/tests/test_docs_trial.py renders it again.
"""

import argparse
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from holdfast_lab.report.table_layouts import to_markdown
from holdfast_lab.trial.report import summary_text
from holdfast_lab.trial.tables import all_tables

DOCS = Path(__file__).parents[1] / "docs" / "study"
PAGE = "grip-trials.md"
FIGURES = ("film.webp", "force.png", "distributions.png", "course.png")
"""Figures that are copied; a run without a film has some of them only."""
NOT_PUBLISHED = ("trials",)
"""Parts of trial.json that are published as CSV only."""
DIGITS = 6
"""Significant digits of published numbers."""


def publish(run: Path, docs: Path) -> None:
    """Copy the results of a run to docs/study/grip/, in place of the old ones.

    Args:
        run: folder of a finished comparison.
        docs: folder of the pages of the study.

    Raises:
        FileNotFoundError: the folder has no finished comparison.
    """
    document = json.loads((run / "trial.json").read_text("utf-8"))
    target = docs / "grip"
    for old in target.iterdir():
        if old.suffix != ".j2":
            old.unlink()
    copied = [run / "trials.csv", *(run / "tables").glob("*.csv")]
    copied += [path for name in FIGURES if (path := run / "figures" / name).exists()]
    for path in copied:
        shutil.copyfile(path, target / path.name)
    kept = {name: value for name, value in document.items() if name not in NOT_PUBLISHED}
    text = json.dumps(_rounded(kept), indent=1, ensure_ascii=False)
    (target / "trial.json").write_text(text + "\n", encoding="utf-8")


def write_page(docs: Path) -> None:
    """Write the page from the published results."""
    (docs / PAGE).write_text(render(docs / "grip"), encoding="utf-8")


def render(folder: Path) -> str:
    """Return the text of the page.

    Args:
        folder: with the template and, if a run is published, its results.
    """
    environment = Environment(
        loader=FileSystemLoader(folder),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(f"{PAGE}.j2").render(**_values(folder))


def _values(folder: Path) -> dict[str, Any]:
    """Return what the template uses; `trial` is None if no run is published."""
    if not (folder / "trial.json").exists():
        return {"trial": None}
    document: Mapping[str, Any] = json.loads((folder / "trial.json").read_text("utf-8"))
    tables = {table.name: to_markdown(table) for table in all_tables(document)}
    figures = [name for name in FIGURES if (folder / name).exists()]
    return {
        "trial": document, "summary": summary_text(document), "tables": tables, "figures": figures,
    }  # fmt: skip


def _rounded(value: object) -> object:
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {name: _rounded(each) for name, each in value.items()}
    return [_rounded(each) for each in value] if isinstance(value, list) else value


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description="Publish a comparison of grip laws in docs/study/."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("publish").add_argument("run", type=Path)
    commands.add_parser("render")
    given = parser.parse_args()
    if given.command == "publish":
        publish(given.run, DOCS)
    write_page(DOCS)


if __name__ == "__main__":
    main()
