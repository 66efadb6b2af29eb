"""`holdfast study`: every table and figure of the paper, and those it should have had."""

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from holdfast.cli.simulate import grasps, make_all
from holdfast.cli.terminal.console import print_json, print_table, say, show
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.parallel import Engine
    from holdfast.study.plan import Corpus, StudyPlan
    from holdfast.study.report.result_tables import ResultTable, Row, TableLine

HEADLINES: dict[str, tuple[str, ...]] = {
    "confusion": (),
    "methods": ("accuracy [%]", "FDR [%]", "FNR [%]", "AUC"),
    "events": ("missed at 50 ms [%]", "missed at 200 ms [%]", "in vain per minute"),
}
"""Tables that are printed at the end, and their columns; all where none are named."""
HARDEST = ("by object", "by recording")
"""Of the splits of main; the first that most methods have is printed."""


def study(
    data: Annotated[
        Path | None, typer.Argument(help="A folder of labelled recordings; or --twin.")
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="The folder that the study is written to.")
    ] = Path("study"),
    twin: Annotated[
        bool, typer.Option("--twin", help="Make the recordings first, by the physical twin.")
    ] = False,
    quick: Annotated[
        bool, typer.Option("--quick", help="A few minutes: less of everything.")
    ] = False,
    engine: Annotated[
        str, typer.Option(help="loky: processes here; dask:ADDRESS: a cluster.")
    ] = "loky",
    jobs: Annotated[int, typer.Option(help="Processes here; -1: one a processor.")] = -1,
    seed: Annotated[int, typer.Option(help="Of everything random, the twin too.")] = 0,
    tare: Annotated[
        str, typer.Option(help="Seconds from the start, first, none, or START:END.")
    ] = "0.5",
    force: Annotated[
        bool, typer.Option("--force", help="Replace a study; its data and work are kept.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print study.json on stdout.")] = False,
) -> None:
    """Repeats the paper, and asks what it did not.

    Writes OUT/report.html, every table as CSV, JSON and LaTeX, every figure as SVG and PNG, and
    study.json. What is computed is kept in OUT/work and what the twin makes in OUT/data: the same
    command goes on where it was stopped. Real recordings are taken from HOLDFAST_DATA or
    ../shared/data where there are any.

    Example:
      holdfast study --twin --quick --out quick/
      holdfast study --twin --out study/
      holdfast study recordings/ --out mine/ --engine dask:tcp://10.0.0.1:8786
    """
    from holdfast.study.run import run_study

    engines = _checked(data, out, engine, jobs, seed, tare, twin=twin, force=force)
    begun = time.perf_counter()
    try:
        plan, left_out = _plan(data, out, seed, tare, jobs, quick=quick)
        made_in = time.perf_counter() - begun
        tables = run_study(
            plan, out, engines, progress=progress, notify=say, force=force, made_in=made_in,
            left_out=left_out,
        )  # fmt: skip
    except KeyboardInterrupt:
        say(f"what was done so far is in {out}: the same command goes on with it")
        raise
    if as_json:
        from msgspec import json

        print_json(json.decode((out / "study.json").read_bytes()))
        return
    for table in tables:
        if table.name in HEADLINES:
            _show(table)
    show(f"{out / 'report.html'}: all {len(tables)} tables, with figures")


def _checked(
    data: Path | None,
    out: Path,
    engine: str,
    jobs: int,
    seed: int,
    tare: str,
    *,
    twin: bool,
    force: bool,
) -> "Engine":
    """Refuses bad input before any work is done; the engine.

    Raises:
        ValueError: an argument is wrong.
        OutputError: `out` holds something.
        EngineError: no cluster answers there.
    """
    from holdfast.features import Tare
    from holdfast.parallel import Engine
    from holdfast.study.report.folder import check_output_folder

    if (data is None) != twin:
        given = "both" if twin else "neither"
        raise ValueError(f"a folder of recordings or --twin expected, {given} given")
    if seed < 0 or jobs == 0:
        raise ValueError(
            f"a seed of at least 0 and jobs other than 0 expected; {seed} and {jobs} given"
        )
    Tare.parse(tare)
    chosen = Engine.parse(engine, jobs)
    check_output_folder(out, force=force)
    if chosen.scheduler is not None:
        list(chosen.map_ordered(abs, [(0,)]))
    return chosen


def _plan(
    data: Path | None, out: Path, seed: int, tare: str, jobs: int, *, quick: bool
) -> "tuple[StudyPlan, list[str]]":
    """What is studied, and what is left out; makes the twin's recordings where it is asked to."""
    from holdfast.study.plan import StudyPlan, scan_corpus
    from holdfast.study.run import check_plan

    if data is None:
        made = out / "data" / "quick" if quick else out / "data"
        corpora = twin_corpora(made, seed, quick=quick, jobs=jobs, tare=tare)
    else:
        corpora = {"main": scan_corpus("main", data, tare)}
    check_plan(StudyPlan(corpora))
    real, left_out = real_corpus(out / "data" / "real")
    return StudyPlan(corpora, real, quick, seed), left_out


