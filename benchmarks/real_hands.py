"""Print what builtin:any reaches on real recordings, from the results of a study.

    holdfast import DATA/uskin_pick_move real/
    holdfast study real/ --tare first --out real-study/
    python benchmarks/real_hands.py real-study/

For each recording with slip: the AUC of stable against slip of builtin:any as it ships, beside
that of the best method that was trained on the other recordings. It is given twice: on the samples
at which all methods have an estimate, and method by method on the samples at which both have one.
For each recording without slip: the share of stable samples that are called STABLE. For all: the
share of labelled samples without an estimate.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

SHIPPED, UNTOUCHED = "builtin:any", "the twin"
RIVALS = "the others"
"""Training of the methods to compare with."""
OWN_FEATURES = f"features of {SHIPPED}"
"""Not a method to compare with."""
MAX_BEHIND = 0.05
"""Maximum distance to the best rival on all recordings with slip but one."""
MIN_CALLED_STABLE = 90.0
"""Minimum share of stable samples that are called STABLE, in recordings without slip [%]."""
MAX_WITHOUT_ESTIMATE = 5.0
"""Maximum share of labelled samples without an estimate [%]."""

Row = Mapping[str, Any]


class Compared(NamedTuple):
    """AUC of builtin:any and of the best other method on one recording."""

    recording: str
    own: float
    rival: float
    method: str


def report(tables: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """Yield the lines of the report.

    Args:
        tables: rows of the tables of the study, by name.
    """
    rows = tables["real_recordings"]
    names = list(dict.fromkeys(row["recording"] for row in rows))
    slipping = [name for name in names if shipped(rows, name, "AUC") is not None]
    yield "AUC of stable against slip, where all methods have an estimate"
    yield from comparison([best_rival(rows, name) for name in slipping])
    yield "AUC of stable against slip, where builtin:any and the one method have an estimate"
    yield from comparison([worst_pair(tables["real_pairs"], name) for name in slipping])
    yield "Stable samples called STABLE, recordings without slip"
    calm = {n: shipped(rows, n, "stable called STABLE [%]") for n in names if n not in slipping}
    yield from (f"  {name}: {share:.1f} %" for name, share in calm.items() if share is not None)
    reached = all(share is None or share >= MIN_CALLED_STABLE for share in calm.values())
    yield f"  at least {MIN_CALLED_STABLE:g} % in each: {yes(reached)}"
    yield "Labelled samples without an estimate"
    without = {name: shipped(rows, name, "without estimate [%]") for name in names}
    yield from (f"  {name}: {share:.1f} %" for name, share in without.items())
    reached = all(share <= MAX_WITHOUT_ESTIMATE for share in without.values())
    yield f"  at most {MAX_WITHOUT_ESTIMATE:g} % in each: {yes(reached)}"


def shipped(rows: Sequence[Row], recording: str, figure: str) -> float | None:
    """Return a figure of builtin:any as it ships, on one recording."""
    return next(
        row["ours"]
        for row in rows
        if (row["recording"], row["method"], row["trained on"], row["figure"])
        == (recording, SHIPPED, UNTOUCHED, figure)
    )


def best_rival(rows: Sequence[Row], recording: str) -> Compared:
    """Compare with the method of the highest AUC, on the samples of all methods."""
    best = max(rivals(rows, recording, "AUC"), key=lambda row: row["ours"])
    return Compared(recording, shipped(rows, recording, "AUC"), best["ours"], best["method"])


def worst_pair(rows: Sequence[Row], recording: str) -> Compared:
    """Compare with the method that is furthest ahead, on the samples of both."""
    worst = min(rivals(rows, recording, "difference"), key=lambda row: row["ours"])["method"]
    pair = {
        row["figure"]: row["ours"]
        for row in rows
        if (row["recording"], row["method"]) == (recording, worst)
    }
    return Compared(recording, pair[f"AUC of {SHIPPED}"], pair["AUC"], worst)


def rivals(rows: Sequence[Row], recording: str, figure: str) -> list[Row]:
    """Return the rows of the methods that were trained on the other recordings."""
    return [
        row
        for row in rows
        if (row["recording"], row["trained on"], row["figure"]) == (recording, RIVALS, figure)
        and row["method"] != OWN_FEATURES
        and row["ours"] is not None
    ]


def comparison(compared: Sequence[Compared]) -> Iterator[str]:
    """Yield a line for each recording, and whether the goal is reached."""
    for each in compared:
        yield f"  {each.recording}: {each.own:.3f}; {each.method} {each.rival:.3f}"
    behind = sorted(each.rival - each.own for each in compared)
    reached = bool(behind) and behind[0] <= 0 and behind[-1] <= MAX_BEHIND
    yield f"  at least the best on one, within {MAX_BEHIND:g} of it on the rest: {yes(reached)}"


def yes(reached: bool) -> str:
    """Return the word for a goal."""
    return "reached" if reached else "not reached"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", type=Path, help="Folder of a finished study.")
    summary = parser.parse_args().study / "study.json"
    if not summary.is_file():
        parser.error(f"{summary} does not exist; the folder of a finished study expected")
    tables = json.loads(summary.read_text("utf-8"))["tables"]
    if "real_pairs" not in tables:
        parser.error(f"{summary} has no real recordings: see `holdfast study --help`")
    print("\n".join(report(tables)))


if __name__ == "__main__":
    main()
