"""The first part of `holdfast demo`: a real recording, with one plain sentence per event."""

import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

from holdfast.contact import Cause, StateChanges
from holdfast.detector import HAND, detect
from holdfast.detector.detection import STATE_BY_CODE, Detection
from holdfast.detector.slips import SlipWatch
from holdfast.io import load_recording
from holdfast.model import Model
from holdfast.recorded import BOX_SLIPS

MODEL = "builtin:any"
MIN_DURATION = 0.15
"""Minimum duration of a new state before it is printed [s]."""
SENTENCES = {
    "UNKNOWN": "There is no estimate.",
    "STABLE": "The robot holds the box, and nothing moves.",
    "UNSTABLE": "The grasp is not stable any more.",
    "NO_CONTACT": "The box has fallen.",
}
LABEL_SENTENCES = {
    Cause.SLIP: "The authors label a slip from here on.",
    Cause.LOST: "By their label, the box is lost.",
}


class ClipEvent(NamedTuple):
    """What happens at a time of the clip."""

    time: float  # since the first sample [s]
    state: str  # of the hand; or slip, or (label)
    sentence: str


def show_clip(speed: float, write: Callable[[str], None]) -> list[ClipEvent]:
    """Detect on the clip, and write its events at their times.

    Args:
        speed: 1 is real time, 0 as fast as possible.
        write: receives each line.

    Returns:
        The events.
    """
    write("1/5  a real recording: a robot carries a box between two uSkin sensors")
    events = sorted(_events())
    start = time.monotonic()
    for event in events:
        if speed:
            time.sleep(max(start + event.time / speed - time.monotonic(), 0))
        write(f"     {event.time:6.2f} s   {event.state:10}  {event.sentence}")
    return events


def _events() -> Iterator[ClipEvent]:
    recording = load_recording(BOX_SLIPS)
    detection = detect(Model.load(MODEL), recording)
    yield from _changes(detection)
    yield from _slips(detection)
    labels = recording.modules["finger1"].labels
    for label in labels:
        if label.cause is not None:
            yield ClipEvent(label.start, "(label)", LABEL_SENTENCES[label.cause])


def _changes(detection: Detection) -> Iterator[ClipEvent]:
    """Yield the changes of the hand's state that lasted."""
    changes = StateChanges([HAND], MIN_DURATION)
    for instant, code in zip(detection.times, detection.hand, strict=True):
        for change in changes.update([STATE_BY_CODE[code]], instant):
            yield ClipEvent(change.time, change.state, SENTENCES[change.state])


def _slips(detection: Detection) -> Iterator[ClipEvent]:
    watch = SlipWatch()
    for finger, trace in detection.fingers.items():
        for slip in watch.update(finger, trace.estimates()):
            if slip.end is None:
                yield ClipEvent(slip.begin, "slip", f"{finger} slides.")
