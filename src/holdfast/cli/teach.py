"""`holdfast teach`: slips of the user's own hand, from recordings in which they are labelled."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import (
    RARE,
    EngineOptions,
    ForceOption,
    JsonOption,
    ModelOutput,
    SeedOption,
    StartOptions,
)
from holdfast.cli.scores import (
    SHARES_HEADER,
    SHARES_NOTE,
    format_intervals,
    never_cells,
    share_cells,
)
from holdfast.cli.terminal.console import (
    print_json,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.training.teaching import Taught


def teach(
    out: ModelOutput,
    data: Annotated[
        Path,
        typer.Option("--from", help="A folder of recordings of the hand, with labels of slips."),
    ],
    *,
    model: Annotated[
        str, typer.Option("--model", help="Model whose other answers are kept.")
    ] = "builtin:any",
    false_alarms: Annotated[
        float,
        typer.Option(
            "--false-alarms",
            help="False alarms of slip per minute of held time of a finger that are wanted at "
            "most.",
        ),
    ] = 1.5,
    parallel: EngineOptions,
    seed: Annotated[SeedOption, RARE] = 0,
    force: ForceOption = False,
    start: StartOptions,
    as_json: JsonOption = False,
) -> None:
    """Teach a model the slips of your own hand.

    Write a copy of the model whose slip rule is fitted to these recordings alone. Stability and
    causes stay those of the model. The slips are those of the labels: of a person, or of a rule
    such as label auto tracking with a video. Held samples outside them teach what is no slip, so
    push, tap and carry the object as well.

    About 30 slips of fingers, half in pulls and half in pushes, in ten grasps are enough. Three
    slips in two recordings suffice, with a warning. Figures and threshold come from grasps that
    the rule was not fitted to.

    Example:
      holdfast teach --from grasps/ -o mine.json
      holdfast teach --from grasps/ -o mine.json --false-alarms 0.5
      holdfast teach --from grasps/ -o mine.json --model builtin:twin
    """
    from holdfast.files import refuse_overwrite
    from holdfast.model import Model
    from holdfast.training.teaching import teach_with_report

    refuse_overwrite(out, force=force)
    given, engine = Model.load(model), parallel.start()
    taught = teach_with_report(
        given, start.load_dataset(engine.path(data)),
        false_alarms=false_alarms, seed=seed, engine=engine, progress=progress,
    )  # fmt: skip
    taught.model.save(out, force=force)
    for warning in taught.warnings:
        print_message(warning)
    if as_json:
        print_json(taught.document(out))
        return
    _print(taught, given.name or model)
    print_line()
    print_line(f"{out}: taught by {taught.n_recordings} recordings")


def _print(taught: "Taught", base: str) -> None:
    """Print what was found out of fold, beside the model that was given and beside nothing."""
    pooled = taught.slips.pooled
    print_paragraph(taught.verdict)
    print_line()
    rows = [("taught", *share_cells(pooled))]
    if taught.base is not None:
        rows.append((base, *share_cells(taught.base.pooled)))
    rows.append(("never", *never_cells(pooled)))
    print_table(("", *SHARES_HEADER), rows)
    print_paragraph(SHARES_NOTE)
    if taught.slips.intervals is not None:
        print_paragraph(format_intervals(taught.slips.intervals, chosen=False))
