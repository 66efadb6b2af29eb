"""`holdfast detect`: the contact state of every finger at every sample."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.csv_options import CsvOptions
from holdfast.cli.options import (
    DetectorOptions,
    JsonOption,
    ModelArgument,
    PlotOptions,
    SecondsOption,
    SourceArgument,
    StartOptions,
    check_seconds,
)
from holdfast.cli.terminal.console import print_message
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from holdfast.detection import Model
    from holdfast.recordings import Recording


def detect(
    model: ModelArgument,
    source: SourceArgument,
    summary: Annotated[
        bool,
        typer.Option(
            "--summary", help="Print the share of each state, the contact events, and the slips."
        ),
    ] = False,
    *,
    options: DetectorOptions,
    start: StartOptions,
    csv: CsvOptions,
    figure: PlotOptions,
    seconds: SecondsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Detect the contact state of every finger at every sample.

    On a terminal, print one line for each change of state that lasted 0.1 s, and one when a slip
    begins and when it ends. In a pipe or file, or with --json, print one line of JSON per finger
    and sample, in the order of time: time [s], finger, state, reason (of UNKNOWN, UNSTABLE),
    stable_probability, instability (sigma) and force (both in the unit of the readings), faults,
    faulty_taxels, cause (slip while the finger slides), slip_probability, slip_speed [mm/s] and
    slip_distance [mm]. Values that are not known are null. The memory does not grow with the
    length of the recording.

    SOURCE is the path of a recording, or the URI of a live source, which is read until Ctrl-C or
    for --seconds:
    xela://HOST:PORT (or xela://auto), twin:?object=can, ros2:///xServTopic or
    serial:///dev/ttyACM0?sensor=anyskin. A CSV file is read directly, as holdfast import does,
    into memory.

    Example:
      holdfast detect model.json grasp.parquet > states.jsonl
      holdfast detect builtin:any xela://auto
      holdfast detect builtin:noise-floor grasp.mcap --summary
      holdfast detect builtin:any press.csv --sensor sensor.json
      holdfast detect builtin:any grasp.parquet --summary --plot states.png
    """
    from holdfast.cli.detect.estimates import detect_live, detect_recording
    from holdfast.cli.detect.output import print_changes, print_estimates, print_summary
    from holdfast.devices.uri import is_uri
    from holdfast.io import load_recording

    live = is_uri(source)
    if seconds is not None and not live:
        raise ValueError(f"--seconds is for live sources; {source} is a recording")
    check_seconds(seconds)
    if live and figure.plot is not None:
        raise ValueError(f"--plot draws one recording; the live source {source} given")
    figure.check()
    is_csv = csv.fits(source)
    loaded = options.load_model(model)
    if live:
        chunks = detect_live(loaded, source, options, start, seconds)
    else:
        recordings = csv.read(Path(source)) if is_csv else []
        if len(recordings) > 1:
            raise ValueError(f"one recording expected, {len(recordings)} given: {source}")
        recording = recordings[0] if is_csv else None
        chunks = detect_recording(loaded, Path(source), options, start, recording)
        figure.save(lambda: _drawn(loaded, start.of(recording or load_recording(source))))
        if summary or not (as_json and sys.stdout.isatty()):  # lines on the screen need no bar
            chunks = progress(chunks, "detecting")
    shows_changes = sys.stdout.isatty() and not as_json
    if loaded.slip_advice and (summary or shows_changes):  # where a slip would be shown
        print_message(loaded.slip_advice)
    if summary:
        print_summary(chunks, model, as_json=as_json)
    elif shows_changes:
        print_changes(chunks, live=live)
    else:
        print_estimates(chunks, live=live)


def _drawn(model: "Model", recording: "Recording") -> "Figure":
    """Return a figure of the force of each finger over time, on the colours of its states."""
    from holdfast.detection import detect as detect_whole
    from holdfast.plots.detection import figure_of_detection

    return figure_of_detection(detect_whole(model, recording))
