"""Publish a comparison of grip laws in docs/study/, and write the page that quotes it.

    python benchmarks/publish_trial.py publish TRIALS [HARD]
    python benchmarks/publish_trial.py render

`publish` copies trial.json, the tables and trials as CSV, the film and some figures from the
folder of a finished `holdfast trial` to docs/study/grip/, in place of the old ones, and writes the
page; HARD is the folder of a run with the hard plant. `render` writes the page again.
docs/study/grip-trials.md is written from grip-trials.md.j2 in that folder. Change the template, not
the page: every figure in it is taken from trial.json, and lab/tests/test_docs_trial.py renders it
again.
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
HARD_TABLES = ("laws", "slips", "forces", "drops")
"""Tables of the run with the hard plant that the page has."""
DIGITS = 6
"""Significant digits of published numbers."""


def publish(run: Path, docs: Path, hard: Path | None = None) -> None:
    """Copy the results of a run to docs/study/grip/, in place of the old ones.

    Args:
        run: folder of a finished comparison.
        docs: folder of the pages of the study.
        hard: folder of one with the hard plant, published as hard.json.

    Raises:
        FileNotFoundError: the folder has no finished comparison.
    """
    documents = {"trial.json": run} | ({} if hard is None else {"hard.json": hard})
    texts = {name: _published(folder / "trial.json") for name, folder in documents.items()}
    target = docs / "grip"
    for old in target.iterdir():
        if old.suffix != ".j2":
            old.unlink()
    copied = [run / "trials.csv", *(run / "tables").glob("*.csv")]
    copied += [path for name in FIGURES if (path := run / "figures" / name).exists()]
    for path in copied:
        shutil.copyfile(path, target / path.name)
    for name, text in texts.items():
        (target / name).write_text(text, encoding="utf-8")


def _published(path: Path) -> str:
    """Return what is published of a trial.json."""
    document = json.loads(path.read_text("utf-8"))
    kept = {name: value for name, value in document.items() if name not in NOT_PUBLISHED}
    return json.dumps(_rounded(kept), indent=1, ensure_ascii=False) + "\n"


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
    document, tables = _tables(folder / "trial.json")
    hard, hard_tables = None, {}
    if (folder / "hard.json").exists():
        hard, hard_tables = _tables(folder / "hard.json")
    return {
        "trial": document,
        "summary": summary_text(document),
        "tables": tables,
        "figures": [name for name in FIGURES if (folder / name).exists()],
        "hard": hard,
        "hard_tables": [hard_tables[name] for name in HARD_TABLES if name in hard_tables],
    }


def _tables(path: Path) -> tuple[Mapping[str, Any], dict[str, str]]:
    """Return a published document and its tables as Markdown."""
    document = json.loads(path.read_text("utf-8"))
    return document, {table.name: to_markdown(table) for table in all_tables(document)}


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
    verb = commands.add_parser("publish")
    verb.add_argument("run", type=Path)
    verb.add_argument("hard", type=Path, nargs="?")
    commands.add_parser("render")
    given = parser.parse_args()
    if given.command == "publish":
        publish(given.run, DOCS, given.hard)
    write_page(DOCS)


if __name__ == "__main__":
    main()
