"""A recording fed to a detector at its own pace, and shown in the terminal."""

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from holdfast.cli.console import say

if TYPE_CHECKING:
    from rich.table import Table

    from holdfast.contact import ContactEstimate, HandEstimate
    from holdfast.model import Model

REFRESH = 0.1
"""How often the terminal is redrawn [s]."""
DEBOUNCE = (0.1, 0.1)
"""For the eye, a state is told when it has lasted so long [s], past its threshold by so much."""
BAR_WIDTH = 20
COLOURS = {"UNKNOWN": "dim", "NO_CONTACT": "white", "UNSTABLE": "bold red", "STABLE": "green"}


def calmer(model: "Model") -> "Model":
    """The model with its states held back for the eye."""
    from msgspec.structs import replace

    from holdfast.model import Debounce

    return replace(model, debounce=Debounce(*DEBOUNCE))


def replay(model: "Model", path: Path, speed: float) -> int:
    """Feeds a recording, sample by sample, to a detector, and shows what it says.

    On a terminal a table follows the states; elsewhere every change of the hand is one line.

    Args:
        model: that judges.
        path: of the recording.
        speed: 1 is real time, 0 as fast as it goes.

    Returns:
        How many updates there were.
    """
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.sources import open_source

    with open_source(str(path), speed=speed) as source:
        estimates = iter(StreamDetector(model, source))
        if speed and sys.stderr.isatty():
            return _follow(estimates)
        return _tell_changes(estimates)


def _tell_changes(estimates: "Iterator[HandEstimate]") -> int:
    told: str = "UNKNOWN"
    n_updates = 0
    for estimate in estimates:
        n_updates += 1
        if estimate.state != told:
            say(f"  {estimate.time:7.3f} s  hand {told} -> {estimate.state}")
            told = estimate.state
    return n_updates


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