def _show(table: "ResultTable") -> None:
    """A table for a terminal: ours, and the paper's in parentheses."""
    from holdfast.study.report.result_tables import digits_of, pivot

    grid = pivot(_headline(table))
    paper = (
        " (in parentheses: the paper)" if any(row.paper is not None for row in table.rows) else ""
    )
    show(f"{table.title}{paper}")
    digits = [digits_of(table, name) for name in grid.columns]
    lines = [_texts(line, digits) for line in grid.lines]
    print_table((*table.lines, *grid.columns), lines)
    show()


def _headline(table: "ResultTable") -> "ResultTable":
    """The rows that are printed: of one split, at each method's own threshold."""
    from msgspec.structs import replace

    columns = HEADLINES[table.name]
    n_rows = {on: sum(row.keys.get("on") == on for row in table.rows) for on in HARDEST}
    chosen = max(HARDEST, key=lambda on: n_rows[on])
    rows = [
        row
        for row in table.rows
        if (not columns or row.keys["figure"] in columns)
        and (not n_rows[chosen] or row.keys["on"] == chosen)
        and row.keys.get("threshold", "own") == "own"
    ]
    return replace(table, rows=rows)


def _texts(line: "TableLine", digits: list[int]) -> list[str]:
    cells = zip(line.cells, digits, strict=True)
    return [*line.heads, *(_text(row, n) for row, n in cells)]


def _text(row: "Row | None", digits: int) -> str:
    from holdfast.study.report.result_tables import number_text

    if row is None:
        return "-"
    paper = "" if row.paper is None else f" ({number_text(row.paper, digits)})"
    return number_text(row.ours, digits) + paper


REAL = "uskin_pick_move"
"""Folder of the real recordings, within `HOLDFAST_DATA`."""
SOURCE = "https://github.com/imanlab/proactive-slip-control"
REAL_TARE = "first"
"""They begin in contact."""


class Kind(NamedTuple):
    """How the recordings of a corpus are made.

    Attributes:
        profile: of the twin.
        later: added to the seed.
        others: other objects than the twin's own.
    """

    profile: str = "reference"
    later: int = 0
    others: bool = False


FULL = {
    "main": Kind(),
    "fresh": Kind(later=1),
    "others": Kind(others=True),
    "gentle": Kind("gentle"),
    "vigorous": Kind("vigorous"),
}
QUICK = {name: FULL[name] for name in ("main", "others")}
REPEATS = 5
"""Of every object and case, as in the paper's protocol."""
FEW = {"main": 2, "others": 1}
"""The same in a quick study."""


def twin_corpora(out: Path, seed: int, *, quick: bool, jobs: int, tare: str) -> "dict[str, Corpus]":
    """Makes what is not there yet in `out`, a folder for each corpus.

    Raises:
        OutputError: what is there was made from another seed.
    """
    from holdfast.study.plan import scan_corpus

    corpora = {}
    kinds = QUICK if quick else FULL
    for number, (name, kind) in enumerate(kinds.items(), 1):
        say(f"recordings of the twin, {number} of {len(kinds)}: {name}")
        repeats = FEW[name] if quick else REPEATS
        _simulate(out / name, kind, seed, repeats, jobs)
        corpora[name] = scan_corpus(name, out / name, tare)
    return corpora


def _simulate(folder: Path, kind: Kind, seed: int, repeats: int, jobs: int) -> None:
    from holdfast.errors import OutputError
    from holdfast.twin.objects import OTHER_OBJECTS

    table = OTHER_OBJECTS if kind.others else None
    wanted = grasps("", "1,2", repeats, kind.profile, seed + kind.later, table=table)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        make_all(wanted, folder, jobs=jobs, force=False)
    except OutputError as cause:
        made, _, advice = str(cause).rpartition(": ")
        if "--force" not in advice:
            raise
        raise OutputError(f"{made}: choose another OUT, or delete its data") from cause


def real_corpus(out: Path) -> "tuple[Corpus | None, list[str]]":
    """The real recordings, imported into `out`; and in a sentence why they are left out."""
    from holdfast.errors import HoldfastError
    from holdfast.study.plan import scan_corpus

    source = Path(os.environ.get("HOLDFAST_DATA", "../shared/data"), REAL)
    if not source.is_dir():
        return None, [
            f"real recordings, for none are here. Get them from {SOURCE.removeprefix('https://')} "
            f"into a folder {REAL}, and let HOLDFAST_DATA name the folder that holds it."
        ]
    try:
        _import(source, out)
        return scan_corpus("real", out, REAL_TARE), []
    except (HoldfastError, ValueError) as cause:
        say(f"the real recordings are left out: {cause}")
        return None, [f"real recordings, for those of HOLDFAST_DATA cannot be used ({cause})."]


def _import(source: Path, out: Path) -> None:
    from holdfast.io import import_recordings, save_recording

    out.mkdir(parents=True, exist_ok=True)
    for recording in import_recordings(source):
        path = out / f"{recording.name}.parquet"
        if not path.exists():
            save_recording(recording, path)
