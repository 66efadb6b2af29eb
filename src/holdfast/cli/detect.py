"""`holdfast detect`: what a model says of every finger at every sample."""

import math
import sys
import time
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import (
    DebounceOption,
    HysteresisOption,
    IgnoreOption,
    ModelArgument,
    RateOption,
    RateRule,
    SourceArgument,
    debounced,
    stream_detector_of,
    taxels_of,
    tell_missing,
)
from holdfast.cli.terminal.console import print_json, say
from holdfast.cli.terminal.progress import Bar
from holdfast.cli.terminal.stopping import Stop, stopping

if TYPE_CHECKING:
    from holdfast.detector import Detection
    from holdfast.live.stream_detector import StreamDetector, StreamEstimate
    from holdfast.model import Model
    from holdfast.recordings import Recording
    from holdfast.sources import Arrival

PIECE = 4096
"""Samples that are taken at a time: bounds the memory."""


def detect(
    model: ModelArgument,
    source: SourceArgument,
    summary: Annotated[
        bool, typer.Option("--summary", help="Print shares of states and the events instead.")
    ] = False,
    rate: RateOption = RateRule.RESAMPLE,
    debounce: DebounceOption = None,
    hysteresis: HysteresisOption = None,
    seconds: Annotated[
        float | None, typer.Option(help="Of a live source: stop after so long [s].")
    ] = None,
    ignore: IgnoreOption = "",
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON: as always, and for --summary too.")
    ] = False,
) -> None:
    """Tells the contact state of every finger at every sample.

    Prints a line of JSON for each finger and sample, in the order of time: time [s], finger,
    state, reason (why it is UNKNOWN), stable_probability, instability (sigma) and force in the
    unit of the readings, faults; null where nothing is known. Memory stays bounded, however long
    the recording.

    SOURCE is the path of a recording, judged as fast as it goes, or a live source, judged as
    it comes until Ctrl-C: xela://HOST:PORT (or xela://auto), twin:?object=can,
    ros2:///xServTopic, ros1:///xServTopic or serial:///dev/ttyACM0?sensor=anyskin.

    Example:
      holdfast detect model.json grasp.parquet > states.jsonl
      holdfast detect builtin:twin xela://auto
      holdfast detect builtin:noise-floor grasp.mcap --summary
      holdfast detect model.json grasp.parquet --debounce 0.05 --hysteresis 0.1
    """
    from holdfast.sources.uri import is_uri

    live = is_uri(source)
    _check_seconds(seconds, source, live=live)
    wanted = debounced(model, debounce, hysteresis)
    if live:
        detections = detections_live(wanted, source, rate, ignore, seconds)
    else:
        detections = _detections(wanted, Path(source), rate, ignore)
    if summary:
        _summarise(detections, model, as_json=as_json)
        return
    from holdfast.cli.detect_output import json_lines

    for detection in detections:
        for block in json_lines(detection):
            sys.stdout.write(block)
        if live:
            sys.stdout.flush()


def _check_seconds(seconds: float | None, source: str, *, live: bool) -> None:
    if seconds is None:
        return
    if not live:
        raise ValueError(f"--seconds is for live sources; {source} is judged to its end")
    if not seconds > 0:
        raise ValueError(f"--seconds: more than 0 s expected, {seconds:g} given")


def _summarise(detections: Iterator["Detection"], model: str, *, as_json: bool) -> None:
    from holdfast.cli.detect_output import Tally

    tally = Tally()
    for detection in detections:
        tally.add(detection)
    if as_json:
        print_json({"model": model, **tally.document()})
    else:
        tally.print()


def _detections(model: "Model", path: Path, rate: RateRule, ignore: str) -> Iterator["Detection"]:
    """What the model says, piece by piece."""
    from holdfast.detector import Detector

    detector = None
    with Bar("detecting") as bar:
        for piece in _pieces(model, path, rate):
            if detector is None:
                detector = Detector.for_recording(model, piece, ignore=taxels_of(ignore))
                tell_missing(model, piece.name, piece.modules)
            yield detector.run(piece)
            bar.advance(max(module.n_samples for module in piece.modules.values()))


def _pieces(model: "Model", path: Path, rate: RateRule) -> Iterator["Recording"]:
    """The recording at the model's rate: in pieces, unless it must be known as a whole."""
    from holdfast.errors import ModelError, RecordingError
    from holdfast.features import Tare
    from holdfast.io import load_recording, read_chunks
    from holdfast.resampling import resample

    pieces = read_chunks(path, PIECE, labels=False)
    first = next(pieces, None)
    if first is None:
        raise RecordingError(f"{path} has no samples; at least one expected")
    model.fingers_of({name: module.sensor for name, module in first.modules.items()})
    if not first.complete:
        say(f"{path} was cut: what could be recovered is judged")
    if model.rate is None or model.rate_fits(first.rate):
        if Tare.parse(model.tare).kind == "interval":
            return iter([load_recording(path, labels=False)])
        return chain([first], pieces)
    given = f"{path}: {first.rate:.4g} Hz given, the model expects {model.rate:g} Hz"
    if rate is RateRule.STRICT:
        raise ModelError(f"{given} within 20 % (--rate resample takes it all the same)")
    say(f"{given}: resampled")
    return iter([resample(load_recording(path, labels=False), model.rate)])


def detections_live(
    model: "Model", uri: str, rate: RateRule, ignore: str, seconds: float | None
) -> Iterator["Detection"]:
    """What the model says of a live source, arrival by arrival, until a signal or `seconds`."""
    from holdfast.live.stream_detector import compile_kernels
    from holdfast.live.tracing import detection_of
    from holdfast.sources import open_source

    compile_kernels()
    with stopping() as stop, open_source(uri) as source:
        stream = stream_detector_of(model, source, rate, ignore)
        stop.gently = True
        for estimates in _estimates(stream, seconds, stop):
            yield detection_of(source.name, estimates)


def _estimates(
    stream: "StreamDetector", seconds: float | None, stop: Stop
) -> Iterator[list["StreamEstimate"]]:
    end = math.inf if seconds is None else time.monotonic() + seconds
    while not (stream.source.ended or stop.asked) and time.monotonic() < end:
        arrival, estimates, _ = stream.read()
        if arrival is not None:
            tell(arrival)
        yield estimates
    yield stream.finish().estimates


def tell(arrival: "Arrival") -> None:
    """Tells on stderr what a person should know."""
    for notice in arrival.notices:
        say(notice)
