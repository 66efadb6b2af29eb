"""`holdfast trial`: grip laws against each other on the twin."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.options import JobsOption, JsonOption, SeedOption
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import ProgressBar

if TYPE_CHECKING:
    from holdfast.control.trial.run import TrialResult

N_TRIALS, N_QUICK_TRIALS = 240, 60
"""Number of trials; 60 have every object with every kind of load once."""


def trial(
    out: Annotated[Path, typer.Option("--out", help="Folder for trial.json, created if missing.")],
    laws: Annotated[
        str, typer.Option("--laws", help="Laws to compare, separated by commas; all by default.")
    ] = "",
    model: Annotated[str, typer.Option("--model", help="Model of the detector.")] = "builtin:any",
    quick: Annotated[
        bool, typer.Option("--quick", help=f"{N_QUICK_TRIALS} trials instead of {N_TRIALS}.")
    ] = False,
    n: Annotated[
        int | None, typer.Option("--n", help="Number of trials.", show_default=str(N_TRIALS))
    ] = None,
    seed: SeedOption = 0,
    jobs: JobsOption = -1,
    engine: Annotated[
        str, typer.Option("--engine", help="Where to compute: loky, or dask:ADDRESS.")
    ] = "loky",
    force: Annotated[bool, typer.Option("--force", help="Overwrite trial.json.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Compare laws of grip force on the twin, all on the same trials.

    In each trial the hand of the twin grips an object lightly, and then a load comes: added
    weight, a pull, friction that drops, a shake, or a fast transport. Objects, loads and grips
    follow from the seed. docs/grip.md describes the trials and the numbers.

    Example:
      holdfast trial --out trials --quick
      holdfast trial --out trials --laws fixed,holdfast --n 12 --json
    """
    from holdfast.control.laws import LAWS, law_named
    from holdfast.files import refuse_overwrite
    from holdfast.model import Model
    from holdfast.parallel import Engine

    names = [name.strip() for name in laws.split(",")] if laws else list(LAWS)
    for name in names:
        law_named(name)
    if n is not None and n < 1:
        raise ValueError(f"--n: at least 1 trial expected, {n} given")
    Model.load(model)
    chosen = Engine.parse(engine, jobs)
    out.mkdir(parents=True, exist_ok=True)
    refuse_overwrite(out / "trial.json", force=force)
    number = n or (N_QUICK_TRIALS if quick else N_TRIALS)
    results = _run(names, number, seed, model, chosen)
    document = _document(names, results, seed, model)
    _write(out / "trial.json", document, force=force)
    if as_json:
        print_json(document)
    else:
        _print_table(document["laws"])
        print_message(f"{out / 'trial.json'} written")


def _run(
    laws: Sequence[str],
    n: int,
    seed: int,
    model: str,
    engine: Any,  # noqa: ANN401 (imported late)
) -> "list[TrialResult]":
    from holdfast.control.trial.run import run_trial
    from holdfast.control.trial.trials import draw_trials

    calls = [(one, law, model) for one in draw_trials(n, seed) for law in laws]
    results = []
    with ProgressBar("trials", len(calls)) as bar:
        for result in engine.map_ordered(run_trial, calls):
            results.append(result)
            bar.advance()
    return results


def _document(
    laws: Sequence[str], results: "Sequence[TrialResult]", seed: int, model: str
) -> dict[str, Any]:
    import msgspec

    from holdfast.control.trial.summary import summarize
    from holdfast.report.environment import versions

    by_law = {law: [one for one in results if one.law == law] for law in laws}
    unseen = {law: [one for one in each if one.unseen] for law, each in by_law.items()}
    return {
        "laws": {law: summarize(each) for law, each in by_law.items()},
        "unseen_objects": {law: summarize(each) for law, each in unseen.items()},
        "trials": msgspec.json.decode(msgspec.json.encode(results)),
        "model": model,
        "seed": seed,
        "versions": versions(),
    }


def _write(path: Path, document: Mapping[str, Any], *, force: bool) -> None:
    from holdfast.files import write_whole

    write_whole(path, json.dumps(document, indent=1).encode(), force=force)


def _print_table(laws: Mapping[str, Mapping[str, Any]]) -> None:
    """Print a row for each law; unlimited values as `inf`."""
    print_line(
        f"{'law':16}{'n':>5}{'dropped':>9}{'slip':>9}{'reaction':>10}{'force':>7}{'false':>8}"
    )
    print_line(f"{'':16}{'':>5}{'%':>9}{'mm':>9}{'ms':>10}{'ratio':>7}{'/min':>8}")
    for law, row in laws.items():
        numbers = [
            _text(row["dropped"], 1.0, 9, 1),
            _text(row["slip_median"], 1e3, 9, 2),
            _text(row["reaction_median"], 1e3, 10, 0),
            _text(row["force_ratio_mean"], 1.0, 7, 2),
            _text(row["false_reactions_per_minute"], 1.0, 8, 1),
        ]
        print_line(f"{law:16}{row['n']:5}{''.join(numbers)}")


def _text(number: Mapping[str, Any], factor: float, width: int, digits: int) -> str:
    value = number["value"]
    return f"{'inf':>{width}}" if value is None else f"{factor * value:{width}.{digits}f}"
