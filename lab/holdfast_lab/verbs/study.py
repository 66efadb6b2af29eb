"""`holdfast study`: the tables and figures of the paper, and further experiments."""

import time
from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.options import EngineOptions, ForceOption, JsonOption, SeedOption, TareOption
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress
from holdfast_lab.verbs import OutOption, QuickOption


def study(
    data: Annotated[
        Path | None,
        typer.Argument(metavar="[DATA]", help="A folder of labelled recordings; or give --twin."),
    ] = None,
    *,
    out: OutOption = Path("study"),
    twin: Annotated[
        bool, typer.Option("--twin", help="First simulate recordings with the physical twin.")
    ] = False,
    quick: QuickOption = False,
    full: Annotated[
        bool,
        typer.Option(
            "--full",
            help="Also other profiles of the twin and rates of glitches, slips of fingers, and the "
            "models that ship: on knocks, aged skins and slips by speed, untaught and taught.",
        ),
    ] = False,
    parallel: EngineOptions,
    seed: SeedOption = 0,
    tare: TareOption = "0.5",
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Repeat the experiments of the paper, and run further ones.

    Write OUT/report.md, every table as CSV and Markdown, every figure as PNG, and study.json.
    Finished tasks are kept in OUT/work and simulated recordings in OUT/data, also with --force, so
    the same command continues a study that was stopped. Of real recordings, imported or your own,
    the study compares builtin:any, as it ships and adapted, with every method trained on the other
    recordings. With recordings of the twin, the real ones are read from HOLDFAST_DATA, or from
    ../shared/data, if they exist.

    Example:
      holdfast study --twin --quick --out quick/
      holdfast study --twin --out study/ --jobs -1
      holdfast study real/ --tare first --quick --out real-study/
    """
    from msgspec import json

    from holdfast.detection import Tare
    from holdfast_lab.report.folder import check_output_folder
    from holdfast_lab.report.terminal import PRINTED_COLUMNS, print_main_table
    from holdfast_lab.study.corpora import plan_study
    from holdfast_lab.study.run import STUDY, run_study

    if (data is None) != twin:
        sources = "both" if twin else "neither"
        raise ValueError(f"a folder of recordings or --twin expected, {sources} given")
    if quick and full:
        raise ValueError("--quick or --full expected, both given")
    if seed < 0:
        raise ValueError(f"a seed of at least 0 expected, {seed} given")
    Tare.parse(tare)
    engine = parallel.start()
    check_output_folder(out, STUDY, force=force)
    started_at = time.perf_counter()
    try:
        plan, left_out = plan_study(
            data, out, seed, tare, parallel.jobs, quick=quick, full=full,
            notify=print_message, steps=progress
        )  # fmt: skip
        tables = run_study(
            plan, out, engine, progress=progress, notify=print_message, force=force,
            made_in=time.perf_counter() - started_at, left_out=left_out,
        )  # fmt: skip
    except KeyboardInterrupt:
        print_message(f"the finished part is in {out}: the same command continues it")
        raise
    if as_json:
        print_json(json.decode((out / "study.json").read_bytes()))
        return
    for table in tables:
        if table.name in PRINTED_COLUMNS:
            print_main_table(table)
    print_line(f"{out / 'report.md'}: all {len(tables)} tables and the figures")
