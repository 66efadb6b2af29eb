"""`holdfast calibrate`: a model with the own handling of a hand, without labels."""

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import (
    RARE,
    ForceOption,
    JsonOption,
    ModelArgument,
    ModelOutput,
    SpeedOption,
    StartOptions,
    check_seconds,
    check_speed,
    complete_source,
)
from holdfast.cli.terminal.console import (
    format_number,
    print_json,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)
from holdfast.cli.terminal.control import handle_stop_signals
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from holdfast.model import Model
    from holdfast.recordings import Recording
    from holdfast.training.calibration import CalibratedModel

PROGRESS_STEP = 3.0
"""Held time between two lines of progress [s]."""
HANDLING_SECONDS = 60.0
"""Time for which a live source is recorded, unless `--seconds` is given [s]."""

ROWS = (
    ("STABLE in the held samples [%]", "stable", 1),
    ("alarms per minute of holding", "alarms_per_minute", 1),
    ("threshold of STABLE", "threshold", 3),
    ("slip reported in the held samples [%]", "raised", 1),
    ("threshold of a slip", "slip_threshold", 3),
)
"""Text, field of the figures and number of digits of each row of the table."""


def calibrate(
    model: ModelArgument,
    data: Annotated[
        str,
        typer.Argument(
            help="A recording, a folder of them, URI of a source, or hand (of holdfast.toml).",
            callback=complete_source,
        ),
    ],
    out: ModelOutput,
    *,
    false_alarms: Annotated[
        float | None,
        typer.Option(
            "--false-alarms",
            help="Maximum number of alarms per minute of this handling; by default, 95 % "
            "of it is STABLE.",
        ),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds", help="Time for which a live source is recorded [s].", show_default="60"
        ),
    ] = None,
    speed: Annotated[SpeedOption, RARE] = 1.0,
    start: StartOptions,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit a model to a hand by a minute of handling, without labels.

    Write a copy of the model in which every feature is normalised by what it is on this sensor
    while it is used as usual: grasp, carry, turn, put down, without slip. The thresholds are set
    by the same handling. Begin with an open hand, or give --in-contact. A tenth of the handling
    may be slip. If the arm hardly moves, or the decisions about this handling get worse, nothing
    is written without --force.

    DATA are recordings, or a live source such as xela://HOST:PORT or twin:?object=can, which is
    recorded for --seconds and not kept. At least 5 s of holding are needed, 30 s are better.
    Models whose features are not normalised are refused: use builtin:any.

    Example:
      holdfast calibrate builtin:any handling/ -o mine.json
      holdfast calibrate builtin:any xela://auto -o mine.json --seconds 60
      holdfast calibrate builtin:any handling/ -o mine.json --false-alarms 1
    """
    from holdfast.devices.uri import is_uri
    from holdfast.errors import TrainingError
    from holdfast.files import refuse_overwrite
    from holdfast.model import Model
    from holdfast.training.calibration import calibrate_with_report, check_normalised

    refuse_overwrite(out, force=force)  # before a minute of handling is recorded
    check_seconds(seconds)
    loaded = Model.load(model)
    check_normalised(loaded)
    live = is_uri(data)
    if not live and (seconds is not None or speed != 1.0):
        raise ValueError(f"--seconds and --speed are for live sources; {data} is a recording")
    check_speed(data, speed)
    recordings: Sequence[Recording]
    if live:
        recordings = [_recorded(loaded, data, seconds or HANDLING_SECONDS, speed, start)]
    else:
        recordings = start.load_dataset(data, labels=False)
    calibrated = calibrate_with_report(
        loaded, recordings, false_alarms=false_alarms, progress=lambda x: progress(x, "reading")
    )
    try:
        calibrated.check()
    except TrainingError as refusal:  # a calibration that makes the model worse
        if not force:
            raise TrainingError(f"{refusal} (--force saves all the same)") from None
    calibrated.model.save(out, force=force)
    for warning in calibrated.warnings:
        print_message(warning)
    if as_json:
        print_json({"model": out, "sensors": calibrated.sensors, "warnings": calibrated.warnings})
        return
    _print(calibrated, out)


def _recorded(
    model: "Model", data: str, seconds: float, speed: float, start: StartOptions
) -> "Recording":
    """Return the handling of a live source, and print how much of it is held.

    Raises:
        SourceError: the source cannot be opened, or no samples arrived.
    """
    from holdfast.devices import sources
    from holdfast.errors import SourceError
    from holdfast.live.handling import HandlingBuffer
    from holdfast.training.own_handling import ENOUGH_HANDLING

    with handle_stop_signals() as stop, sources.open_source(data, speed=speed) as source:
        # Ctrl-C before ends the wait for the source; from here on it ends the recording.
        stop.graceful = True
        print_message(f"recording {source.name} for {seconds:g} s; Ctrl-C stops")
        stream = start.create_stream(model, source)
        buffer, shown = HandlingBuffer(stream), 0.0
        # One second more than the handling: a source that falls silent is not awaited for ever.
        end = time.monotonic() + (seconds / speed + 1.0 if speed else math.inf)
        while not (source.ended or stop.requested or time.monotonic() > end):
            buffer.put(stream.read())
            if buffer.seconds >= shown + PROGRESS_STEP:
                shown = buffer.seconds
                print_message(f"held {shown:.0f} of {ENOUGH_HANDLING:g} s")
            if buffer.duration >= seconds:
                break
    if not buffer.has_samples:
        raise SourceError(f"{source.name} sent no samples: nothing was recorded")
    return buffer.recording()


def _print(calibrated: "CalibratedModel", out: Path) -> None:
    for summary in calibrated.sensors:
        print_paragraph(summary.text())
        rows = [
            (title, *(format_number(getattr(figures, field), digits) for figures in columns))
            for title, field, digits in ROWS
            for columns in [(summary.before, summary.after)]
        ]
        print_table(("", "before", "after"), rows)
        print_line()
    print_line(f"{out}: {calibrated.model.name or 'the model'}")
