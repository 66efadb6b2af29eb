"""`holdfast study`: the tables and figures of the paper, and further experiments."""

import os
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from holdfast.cli.options import (
    RARE,
    EngineOption,
    ForceOption,
    JobsOption,
    JsonOption,
    SeedOption,
    TareOption,
    start_engine,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message, print_table
from holdfast.cli.terminal.progress import progress
from holdfast_lab.verbs import OutOption, QuickOption
from holdfast_lab.verbs.benchmark import make_data, print_scores

if TYPE_CHECKING:
    from holdfast.parallel import Engine
    from holdfast_lab.report.result_tables import ResultTable, Row, TableLine
    from holdfast_lab.study.plan import Corpus, StudyPlan

PRINTED_COLUMNS: dict[str, tuple[str, ...]] = {
    "confusion": (),
    "real": ("mean AUC", "stable called STABLE [%]"),
    "methods": ("accuracy [%]", "FDR [%]", "FNR [%]", "AUC"),
    "events": ("missed at 50 ms [%]", "missed at 200 ms [%]", "false alarms per minute"),
}
"""Tables that are printed at the end, with their columns; an empty tuple means all columns."""
PRINTED_SPLITS = ("by object", "by recording")
"""Splits that can be printed; the first of those with the most methods is printed."""
ACTIONS = {"data": "a folder", "score": "a .csv or .parquet file"}
"""Actions of the benchmark, and what follows them."""
REAL_DATA = "uskin_pick_move"
"""Folder of the real recordings, within `HOLDFAST_DATA`."""
REAL_DATA_URL = "https://github.com/imanlab/proactive-slip-control"
REAL_TARE = "first"
"""The real recordings begin in contact."""


class TwinCorpus(NamedTuple):
    """Settings of a corpus that the twin simulates.

    Attributes:
        profile: profile of the twin.
        seed_offset: number that is added to the seed.
        other_objects: use another set of objects.
        glitch_rate: glitches of the hand's controller per second [1/s]; None for the profile's.
        repeats: grasps of each object and case in a full study; None for `N_REPEATS`.
        noise: rms of a reading at rest [count]; None for that of the sensor.
    """

    profile: str = "reference"
    seed_offset: int = 0
    other_objects: bool = False
    glitch_rate: float | None = None
    repeats: int | None = None
    noise: float | None = None


TWIN_CORPORA = {
    "main": TwinCorpus(),
    "fresh": TwinCorpus(seed_offset=1),
    "others": TwinCorpus(other_objects=True),
    "gentle": TwinCorpus("gentle", repeats=3),
    "vigorous": TwinCorpus("vigorous", repeats=3),
    "finger": TwinCorpus("finger-reference", repeats=2),
    "noiseless": TwinCorpus(noise=0.0, repeats=2),
    **{
        f"glitch-{n}": TwinCorpus(seed_offset=2, other_objects=True, glitch_rate=n / 60, repeats=2)
        for n in (0, 1, 7)
    },
}
QUICK_CORPORA = {name: TWIN_CORPORA[name] for name in ("main", "others")}
N_REPEATS = 5
"""Grasps of each object and case, as in the protocol of the paper."""
QUICK_REPEATS = {"main": 2, "others": 1}
"""Grasps of each object and case in each corpus of a quick study."""


def study(
    data: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[DATA | data FOLDER | score FILE]",
            help="A folder of labelled recordings; or give --twin. data: simulate the recordings "
            "of the benchmark. score: score a submission to it.",
        ),
    ] = None,
    out: OutOption = Path("study"),
    twin: Annotated[
        bool, typer.Option("--twin", help="First simulate recordings with the physical twin.")
    ] = False,
    quick: QuickOption = False,
    engine: EngineOption = "loky",
    jobs: JobsOption = -1,
    seed: SeedOption = 0,
    tare: Annotated[TareOption, RARE] = "0.5",
    benchmark: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Recordings of the benchmark, for score."), RARE
    ] = Path("benchmark"),
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Repeat the experiments of the paper, and run further ones.

    Write OUT/report.html, every table as CSV, JSON, LaTeX and Markdown, every figure as SVG and
    PNG, study.json, and methods.md and references.bib for a publication. Finished tasks are kept in
    OUT/work and simulated recordings in OUT/data, also with --force, so the same command continues
    a study that was stopped. Of real recordings, imported or your own, the study compares
    builtin:any, as it ships and adapted, with every method trained on the other recordings. With
    recordings of the twin, the real ones are read from HOLDFAST_DATA, or from ../shared/data, if
    they exist.

    data FOLDER simulates the recordings of the frozen benchmark, and score FILE scores what
    another program says of them, see docs/benchmark.md.

    Example:
      holdfast study --twin --quick --out quick/
      holdfast study --twin --out study/
      holdfast study real/ --tare first --quick --out real-study/
      holdfast study recordings/ --out mine/ --engine dask:tcp://10.0.0.1:8786
      holdfast study data benchmark/
      holdfast study score scores.csv --benchmark benchmark/
    """
    action, path = _action(data or [])
    if action == "score" and path is not None:
        print_scores(path, benchmark, as_json=as_json)
    elif action == "data" and path is not None:
        make_data(path, start_engine(engine, jobs), as_json=as_json)
    else:
        _run(path, out, engine, jobs, seed, tare, twin=twin, quick=quick, force=force,
             as_json=as_json)  # fmt: skip


def _action(words: list[Path]) -> tuple[str, Path | None]:
    """Return what is done, and its path.

    Raises:
        ValueError: the words are neither a folder nor an action of the benchmark with a path.
    """
    if len(words) < 2:
        if words and str(words[0]) in ACTIONS and not words[0].is_dir():
            raise ValueError(f"{words[0]}: {ACTIONS[str(words[0])]} expected after it")
        return "study", words[0] if words else None
    action = str(words[0])
    if len(words) > 2 or action not in ACTIONS:
        given = " ".join(map(str, words))
        raise ValueError(f"a folder, data FOLDER or score FILE expected, {given!r} given")
    return action, words[1]


def _run(
    data: Path | None,
    out: Path,
    engine: str,
    jobs: int,
    seed: int,
    tare: str,
    *,
    twin: bool,
    quick: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Run the study and print its main tables."""
    from holdfast_lab.study.run import run_study

    engine_used = _check_arguments(data, out, engine, jobs, seed, tare, twin=twin, force=force)
    started_at = time.perf_counter()
    try:
        plan, left_out = _plan(data, out, seed, tare, jobs, quick=quick)
        made_in = time.perf_counter() - started_at
        tables = run_study(
            plan,
            out,
            engine_used,
            progress=progress,
            notify=print_message,
            force=force,
            made_in=made_in,
            left_out=left_out,
        )
    except KeyboardInterrupt:
        print_message(f"the finished part is in {out}: the same command continues it")
        raise
    if as_json:
        from msgspec import json

        print_json(json.decode((out / "study.json").read_bytes()))
        return
    for table in tables:
        if table.name in PRINTED_COLUMNS:
            _print_result_table(table)
    print_line(f"{out / 'report.html'}: all {len(tables)} tables and the figures")


