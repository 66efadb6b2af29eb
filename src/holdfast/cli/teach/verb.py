"""`holdfast teach`: slips of the user's own hand, guided, or from labelled recordings."""

from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.options import (
    RARE,
    EngineOptions,
    ForceOption,
    JsonOption,
    ModelOutput,
    SeedOption,
    SpeedOption,
    StartOptions,
    check_source,
    report_too_few_taxels,
)
from holdfast.cli.teach.options import WITHOUT_PROTOCOL, GuideOptions, calibrated
from holdfast.cli.terminal.console import print_json, print_line, print_message, print_paragraph
from holdfast.cli.terminal.progress import progress
from holdfast.errors import TrainingError


def teach(
    source: Annotated[
        str,
        typer.Argument(
            help="URI of the hand, or twin:; leave it out with --from.",
            callback=check_source,
            show_default=False,
        ),
    ] = "",
    *,
    out: ModelOutput,
    data: Annotated[
        Path | None,
        typer.Option(
            "--from", help="A folder of recordings of the hand, with labels of slips; no protocol."
        ),
    ] = None,
    guide: GuideOptions = WITHOUT_PROTOCOL,
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
    speed: Annotated[SpeedOption, RARE] = 1.0,
    parallel: EngineOptions,
    seed: Annotated[SeedOption, RARE] = 0,
    force: ForceOption = False,
    start: StartOptions,
    as_json: JsonOption = False,
) -> None:
    """Teach a model the slips of your own hand.

    With a SOURCE, it leads through a protocol of some ten minutes: open hand, carry, pulls and
    pushes until it slides, taps, knocks and pushes that do not. Each grasp is checked at once and
    recorded into a folder. It sends nothing to any hand. Slips are measured by --camera and
    stickers (holdfast label markers); without one it ends with a calibration. Keys: Enter goes on,
    r repeats, s skips, 1-9 throws a slide away, q quits; a robot sends the lines next, repeat, skip
    and quit on stdin. After a break, --resume goes on at the step.

    Then a copy of the model is written whose slip rule is fitted to these recordings alone.
    Stability and causes stay those of the model. Figures and threshold come from grasps that the
    rule was not fitted to. With --from, the recordings are there, with labels of a person or of a
    rule.

    Example:
      holdfast teach xela://auto -o mine.json --camera 0
      holdfast teach twin: -o mine.json --unattended
      holdfast teach --from grasps/ -o mine.json --false-alarms 0.5
    """
    from holdfast.cli.teach.report import NO_SLIPS, print_taught
    from holdfast.detection import Model
    from holdfast.files import refuse_overwrite
    from holdfast.training.teaching import teach_with_report

    guide.check(source, data, speed)
    refuse_overwrite(out, force=force)
    base_model, engine = Model.load(model), parallel.start()
    base, steps, path = base_model, [], data
    if path is None:
        folder = guide.run(source, base_model, out, speed)
        base, is_calibrated = calibrated(base_model, folder)
        steps, path = folder.results, folder.path
        if not any(result.n_slides for result in folder.kept):
            if not is_calibrated:
                raise TrainingError(f"nothing was learned from {path}: no slip was measured")
            base.save(out, force=force)
            if as_json:
                print_json({"model": out, "steps": steps, "heads": {}, "verdict": NO_SLIPS})
            else:
                print_paragraph(f"{out}: {NO_SLIPS}")
            return
    recordings = start.load_dataset(engine.path(path))
    taught = teach_with_report(
        base, recordings, false_alarms=false_alarms, seed=seed, engine=engine, progress=progress
    )
    taught.model.save(out, force=force)
    report_too_few_taxels(taught.model, recordings)
    for warning in taught.warnings:
        print_message(warning)
    if as_json:
        print_json({**taught.document(out), "steps": steps})
        return
    print_taught(taught, base_model.name or model)
    print_line()
    print_line(f"{out}: taught by {taught.n_recordings} recordings")
