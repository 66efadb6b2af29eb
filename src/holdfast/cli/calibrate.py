"""`holdfast calibrate`: a model with the own handling of a hand, without labels."""

import shlex
from typing import Annotated

import typer

from holdfast.cli.options import (
    ForceOption,
    JsonOption,
    ModelArgument,
    ModelOutput,
    SpeedOption,
    StartOptions,
    check_seconds,
    check_source,
    check_speed,
    report_too_few_taxels,
)
from holdfast.cli.terminal.console import (
    print_json,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)
from holdfast.cli.terminal.control import handle_stop_signals
from holdfast.cli.terminal.progress import progress

HANDLING_SECONDS = 120.0
"""Time for which a live source is recorded, unless `--seconds` is given [s]."""


def calibrate(
    model: ModelArgument,
    data: Annotated[
        str,
        typer.Argument(
            help="A recording, a folder of them, or URI of a source.", callback=check_source
        ),
    ],
    out: ModelOutput,
    *,
    false_alarms: Annotated[
        float,
        typer.Option(
            help="Maximum number of false alarms of slips per minute of held time of a finger."
        ),
    ] = 1.0,
    seconds: Annotated[
        float | None,
        typer.Option(help="Time for which a live source is recorded [s].", show_default="120"),
    ] = None,
    speed: SpeedOption = 1.0,
    start: StartOptions,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit a model to a hand by two minutes of handling, without labels.

    Write a copy of the model in which every feature of stability is normalised by what it is on
    this sensor while it is used as usual: grasp, carry, turn, push, put down, without slip. The
    same handling sets the thresholds: that of slips is the lowest with at most --false-alarms,
    or the model reports no slip. Begin with an open hand, or give --in-contact. A tenth of the
    handling may be slip for stability; where it has labels, a hundredth. If the arm hardly moves,
    or the decisions about this handling get worse, nothing is written without --force.

    DATA are recordings, or a live source such as xela://HOST:PORT or twin:, which is recorded for
    --seconds and not kept; the twin handles one object after the other. At least 5 s of holding
    are needed; two minutes with pushes that hold bound the false alarms.
    Models whose features are not normalised are refused: use builtin:any.

    Example:
      holdfast calibrate builtin:any handling/ -o mine.json
      holdfast calibrate builtin:any xela://auto -o mine.json --seconds 60
      holdfast calibrate builtin:any 'twin:?seed=3' -o mine.json
    """
    from holdfast.detection import Model
    from holdfast.devices import sources
    from holdfast.devices.uri import is_uri
    from holdfast.files import refuse_overwrite
    from holdfast.live.handling import record_handling
    from holdfast.training.calibration import calibrate_with_report, check_normalised

    refuse_overwrite(out, force=force)  # before a minute of handling is recorded
    check_seconds(seconds)
    loaded = Model.load(model)
    check_normalised(loaded)
    live = is_uri(data)
    if not live and (seconds is not None or speed != 1.0):
        raise ValueError(f"--seconds and --speed are for live sources; {data} is a recording")
    check_speed(data, speed)
    recorded, source_name = None, data if live else "SOURCE"
    if live:
        data, is_twin = _handled(data)
        opened = sources.open_source(data, speed=speed, loop=is_twin)
        with handle_stop_signals() as stop, opened as source:
            # Ctrl-C before ends the wait for the source; from here on it ends the recording.
            stop.graceful = True
            duration = seconds or HANDLING_SECONDS
            print_message(f"recording {source.name} for {duration:g} s; Ctrl-C stops")
            stream = start.create_stream(loaded, source)
            recorded = record_handling(
                stream, duration, speed, lambda: stop.requested, print_message
            )
    recordings = [recorded] if recorded is not None else start.load_dataset(data)
    if recorded is None:
        report_too_few_taxels(loaded, recordings)
    calibrated = calibrate_with_report(
        loaded, recordings, false_alarms=false_alarms, progress=lambda x: progress(x, "reading")
    )
    if not force:  # a calibration that makes the model worse
        calibrated.check(" (--force saves all the same)")
    calibrated.model.save(out, force=force)
    for warning in calibrated.warnings:
        print_message(warning)
    advice = calibrated.next_step(shlex.quote(str(out)), shlex.quote(source_name), false_alarms)
    if as_json:
        print_json({
            "model": out, "sensors": calibrated.sensors, "warnings": calibrated.warnings,
            "next": advice,
        })  # fmt: skip
        return
    for summary in calibrated.sensors:
        print_paragraph(summary.text())
        print_table(("", "before", "after"), summary.rows())
        for slips in summary.slips:
            print_paragraph(slips.text())
        print_line()
    print_line(f"{out}: {calibrated.model.name or 'the model'}")
    print_paragraph(f"Next: {advice}")


def _handled(uri: str) -> tuple[str, bool]:
    """Return the URI of a source, the twin's with its profile of handling, and whether it is one.

    The twin grasps again until the time is over.
    """
    from holdfast.devices.uri import parse

    scheme, address = parse(uri)
    if scheme != "twin" or "profile" in address.parameters:
        return uri, scheme == "twin"
    return f"{uri}{'&' if address.parameters else '?'}profile=handling", True
