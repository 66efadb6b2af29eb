"""Estimates of `holdfast detect`, in chunks: of a recording, or of a live source."""

import math
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from time import monotonic

from holdfast.cli.options import (
    DetectorOptions,
    RatePolicy,
    StartOptions,
    parse_taxels,
    report_blind_features,
    report_missing_fingers,
    report_missing_slip_rules,
    report_other_handling,
)
from holdfast.cli.terminal.console import print_message
from holdfast.cli.terminal.control import handle_stop_signals
from holdfast.detection import Detector, Model, Tare
from holdfast.devices.sources import open_source
from holdfast.errors import ModelError, RecordingError
from holdfast.io import load_recording, read_chunks
from holdfast.live.estimate_chunks import EstimateChunk, chunk_from_detection, chunk_from_stream
from holdfast.live.fault_notices import FaultWatch
from holdfast.live.readings_monitor import ReadingsMonitor
from holdfast.recordings import Recording
from holdfast.resampling import resample, true_updates

CHUNK_SIZE = 4096
"""Number of samples that are read and processed at a time; it bounds the memory."""


def detect_recording(
    model: Model,
    path: Path,
    options: DetectorOptions,
    start: StartOptions,
    recording: Recording | None,
) -> Iterator[EstimateChunk]:
    """Yield the estimates of the recording at a path; None if it is read from there."""
    detector = None  # made for the first part, which has the sensors and the start
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
    model: Model, path: Path, rate: RatePolicy, recording: Recording | None
) -> Iterator[Recording]:
    """Yield the recording at the model's rate; it is read from the path if it is None.

    It comes in parts, or as a whole if it is resampled or its tare is an interval.
    """

    def whole() -> Recording:
        return true_updates(recording or load_recording(path, labels=False))

    parts = iter([recording]) if recording else read_chunks(path, CHUNK_SIZE, labels=False)
    first = next(parts, None)
    if first is None:
        raise RecordingError(f"{path} has no samples; at least one expected")
    # A sensor that the model does not know is refused before any other message.
    model.fingers_of({name: module.sensor for name, module in first.modules.items()})
    # The rest is a message, not an error: what can be read is worth its estimates.
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
            return iter([whole()])  # the interval may lie after the first part
        return chain([first], parts)
    text = f"{path}: {first.rate:.4g} Hz given, the model expects {model.rate:g} Hz"
    if rate is RatePolicy.STRICT:
        raise ModelError(f"{text} within 20 % (--rate resample accepts it)")
    print_message(f"{text}: resampled")
    return iter([resample(whole(), model.rate)])


def detect_live(
    model: Model,
    uri: str,
    options: DetectorOptions,
    start: StartOptions,
    seconds: float | None,
) -> Iterator[EstimateChunk]:
    """Yield the estimates of each arrival, until a signal or for `seconds`."""
    with handle_stop_signals() as stop, open_source(uri) as source:
        stream = options.create_stream(model, source, start)
        report_missing_slip_rules(model)
        # Ctrl-C before ends the wait; from here on the summary is still printed.
        stop.graceful = True
        end = math.inf if seconds is None else monotonic() + seconds
        faults = FaultWatch()
        while not (source.ended or stop.requested) and monotonic() < end:
            update = stream.read()
            for notice in update.arrival.notices if update.arrival else ():
                print_message(notice)
            for estimate in update.estimates:
                for problem in faults.update(estimate.estimate):
                    print_message(problem.text)
            yield chunk_from_stream(source.name, update.estimates)
        # Samples that a short source sent before its rate was known.
        yield chunk_from_stream(source.name, stream.finish().estimates)
