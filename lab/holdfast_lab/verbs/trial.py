"""`holdfast trial`: grip laws against each other on the twin."""

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from holdfast.cli.options import (
    EngineOptions,
    ForceOption,
    JsonOption,
    SeedOption,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress
from holdfast_lab.verbs import OutOption, QuickOption

N_TRIALS, N_QUICK_TRIALS = 240, 60
"""Number of trials; 60 have every object with every kind of load once."""


def trial(
    out: OutOption,
    *,
    laws: Annotated[
        str,
        typer.Option("--laws", help="Laws or reference rows, separated by commas; all by default."),
    ] = "",
    model: Annotated[
        str,
        typer.Option(
            "--model",
            help="Model of the detector: builtin:twin, one that was taught, or builtin:any, for "
            "which the hand of the twin is new.",
        ),
    ] = "builtin:twin",
    quick: QuickOption = False,
    n: Annotated[
        int | None, typer.Option("--n", help="Number of trials.", show_default=str(N_TRIALS))
    ] = None,
    seed: SeedOption = 0,
    plant: Annotated[str, typer.Option("--plant", help="Hand of the twin: mild or hard.")] = "mild",
    impacts: Annotated[
        int, typer.Option("--impacts", help="Impacts of tools before the load of each trial.")
    ] = 0,
    parallel: EngineOptions,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compare laws of grip force on the twin, all on the same trials.

    In each trial the hand of the twin grips an object lightly, and then a load comes: added
    weight, a pull, friction that drops, a shake, or a fast transport. Objects, loads and grips
    follow from the seed. Write OUT/report.md, trial.json, trials.csv, and each table
    and figure. Finished trials are kept in OUT/work, also with --force, so the same
    command continues a comparison that was stopped, and one more law runs only its own trials.
    There are 240 trials, or 60 with --quick. --plant hard adds latency, backlash, friction of the
    joints, the lag of the motors and more jerks of the hand's controller.
    docs/study/grip.md describes them.

    Example:
      holdfast trial --out trials --quick --jobs -1
      holdfast trial --out trials --laws fixed,holdfast --n 12 --json
      holdfast trial --out trials-hard --plant hard
    """
    from holdfast_lab.report.folder import check_output_folder
    from holdfast_lab.trial.experiment import COMPARISON, run_trials
    from holdfast_lab.trial.plan import ALL_ROWS, TrialPlan

    names = tuple(name.strip() for name in laws.split(",")) if laws else ALL_ROWS
    number = n if n is not None else N_QUICK_TRIALS if quick else N_TRIALS
    plan = TrialPlan(names, number, seed, model, plant, impacts)
    check_output_folder(out, COMPARISON, force=force)
    chosen = parallel.start()
    try:
        document = run_trials(
            plan, out, chosen, progress=progress, notify=print_message, force=force
        )
    except KeyboardInterrupt:
        print_message(f"the finished trials are in {out}: the same command continues them")
        raise
    if as_json:
        print_json(document)
    else:
        _print_table(document["laws"])
        print_line(f"{out / 'report.md'}: all tables and figures")


def _print_table(laws: Mapping[str, Mapping[str, Any]]) -> None:
    """Print a row for each law; infinite values as `inf`, unknown ones as `-`."""
    print_line(
        f"{'law':16}{'n':>5}{'dropped':>9}{'slip':>9}{'reaction':>10}{'force':>7}{'false':>8}"
    )
    print_line(f"{'':16}{'':>5}{'%':>9}{'mm':>9}{'ms':>10}{'ratio':>7}{'/min':>8}")
    for law, row in laws.items():
        numbers = [
            _text(row["dropped"], 1.0, 9, 1),
            _text(row["slip_median"], 1e3, 9, 2, infinite=row["n"] > 0),
            _text(row["reaction_median"], 1e3, 10, 0, infinite=row["n_reacting"] > 0),
            _text(row["force_ratio_mean"], 1.0, 7, 2),
            _text(row["false_reactions_per_minute"], 1.0, 8, 1),
        ]
        print_line(f"{law:16}{row['n']:5}{''.join(numbers)}")


def _text(
    number: Mapping[str, Any], factor: float, width: int, digits: int, *, infinite: bool = False
) -> str:
    value = number["value"]
    if value is None:
        return f"{'inf' if infinite else '-':>{width}}"
    return f"{factor * value:{width}.{digits}f}"
