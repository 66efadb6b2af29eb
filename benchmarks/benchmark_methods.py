"""The first table of the benchmark: every method of the study, fitted and scored.

    holdfast study data benchmark/
    holdfast simulate hands/ --randomize --measured all --repeats 48 --seed 7010
    python benchmarks/benchmark_methods.py score benchmark/ hands/ OUT
    python benchmarks/benchmark_methods.py table OUT

`score` fits each method twice: to the split `train` for the scores of `new-objects`, and to the
drawn hands of a folder for those of `new-hand-and-objects`. There the contact threshold of a
finger comes from its own tare interval, since units and noise differ from hand to hand. Each fit
scores `tuning` too, from which the scorer chooses the thresholds. A submission and its results
are written for each; those that exist are kept. `table` prints the results of a folder as
Markdown. The results of a model, `holdfast study score FILE --json > OUT/NAME.json`, may lie in
the same folder.
"""

import argparse
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from holdfast_lab.report.result_tables import to_json
from holdfast_lab.study.benchmark.method_scores import (
    BothTargets,
    load_features,
    write_submission,
)
from holdfast_lab.study.benchmark.protocol import TUNING, protocol
from holdfast_lab.study.benchmark.scoring import score_submission
from holdfast_lab.study.benchmark.submission import read_submission
from holdfast_lab.study.comparison.jobs import NETWORK, is_torch_installed
from holdfast_lab.study.methods import METHODS

REFERENCE, HANDS = "new-objects", "new-hand-and-objects"
AT_ONE = {"threshold": "for 1/min"}
MISSING = "–"


class Column(NamedTuple):
    """A column of the printed table.

    Attributes:
        head: of the column.
        table: of the scorer.
        figure: of the rows of the table.
        digits: after the decimal point.
        keys: that select the row, beside its split.
        interval: show the interval.
    """

    head: str
    table: str
    figure: str
    digits: int = 1
    keys: Mapping[str, str] = {}
    interval: bool = False


COLUMNS = (
    Column("AUC", "stability", "AUC", 3),
    Column("AUC contact", "stability", "AUC contact", 3),
    Column("accuracy %", "stability", "accuracy [%]"),
    Column("missed at 50 ms %, 1/min", "events", "missed at 50 ms [%]", keys=AT_ONE, interval=True),
    Column("became, per min", "events", "false alarms under stable label, per minute", keys=AT_ONE),
    Column("slips within 100 ms %", "slips", "within 100 ms [%]", interval=True),
    Column("gross, before %", "slips", "gross, before [%]"),
    Column("before 1 mm %", "slips", "before 1 mm [%]"),
    Column("became, per min held", "slips", "false alarms per minute held"),
)


def score_methods(names: Sequence[str], benchmark: Path, hands: Path, out: Path) -> None:
    """Fit, submit and score each method on both splits."""
    out.mkdir(parents=True, exist_ok=True)
    for split, train in ((REFERENCE, benchmark / "train"), (HANDS, hands)):
        for name in names:
            path = out / f"{name}.{split}.parquet"
            if not path.with_suffix(".json").exists():
                try:
                    _score(name, split, train, benchmark, path)
                except ValueError as cause:
                    print(f"{name}, {split}: {cause}", flush=True)


def _score(name: str, split: str, train: Path, benchmark: Path, path: Path) -> None:
    """Write the submission of a method for a split, and its results.

    Raises:
        ValueError: the method does not fit a sensor of the split.
    """
    method = METHODS[name]
    fitted = BothTargets.fit(method, load_features(method, train), own_rest=split == HANDS)
    splits = {own: load_features(method, benchmark / own) for own in (TUNING, split)}
    write_submission(path, fitted, splits)
    result = score_submission(read_submission(path), benchmark, protocol())
    document = {
        "submission": method.title,
        "version": protocol().version,
        "differ": result.differ,
        "left_out": result.left_out,
        "tables": {table.name: to_json(table) for table in result.tables},
    }
    path.with_suffix(".json").write_text(json.dumps(document), "utf-8")
    print(f"{name}, {split}: done", flush=True)


def table_lines(documents: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the lines of the table: the splits, and the submissions by their AUC in each."""
    documents = list(documents)
    yield "| " + " | ".join(["split", "method", *(column.head for column in COLUMNS)]) + " |"
    yield "|---|---|" + "--:|" * len(COLUMNS)
    for split in (REFERENCE, HANDS):
        shown = [document for document in documents if _rows(document, COLUMNS[0], split)]
        shown.sort(key=lambda document: -_rows(document, COLUMNS[0], split)[0]["value"])
        for document in shown:
            cells = [_cell(document, column, split) for column in COLUMNS]
            yield "| " + " | ".join([f"`{split}`", document["submission"], *cells]) + " |"


def _rows(document: Mapping[str, Any], column: Column, split: str) -> list[dict[str, Any]]:
    keys = {"on": split, "figure": column.figure, **column.keys}
    rows = document["tables"].get(column.table, [])
    return [row for row in rows if keys.items() <= row.items()]


def _cell(document: Mapping[str, Any], column: Column, split: str) -> str:
    rows = _rows(document, column, split)
    if not rows or rows[0]["value"] is None:
        return MISSING
    text = f"{rows[0]['value']:.{column.digits}f}"
    ends = rows[0].get("interval")
    if not (column.interval and ends):
        return text
    low, high = (f"{end:.{column.digits}f}" for end in ends)
    return f"{text} ({low} to {high})"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Score the methods of the study.")
    commands = parser.add_subparsers(dest="command", required=True)
    score = commands.add_parser("score")
    score.add_argument("benchmark", type=Path)
    score.add_argument("hands", type=Path)
    known = [name for name in METHODS if name != NETWORK or is_torch_installed()]
    score.add_argument("--methods", nargs="*", choices=known, default=known, metavar="NAME",
                       help=f"of {', '.join(known)}; all by default")  # fmt: skip
    table = commands.add_parser("table")
    for command in (score, table):
        command.add_argument("out", type=Path)
    options = parser.parse_args()
    if options.command == "score":
        score_methods(options.methods, options.benchmark, options.hands, options.out)
    else:
        paths = sorted(options.out.glob("*.json"))
        print("\n".join(table_lines(json.loads(path.read_text("utf-8")) for path in paths)))


if __name__ == "__main__":
    main()
