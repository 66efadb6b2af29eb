"""`holdfast detect`: the contact state of every finger at every sample."""

import math
import sys
import time
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.csv_options import CsvOptions
from holdfast.cli.options import (
    RARE,
    DetectorOptions,
    JsonOption,
    ModelArgument,
    RatePolicy,
    SecondsOption,
    SourceArgument,
    StartOptions,
    check_seconds,
    parse_taxels,
    report_blind_features,
    report_missing_fingers,
    report_missing_slip_rules,
    report_other_handling,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.control import StopRequest, handle_stop_signals
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.cli.detect.output import EstimateChunk
    from holdfast.live.stream_detector import StreamDetector, StreamUpdate
    from holdfast.model import Model
    from holdfast.recordings import Recording

CHUNK_SIZE = 4096
"""Number of samples that are read and processed at a time; it bounds the memory."""


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
    csv: Annotated[CsvOptions, RARE],
    seconds: SecondsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Detect the contact state of every finger at every sample.

    On a terminal, print one line for each change of state that lasted 0.1 s, and one when a slip
    begins and when it ends. In a pipe or file, or with --json, print one line of JSON per finger
    and sample, in the order of time: time [s], finger, state, reason (why the state is UNKNOWN),
    stable_probability, instability (sigma) and force (both in the unit of the readings), faults,
    faulty_taxels, cause (slip while the finger slides), slip_probability, slip_speed [mm/s] and
    slip_distance [mm]. Values that are not known are null. The memory does not grow with the
    length of the recording.

    SOURCE is the path of a recording, or the URI of a live source, which is read until Ctrl-C or
    for --seconds:
    xela://HOST:PORT (or xela://auto), twin:?object=can, ros2:///xServTopic, ros1:///xServTopic
    or serial:///dev/ttyACM0?sensor=anyskin. A CSV file is read directly, as holdfast import does,
    into memory.

    Example:
      holdfast detect model.json grasp.parquet > states.jsonl
      holdfast detect builtin:any xela://auto
      holdfast detect builtin:noise-floor grasp.mcap --summary
      holdfast detect builtin:any press.csv --sensor sensor.json
      holdfast detect model.json grasp.parquet --debounce 0.05 --hysteresis 0.1
    """
    from holdfast.devices.uri import is_uri

    live = is_uri(source)
    if seconds is not None and not live:
        raise ValueError(f"--seconds is for live sources; {source} is a recording")
    check_seconds(seconds)
    is_csv = csv.fits(source)
    loaded = options.load_model(model)
    if live:
        chunks = _detect_live(loaded, source, options, start, seconds)
    else:
        recording = _single(csv.read(Path(source)), source) if is_csv else None
        chunks = _detect_recording(loaded, Path(source), options, start, recording)
        if summary or not (as_json and sys.stdout.isatty()):  # lines on the screen need no bar
            chunks = progress(chunks, "detecting")
    if summary:
        _print_summary(chunks, model, as_json=as_json)
        return
    if sys.stdout.isatty() and not as_json:
        _print_changes(chunks, live=live)
    else:
        _print_estimates(chunks, live=live)


def _print_estimates(chunks: Iterator["EstimateChunk"], *, live: bool) -> None:
    from holdfast.cli.detect.output import json_lines

    for chunk in chunks:
        for text in json_lines(chunk):
            sys.stdout.write(text)
        if live:
            sys.stdout.flush()


def _print_changes(chunks: Iterator["EstimateChunk"], *, live: bool) -> None:
    """Print the changes that lasted: of a live source at once, else below the progress bar."""
    from holdfast.cli.detect.output import HEADER, ChangeLines

    changes = ChangeLines(from_first=live)
    if live:
        print_message("times since the first sample; --json prints every estimate; Ctrl-C stops")
        print_line(HEADER)
        for chunk in chunks:
            for line in changes.add(chunk):
                print_line(line)
                sys.stdout.flush()
        return
    lines = [line for chunk in chunks for line in changes.add(chunk)]
    if changes.origin:
        print_message(f"times since the first sample, at {changes.origin:.3f} s")
    for line in (HEADER, *lines):
        print_line(line)


def _print_summary(chunks: Iterator["EstimateChunk"], model: str, *, as_json: bool) -> None:
    from holdfast.cli.detect.output import DetectionSummary

    summary = DetectionSummary()
    for chunk in chunks:
        summary.add(chunk)
    if as_json:
        print_json({"model": model, **summary.to_dict()})
    else:
        summary.print()


def _single(recordings: "list[Recording]", source: str) -> "Recording":
    """Return the only recording of a source.

    Raises:
        ValueError: there are several.
    """
    if len(recordings) > 1:
        raise ValueError(f"one recording expected, {len(recordings)} given: {source}")
    return recordings[0]


def _detect_recording(
    model: "Model",
    path: Path,
    options: DetectorOptions,
    start: StartOptions,
    recording: "Recording | None",
) -> Iterator["EstimateChunk"]:
    """Yield the estimates of the recording at a path; None if it is read from there."""
    from holdfast.cli.detect.output import chunk_from_detection
    from holdfast.detector import Detector
    from holdfast.live.readings_monitor import ReadingsMonitor

    detector = None
    for part in map(start.of, _read_parts(model, path, options.rate, recording)):
        if detector is None:
            sensors = {name: module.sensor for name, module in part.modules.items()}
            taxels = parse_taxels(options.ignore, sensors)
            detector = Detector.for_recording(model, part, ignore=taxels)
            report_missing_fingers(model, part.name, part.modules)
            report_missing_slip_rules(model)
            used = model.fingers_of(sensors)
            report_other_handling(model, used)
            report_blind_features(model, used)
            readings = ReadingsMonitor(used, finds_pull=not part.starts_loaded)
        for notice in readings.update_recording(part):
            print_message(notice)
        yield chunk_from_detection(detector.run(part))


def _read_parts(
    model: "Model", path: Path, rate: RatePolicy, recording: "Recording | None"
) -> Iterator["Recording"]:
    """Yield the recording, that of the path if it is None, at the model's rate.

    It comes in parts, or as a whole if it is resampled or its tare is an interval.
    """
    from holdfast.errors import ModelError, RecordingError
    from holdfast.features import Tare
    from holdfast.io import load_recording, read_chunks
    from holdfast.resampling import resample, true_updates

    def whole() -> "Recording":
        return true_updates(recording or load_recording(path, labels=False))

    parts = iter([recording]) if recording else read_chunks(path, CHUNK_SIZE, labels=False)
    first = next(parts, None)
    if first is None:
        raise RecordingError(f"{path} has no samples; at least one expected")
    model.fingers_of({name: module.sensor for name, module in first.modules.items()})
    if not first.complete:
        print_message(f"{path} is cut off: only its readable part is used")
    updates = true_updates(first)
    if updates is not first:
        print_message(
            f"{path}: readings repeat in rows of {first.rate:.4g} Hz; "
            f"the true updates are used, {updates.rate:.4g} Hz"
        )
        first, parts = whole(), iter(())
    if model.rate is None or model.rate_fits(first.rate):
        if Tare.parse(model.tare).kind == "interval":
            return iter([whole()])
        return chain([first], parts)
    given = f"{path}: {first.rate:.4g} Hz given, the model expects {model.rate:g} Hz"
    if rate is RatePolicy.STRICT:
        raise ModelError(f"{given} within 20 % (--rate resample accepts it)")
    print_message(f"{given}: resampled")
    return iter([resample(whole(), model.rate)])


def _detect_live(
    model: "Model",
    uri: str,
    options: DetectorOptions,
    start: StartOptions,
    seconds: float | None,
) -> Iterator["EstimateChunk"]:
    """Yield the estimates of each arrival, until a signal or for `seconds`."""
    from holdfast.cli.detect.output import chunk_from_stream
    from holdfast.devices.sources import open_source

    with handle_stop_signals() as stop, open_source(uri) as source:
        stream = options.create_stream(model, source, start)
        report_missing_slip_rules(model)
        stop.graceful = True
        for update in _read_updates(stream, seconds, stop):
            yield chunk_from_stream(source.name, update.estimates)


def _read_updates(
    stream: "StreamDetector", seconds: float | None, stop: StopRequest
) -> Iterator["StreamUpdate"]:
    from holdfast.live.fault_notices import FaultWatch

    end = math.inf if seconds is None else time.monotonic() + seconds
    faults = FaultWatch()
    while not (stream.source.ended or stop.requested) and time.monotonic() < end:
        update = stream.read()
        for notice in update.arrival.notices if update.arrival else ():
            print_message(notice)
        for estimate in update.estimates:
            for problem in faults.update(estimate.estimate):
                print_message(problem.text)
        yield update
    yield stream.finish()
