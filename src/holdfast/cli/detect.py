"""`holdfast detect`: what a model says of every finger at every sample."""

import re
import sys
from collections.abc import Iterator
from enum import StrEnum
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.console import Bar, print_json, say

if TYPE_CHECKING:
    from holdfast.detector import Detection
    from holdfast.model import Model
    from holdfast.recordings import Recording

PIECE = 4096
"""Samples that are taken at a time: bounds the memory."""

_URI = re.compile(r"[a-z][a-z0-9+]+:")


class RateRule(StrEnum):
    """What becomes of a source at another rate than the model's."""

    RESAMPLE = "resample"
    STRICT = "strict"


def detect(
    model: Annotated[
        str, typer.Argument(help="A model's file, builtin:twin or builtin:noise-floor.")
    ],
    source: Annotated[str, typer.Argument(help="The path of a recording.")],
    summary: Annotated[
        bool, typer.Option("--summary", help="Print shares of states and the events instead.")
    ] = False,
    rate: Annotated[
        RateRule, typer.Option(help="Of a source not within 20 % of the model's rate.")
    ] = RateRule.RESAMPLE,
    debounce: Annotated[
        float | None, typer.Option(help="Tell a state once it has lasted so long [s].")
    ] = None,
    hysteresis: Annotated[
        float | None, typer.Option(help="How far past its threshold a probability must go.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON: as always, and for --summary too.")
    ] = False,
) -> None:
    """Tells the contact state of every finger at every sample.

    Prints a line of JSON for each finger and sample, in the order of time: time [s], finger,
    state, reason (why it is UNKNOWN), stable_probability, instability (sigma) and force in the
    unit of the readings, faults; null where nothing is known. Memory stays bounded, however long
    the recording.

    Example:
      holdfast detect model.json grasp.parquet > states.jsonl
      holdfast detect builtin:noise-floor grasp.mcap --summary
      holdfast detect model.json grasp.parquet --debounce 0.05 --hysteresis 0.1
    """
    judge = _judge(model, debounce, hysteresis)
    detections = _detections(judge, _path(source), rate)
    if summary:
        from holdfast.cli.tally import Tally

        tally = Tally()
        for detection in detections:
            tally.add(detection)
        if as_json:
            print_json({"model": model, **tally.document()})
        else:
            tally.print()
        return
    from holdfast.cli.lines import json_lines

    for detection in detections:
        for block in json_lines(detection):
            sys.stdout.write(block)


def _judge(name: str, debounce: float | None, hysteresis: float | None) -> "Model":
    from msgspec.structs import replace

    from holdfast.model import Debounce, Model

    model = Model.load(name)
    known = model.debounce
    held = Debounce(
        known.min_duration if debounce is None else debounce,
        known.hysteresis if hysteresis is None else hysteresis,
        known.hold,
    )
    return replace(model, debounce=held)


def _path(source: str) -> Path:
    path = Path(source)
    if _URI.match(source) and not path.exists():
        raise ValueError(f"only the path of a recording can be a source yet; {source!r} given")
    return path


def _detections(model: "Model", path: Path, rate: RateRule) -> Iterator["Detection"]:
    """What the model says, piece by piece."""
    from holdfast.detector import Detector

    detector = None
    with Bar("detecting") as bar:
        for piece in _pieces(model, path, rate):
            if detector is None:
                detector = Detector.for_recording(model, piece)
                _tell_missing(model, piece)
            yield detector.run(piece)
            bar.advance(max(module.n_samples for module in piece.modules.values()))


def _pieces(model: "Model", path: Path, rate: RateRule) -> Iterator["Recording"]:
    """The recording at the model's rate: in pieces, unless it must be known as a whole."""
    from holdfast.errors import ModelError
    from holdfast.features import Tare
    from holdfast.io import load_recording, read_chunks
    from holdfast.resampling import resample

    pieces = read_chunks(path, PIECE, labels=False)
    first = next(pieces)
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


def _tell_missing(model: "Model", recording: "Recording") -> None:
    missing = [name for name in model.fingers if name not in ("*", *recording.modules)]
    if missing:
        say(
            f"the model also judges {', '.join(missing)}; "
            f"{recording.name} has {', '.join(recording.modules)}"
        )
