"""`holdfast detect` on a live source: lines as they come, until Ctrl-C."""

import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from holdfast.cli.console import say
from holdfast.cli.judging import RateRule, judge_of
from holdfast.cli.stopping import Stop, stopping

if TYPE_CHECKING:
    from holdfast.detector import Detection
    from holdfast.live.judge import Decision, Judge
    from holdfast.model import Model
    from holdfast.sources import Arrival, Source


def detections_live(
    model: "Model", uri: str, rate: RateRule, ignore: str, seconds: float | None
) -> Iterator["Detection"]:
    """What the model says of a live source, arrival by arrival, until a signal or `seconds`."""
    from holdfast.live.judge import warm_up
    from holdfast.live.tracing import detection_of
    from holdfast.sources import open_source

    warm_up()
    with stopping() as stop, open_source(uri) as source:
        judge = judge_of(model, source, rate, ignore)
        stop.gently = True
        for decisions in _decisions(source, judge, seconds, stop):
            yield detection_of(source.name, decisions)


def _decisions(
    source: "Source", judge: "Judge", seconds: float | None, stop: Stop
) -> Iterator[list["Decision"]]:
    from holdfast.live.watch import Watch

    end = math.inf if seconds is None else time.monotonic() + seconds
    watch = Watch(source, judge)
    while not (source.ended or stop.asked) and time.monotonic() < end:
        arrival, decisions = watch.turn()
        if arrival is not None:
            tell(arrival)
        yield decisions
    yield judge.finish()


def tell(arrival: "Arrival") -> None:
    """Tells on stderr what a person should know."""
    for notice in arrival.notices:
        say(notice)
