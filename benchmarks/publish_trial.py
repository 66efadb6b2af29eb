"""Publish a comparison of grip laws in docs/study/, and write the page that quotes it.

    python benchmarks/publish_trial.py publish MILD HARD
    python benchmarks/publish_trial.py sets NAME FOLDER [NAME FOLDER ...]
    python benchmarks/publish_trial.py render

`publish` copies trial.json, the tables and trials as CSV, and some figures from the folders of
finished `holdfast trial` to docs/study/grip/, in place of the old ones. MILD and HARD are runs of
all laws on the two plants. `sets` does so for the laws of other runs: of today's law, other models
or impacts; those called `mild` and `hard` are the figures of the law. Both write the page; `render`
writes it again. docs/study/grip-trials.md is written from grip-trials.md.j2 in that folder. Change
the template, not the page: every figure in it is taken from the published files, and
lab/tests/test_docs_trial.py renders it again.
"""

import argparse
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from holdfast_lab.trial.summary import Summary

DOCS = Path(__file__).parents[1] / "docs" / "study"
PAGE = "grip-trials.md"
FIGURES = ("force.png", "distributions.png", "course.png")
"""Figures that are copied; a run without an example has some of them only."""
NOT_PUBLISHED = ("trials",)
"""Parts of trial.json that are published as CSV only."""
SETS = "sets.json"
"""File of the other runs: each with its laws."""
DIGITS = 6
"""Significant digits of published numbers."""


def publish(run: Path, docs: Path, hard: Path) -> None:
    """Copy the results of two runs to docs/study/grip/, in place of the old ones.

    Args:
        run: folder of a finished comparison, with the mild plant.
        docs: folder of the pages of the study.
        hard: folder of one with the hard plant, published as hard.json.

    Raises:
        FileNotFoundError: a folder has no finished comparison.
    """
    documents = {"trial.json": run, "hard.json": hard}
    texts = {name: _published(folder / "trial.json") for name, folder in documents.items()}
    target = docs / "grip"
    for old in target.iterdir():
        if old.suffix != ".j2" and old.name != SETS:
            old.unlink()
    copied = [run / "trials.csv", *(run / "tables").glob("*.csv")]
    copied += [path for name in FIGURES if (path := run / "figures" / name).exists()]
    for path in copied:
        shutil.copyfile(path, target / path.name)
    for name, text in texts.items():
        (target / name).write_text(text, encoding="utf-8")


def publish_sets(docs: Path, runs: Mapping[str, Path]) -> None:
    """Write the laws of other runs, by the name of the run, to docs/study/grip/."""
    sets = {name: _laws_of(folder) for name, folder in runs.items()}
    text = json.dumps(_rounded(sets), indent=1, ensure_ascii=False) + "\n"
    (docs / "grip" / SETS).write_text(text, encoding="utf-8")


def _laws_of(folder: Path) -> dict[str, Any]:
    """Return the laws of a run, and what it was made with."""
    document = json.loads((folder / "trial.json").read_text("utf-8"))
    return {name: document[name] for name in ("n_trials", "seed", "model", "laws")} | {
        "plant": document["plant"]["name"],
        "impacts": document.get("impacts_per_trial", 0),
    }


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
    document, hard, sets = (
        json.loads((folder / name).read_text("utf-8")) for name in ("trial.json", "hard.json", SETS)
    )
    return {
        "trial": document,
        "hard": hard,
        "others": sets,
        "figures": [name for name in FIGURES if (folder / name).exists()],
        "number": _number,
    }


def _number(summary: Summary, field: str, factor: float = 1.0, digits: int = 1) -> str:
    """Return a number with its interval, as small print; `lost` where it is infinite."""
    value, interval = summary[field]["value"], summary[field]["interval"]
    if value is None:
        return "lost"
    text = f"{factor * value:.{digits}f}"
    if not interval or any(end is None for end in interval):
        return text
    low, high = (f"{factor * end:.{digits}f}" for end in interval)
    return text if low == high else f"{text}<br><sub>{low} to {high}</sub>"


def _rounded(value: object) -> object:
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {name: _rounded(item) for name, item in value.items()}
    return [_rounded(item) for item in value] if isinstance(value, list) else value


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description="Publish a comparison of grip laws in docs/study/."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    verb = commands.add_parser("publish")
    verb.add_argument("run", type=Path)
    verb.add_argument("hard", type=Path)
    commands.add_parser("sets").add_argument("runs", nargs="+", metavar="NAME FOLDER")
    commands.add_parser("render")
    options = parser.parse_args()
    if options.command == "publish":
        publish(options.run, DOCS, options.hard)
    elif options.command == "sets":
        publish_sets(DOCS, dict(zip(options.runs[::2], map(Path, options.runs[1::2]), strict=True)))
    write_page(DOCS)


if __name__ == "__main__":
    main()