def _check_arguments(
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
    """Check the arguments before the work begins; return the engine.

    Raises:
        ValueError: an argument is wrong.
        OutputError: `out` is not empty.
        EngineError: no cluster answers at the address.
    """
    from holdfast.features import Tare
    from holdfast.parallel import Engine
    from holdfast_lab.report.folder import check_output_folder
    from holdfast_lab.study.run import STUDY

    if (data is None) != twin:
        given = "both" if twin else "neither"
        raise ValueError(f"a folder of recordings or --twin expected, {given} given")
    if seed < 0 or jobs == 0:
        raise ValueError(
            f"a seed of at least 0 and jobs other than 0 expected; {seed} and {jobs} given"
        )
    Tare.parse(tare)
    chosen = Engine.parse(engine, jobs)
    check_output_folder(out, STUDY, force=force)
    chosen.check()
    return chosen


def _plan(
    data: Path | None, out: Path, seed: int, tare: str, jobs: int, *, quick: bool
) -> "tuple[StudyPlan, list[str]]":
    """Return the plan and what is left out; simulate the recordings if there is no `data`.

    Own recordings that the twin did not simulate are the real recordings of the study.
    """
    from holdfast_lab.study.plan import StudyPlan, scan_corpus

    if data is None:
        folder = out / "data" / "quick" if quick else out / "data"
        corpora = twin_corpora(folder, seed, quick=quick, jobs=jobs, tare=tare)
    else:
        corpora = {"main": scan_corpus("main", data, tare)}
        if not corpora["main"].is_simulated:
            return StudyPlan(corpora, corpora["main"], quick, seed), []
    real, left_out = real_corpus(out / "data" / "real")
    return StudyPlan(corpora, real, quick, seed), left_out


def _print_result_table(table: "ResultTable") -> None:
    """Print a table on the terminal, with the values of the paper in parentheses."""
    from holdfast_lab.report.result_tables import digits_of, pivot

    grid = pivot(_printed_rows(table))
    paper = (
        " (in parentheses: the paper)" if any(row.paper is not None for row in table.rows) else ""
    )
    print_line(f"{table.title}{paper}")
    digits = [digits_of(table, name) for name in grid.columns]
    lines = [_texts(line, digits) for line in grid.lines]
    print_table((*table.lines, *grid.columns), lines)
    print_line()


def _printed_rows(table: "ResultTable") -> "ResultTable":
    """Return the table with the rows to print.

    They are those of one split, at each method's own threshold; glitches count as events.
    """
    from msgspec import structs

    columns = PRINTED_COLUMNS[table.name]
    n_rows = {on: sum(row.keys.get("on") == on for row in table.rows) for on in PRINTED_SPLITS}
    chosen = max(PRINTED_SPLITS, key=lambda on: n_rows[on])
    rows = [
        row
        for row in table.rows
        if (not columns or row.keys["figure"] in columns)
        and (not n_rows[chosen] or row.keys["on"] == chosen)
        and row.keys.get("threshold", "own") == "own"
        and row.keys.get("a glitch is", "an event") == "an event"
    ]
    return structs.replace(table, rows=rows)


def _texts(line: "TableLine", digits: list[int]) -> list[str]:
    cells = zip(line.cells, digits, strict=True)
    return [*line.heads, *(_text(row, n) for row, n in cells)]


def _text(row: "Row | None", digits: int) -> str:
    from holdfast_lab.report.result_tables import number_text

    if row is None:
        return "-"
    paper = "" if row.paper is None else f" ({number_text(row.paper, digits)})"
    return number_text(row.ours, digits) + paper


def twin_corpora(out: Path, seed: int, *, quick: bool, jobs: int, tare: str) -> "dict[str, Corpus]":
    """Simulate the missing recordings in `out`, in one folder for each corpus.

    Raises:
        OutputError: existing recordings have another seed.
    """
    from holdfast_lab.study.plan import scan_corpus

    corpora = {}
    settings = QUICK_CORPORA if quick else TWIN_CORPORA
    for number, (name, corpus) in enumerate(settings.items(), 1):
        print_message(f"recordings of the twin, {number} of {len(settings)}: {name}")
        repeats = QUICK_REPEATS[name] if quick else corpus.repeats or N_REPEATS
        _simulate(out / name, corpus, seed, repeats, jobs)
        corpora[name] = scan_corpus(name, out / name, tare)
    return corpora


def _simulate(folder: Path, corpus: TwinCorpus, seed: int, repeats: int, jobs: int) -> None:
    from holdfast.errors import OutputError
    from holdfast.parallel import Engine
    from holdfast.twin.objects import OTHER_OBJECTS
    from holdfast.twin_recordings import plan_grasps, simulate_grasps

    table = OTHER_OBJECTS if corpus.other_objects else None
    seed += corpus.seed_offset
    grasps = [
        replace(grasp, glitch_rate=corpus.glitch_rate, noise=corpus.noise)
        for grasp in plan_grasps("", "1,2", repeats, corpus.profile, seed, table=table)
    ]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        simulate_grasps(
            grasps, folder,
            engine=Engine(jobs), force=False, notify=print_message, steps=progress,
        )  # fmt: skip
    except OutputError as cause:
        problem, _, advice = str(cause).rpartition(": ")
        if "--force" not in advice:
            raise
        raise OutputError(f"{problem}: choose another OUT, or delete its data") from cause


def real_corpus(out: Path) -> "tuple[Corpus | None, list[str]]":
    """Import the real recordings into `out`; otherwise return why they are left out."""
    from holdfast.errors import HoldfastError
    from holdfast_lab.study.plan import scan_corpus

    source = Path(os.environ.get("HOLDFAST_DATA", "../shared/data"), REAL_DATA)
    if not source.is_dir():
        return None, [
            "real recordings, because none were found. Download them from "
            f"{REAL_DATA_URL.removeprefix('https://')} into a folder {REAL_DATA}, and set "
            "HOLDFAST_DATA to the folder that contains it."
        ]
    try:
        _import(source, out)
        return scan_corpus("real", out, REAL_TARE), []
    except (HoldfastError, ValueError) as cause:
        print_message(f"the real recordings are left out: {cause}")
        return None, [f"real recordings, because those in HOLDFAST_DATA cannot be used ({cause})."]


def _import(source: Path, out: Path) -> None:
    from holdfast.files import file_stem
    from holdfast.io import import_recordings, save_recording

    out.mkdir(parents=True, exist_ok=True)
    for recording in import_recordings(source):
        path = out / f"{file_stem(recording.name)}.parquet"
        if not path.exists():
            save_recording(recording, path)
