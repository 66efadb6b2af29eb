"""What `holdfast demo` shows of recordings: events with their sentences, and the fingers.

First a real recording that ships, then a simulated one, sample by sample.
"""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from holdfast.cli import serve
from holdfast.cli.terminal.console import print_message
from holdfast.contact import (
    Cause,
    ContactEvent,
    HandEstimate,
    StateChanges,
)
from holdfast.detector import HAND, detect
from holdfast.detector.detection import STATE_BY_CODE
from holdfast.detector.slips import SlipWatch
from holdfast.devices.sources import Source, open_source
from holdfast.io import load_recording
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamDetector
from holdfast.metrics import InstabilityEvent, match_decisions
from holdfast.metrics.truth_labels import LabelRule, labels_by_truth
from holdfast.model import Model
from holdfast.recorded import BOX_SLIPS
from holdfast.recordings import Recording
from holdfast.training import compute_decisions

if TYPE_CHECKING:
    from rich.table import Table

CLIP_MODEL = "builtin:any"
MIN_DURATION = 0.15
"""Minimum time that a new state must last to be printed [s]."""
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
SCREEN_INTERVAL = 0.1
"""Time between two updates of the table on the terminal [s]."""
BAR_WIDTH = 10
TERMINAL_COLOURS = {
    "UNKNOWN": "dim",
    "NO_CONTACT": "white",
    "UNSTABLE": "bold red",
    "STABLE": "green",
}
STATES = {
    "UNKNOWN": "no samples yet, or a fault",
    "NO_CONTACT": "nothing touches",
    "UNSTABLE": "false alarm",
    "STABLE": "the hand holds the object",
}
"""Words for a state that no true event explains."""
CAUSE_WORDS = {
    "closing": "the hand closes on the object",
    "disturbance": "pulled or pushed",
    "slip": "pulled or pushed, and slips",
    "glitch": "a jerk of the controller",
    "released": "the hand opens",
    "lost": "the object is lost",
}
"""Words for the causes of labels."""
CAUSE_TOLERANCE = 0.25
"""Maximum time between a change of state and its cause [s]."""


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
    # Changes, slips and labels come one kind after the other.
    events = sorted(_events())
    start = time.monotonic()
    for event in events:
        if speed:
            time.sleep(max(start + event.time / speed - time.monotonic(), 0))
        write(f"     {event.time:6.2f} s   {event.state:10}  {event.sentence}")
    return events


def _events() -> Iterator[ClipEvent]:
    """Yield the changes of the hand's state that lasted, the slips, and the labels."""
    recording = load_recording(BOX_SLIPS)
    detection = detect(Model.load(CLIP_MODEL), recording)
    changes = StateChanges([HAND], MIN_DURATION)
    for instant, code in zip(detection.times, detection.hand, strict=True):
        for change in changes.update([STATE_BY_CODE[code]], instant):
            yield ClipEvent(change.time, change.state, SENTENCES[change.state])
    watch = SlipWatch()
    for finger, trace in detection.fingers.items():
        for slip in watch.update(finger, trace.estimates()):
            if slip.end is None:
                yield ClipEvent(slip.begin, "slip", f"{finger} slides.")
    for label in recording.modules["finger1"].labels:
        if label.cause is not None:
            yield ClipEvent(label.start, "(label)", LABEL_SENTENCES[label.cause])


class TrueEvents(NamedTuple):
    """What happens in a recording, by its truth.

    Attributes:
        causes: (start [s], end [s], words) of each time in which a finger is not stable.
        events: onsets of instability of the hand, with the alarms of a model.
    """

    causes: Sequence[tuple[float, float, str]] = ()
    events: Sequence[InstabilityEvent] = ()

    @classmethod
    def of(cls, model: Model, recording: Recording) -> "TrueEvents":
        """Return the true events of a recording; none if its truth is not known."""
        labels = labels_by_truth(recording, LabelRule(margin=0.0))
        causes = sorted(
            (label.start, label.end, CAUSE_WORDS[label.cause])
            for finger_labels in labels.values()
            for label in finger_labels
            if label.cause is not None
        )
        hand = compute_decisions(model, recording).hand
        return cls(causes, match_decisions(hand).events if causes and hand else ())

    def words(self, change: ContactEvent) -> str:
        """Return what happens when the state of the hand changes."""
        if change.state != "UNSTABLE":
            return STATES[change.state]
        reasons = (
            words
            for start, end, words in self.causes
            if start - CAUSE_TOLERANCE <= change.time < end + CAUSE_TOLERANCE
        )
        words = next(reasons, None)
        if words is None:
            return STATES[change.state]
        for event in self.events:
            during = event.onset - CAUSE_TOLERANCE <= change.time <= event.end
            if during and event.alarm is not None:
                delay = round(1000 * event.delay)
                return words + (
                    f"; detected after {delay} ms" if delay > 0 else "; detected at once"
                )
        return words


