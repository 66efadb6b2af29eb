"""`holdfast detect` on a live source: lines as they come, until Ctrl-C."""

import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from holdfast.cli.console import say
from holdfast.cli.judging import RateRule, stream_detector_of
from holdfast.cli.stopping import Stop, stopping

if TYPE_CHECKING:
    from holdfast.detector import Detection
    from holdfast.live.stream_detector import StreamDetector, StreamEstimate
    from holdfast.model import Model
    from holdfast.sources import Arrival


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
