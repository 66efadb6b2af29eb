"""A recording fed to a detector at its own pace, and shown in the terminal."""

import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from holdfast.cli.console import say

if TYPE_CHECKING:
    from rich.table import Table

    from holdfast.contact import ContactEstimate, HandEstimate
    from holdfast.detector import Detector
    from holdfast.model import Model
    from holdfast.recordings import Recording

REFRESH = 0.1
"""How often the terminal is redrawn [s]."""
DEBOUNCE = (0.1, 0.1)
"""For the eye, a state is told when it has lasted so long [s], past its threshold by so much."""
BAR_WIDTH = 20
COLOURS = {"UNKNOWN": "dim", "NO_CONTACT": "white", "UNSTABLE": "bold red", "STABLE": "green"}


def replay(model: "Model", recording: "Recording", speed: float) -> int:
    """Feeds a recording, sample by sample, to a debounced detector, and shows what it says.

    On a terminal a table follows the states; elsewhere every change of the hand is one line.

    Args:
        model: that judges.
        recording: whose modules share their times.
        speed: 1 is real time, 0 as fast as it goes.

    Returns:
        How many updates there were.
    """
    import msgspec

    from holdfast.detector import Detector
    from holdfast.model import Debounce

    calmer = msgspec.structs.replace(model, debounce=Debounce(*DEBOUNCE))
    detector = Detector(calmer)
    estimates = _estimates(detector, recording, speed)
    if speed and sys.stderr.isatty():
        return _follow(estimates)
    n_updates = 0
    for _ in estimates:
        n_updates += 1
        for event in detector.events():
            if event.finger == "hand":
                say(f"  {event.time:7.3f} s  hand {event.previous} -> {event.state}")
    return n_updates


def _estimates(
    detector: "Detector", recording: "Recording", speed: float
) -> "Iterator[HandEstimate]":
    first = next(iter(recording.modules.values()))
    began = time.monotonic()
    for k, moment in enumerate(first.times.tolist()):
        wait = began + moment / speed - time.monotonic() if speed else 0.0
        if wait > 0:
            time.sleep(wait)
        samples = {name: module.readings[k] for name, module in recording.modules.items()}
        yield detector.update(samples, moment)


def _follow(estimates: "Iterator[HandEstimate]") -> int:
    from rich.console import Console
    from rich.live import Live

    drawn, n_updates = 0.0, 0
    with Live(console=Console(stderr=True), auto_refresh=False) as screen:
        for estimate in estimates:
            n_updates += 1
            if time.monotonic() - drawn > REFRESH:
                drawn = time.monotonic()
                screen.update(_table(estimate), refresh=True)
    return n_updates


def _table(estimate: "HandEstimate") -> "Table":
    from rich.table import Table

    table = Table(title=f"{estimate.time:.2f} s   hand {_coloured(estimate.state)}")
    for heading in ("finger", "state", "stable", "", "sigma", "force [counts]"):
        table.add_column(heading, min_width=8)
    for name, finger in estimate.fingers.items():
        table.add_row(name, *_cells(finger))
    return table


def _cells(finger: "ContactEstimate") -> tuple[str, ...]:
    probability = finger.stable_probability
    known = finger.state != "UNKNOWN"
    bar = "#" * round(BAR_WIDTH * probability) if known else ""
    force = ", ".join(f"{value:7.0f}" for value in finger.force)
    return (
        _coloured(finger.state) + (f" ({finger.reason})" if finger.reason else ""),
        f"{probability:.2f}" if known else "",
        f"{bar:<{BAR_WIDTH}}",
        f"{finger.instability:8.2f}",
        force,
    )


def _coloured(state: str) -> str:
    return f"[{COLOURS[state]}]{state:10}[/]"