def replay(model: Model, path: Path, speed: float, true_events: TrueEvents) -> int:
    """Play a recording sample by sample through a detector, and print the states.

    Each change of the hand's state that lasted is one line. On a terminal, a table of the
    fingers follows below.

    Args:
        model: the model to use.
        path: path of the recording.
        speed: 1 is real time, 0 as fast as possible.
        true_events: of the recording, for the lines.

    Returns:
        Number of estimates.
    """
    # At a terminal that is watched in real time, the table; else only the lines.
    with open_source(str(path), speed=speed) as source:
        if speed and sys.stderr.isatty():
            from rich.console import Console
            from rich.live import Live

            updated_at, n_updates = 0.0, 0
            console = Console(stderr=True, highlight=False)
            with Live(
                console=console, auto_refresh=False, transient=True, redirect_stdout=False
            ) as screen:
                for estimate in print_changes(model, source, true_events, console.print):
                    n_updates += 1
                    if time.monotonic() - updated_at > SCREEN_INTERVAL:
                        updated_at = time.monotonic()
                        screen.update(finger_table(estimate), refresh=True)
            return n_updates
        estimates = print_changes(model, source, true_events, print_message)
        return sum(1 for _ in estimates)  # the lines are printed while it is consumed


def replay_on_page(model: Model, path: Path, folder: Path, speed: float) -> None:
    """Replay on a web page; at a terminal the page stays open until Ctrl-C."""
    stay = sys.stdin.isatty()
    with (
        # A page that stays shows the recording again and again.
        open_source(str(path), speed=speed, loop=stay) as source,
        Session(StreamDetector(model, source)) as session,
    ):

        def announce(url: str) -> None:
            opened = serve.open_browser(url)
            print_message(f"     {url} {'has opened' if opened else '(open it in a browser)'}")
            print_message(
                "     Ctrl-C stops it" if stay else "     it stops at the end of the recording"
            )

        # Port 0: a free one, as 8080 may be taken.
        serve.run_page(session, announce, port=0, folder=folder, stay=stay)


def print_changes(
    model: Model, source: Source, true_events: TrueEvents, write: Callable[[str], None]
) -> Iterator[HandEstimate]:
    """Yield the estimates of a source, and write a line for each change that lasted."""
    write(f"     {'time':>8}   {'hand':10}  what happens, by the truth of the simulation")
    changes = StateChanges([HAND], MIN_DURATION)
    for estimate in StreamDetector(model, source):
        for change in changes.update([estimate.state], estimate.time):
            words = true_events.words(change)
            write(f"     {change.time:6.2f} s   {change.state:10}  {words}")
        yield estimate


def finger_table(estimate: HandEstimate) -> "Table":
    """Return a table of the fingers, at most 80 columns wide."""
    from rich.table import Table

    title = f"{estimate.time:.1f} s   hand {_coloured(estimate.state)}"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for heading, width in (("finger", 8), ("state", 18), ("stable", 6), ("", BAR_WIDTH)):
        table.add_column(heading, width=width)
    table.add_column("instability", width=11, justify="right")
    # `\[` is a bracket, not a style of rich.
    table.add_column(r"force \[counts]", width=14, justify="right")
    for name, finger in estimate.fingers.items():
        known = finger.state != "UNKNOWN"  # without an estimate, the probability means nothing
        table.add_row(
            name,
            _coloured(finger.state) + (f" {finger.reason}" if finger.reason else ""),
            _number(finger.stable_probability, 2) if known else "-",
            "#" * round(BAR_WIDTH * finger.stable_probability) if known else "",
            _number(finger.instability, 1),
            _number(sum(value * value for value in finger.force) ** 0.5, 0),
        )
    return table


def _number(value: float, digits: int) -> str:
    """Return a number without a sign on zero; a dash if it is not finite.

    Example:
        >>> _number(-0.001, 1), _number(float("nan"), 1), _number(12.34, 1)
        ('0.0', '-', '12.3')
    """
    # `value - value` is NaN for NaN and for infinity; `+ 0.0` makes 0.0 of -0.0.
    return "-" if value - value != 0 else f"{round(value, digits) + 0.0:.{digits}f}"


def _coloured(state: str) -> str:
    return f"[{TERMINAL_COLOURS[state]}]{state:10}[/]"
