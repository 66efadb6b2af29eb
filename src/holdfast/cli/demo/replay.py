"""Replays of `holdfast demo`: a recording as `holdfast detect` and `holdfast serve` show a hand."""

import sys
from pathlib import Path
from typing import Any

from holdfast.cli.options import LOCALHOST
from holdfast.cli.terminal.console import print_message


def watch(model: str, path: Path, speed: float, *, fingers: bool = True) -> dict[str, Any]:
    """Play a recording through the detector; print the changes and slips, return the summary.

    Both are those of `holdfast detect` on a live source.

    Args:
        model: name of the model.
        path: of the recording.
        speed: 1 is real time, 0 as fast as possible.
        fingers: print the lines of the fingers as well, not only those of the hand.
    """
    from holdfast.cli.detect.estimates import chunk_from_stream
    from holdfast.cli.detect.output import ChangeLines, DetectionSummary
    from holdfast.devices.sources import open_source
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.model import Model

    lines, summary = ChangeLines(from_first=True), DetectionSummary()
    with open_source(str(path), speed=speed) as source:
        stream = StreamDetector(Model.load(model), source)
        while not source.ended:
            chunk = chunk_from_stream(path.stem, stream.read().estimates)
            summary.add(chunk)
            for line in lines.add(chunk if fingers else chunk._replace(fingers={})):
                print_message(line)
    return summary.to_dict()


def show_page(model: str, path: Path, folder: Path, speed: float) -> None:
    """Replay a recording on a web page; at a terminal the page stays open until Ctrl-C.

    Args:
        model: name of the model.
        path: of the recording.
        folder: for recordings that are started on the page.
        speed: 1 is real time.
    """
    from holdfast.devices.sources import open_source
    from holdfast.live.session import Session
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.live.web.service import run_page
    from holdfast.model import Model
    from holdfast.web import server

    stay = sys.stdin.isatty()

    def announce(url: str) -> None:
        print_message(
            f"     {url} {'has opened' if server.open_browser(url) else '(open it in a browser)'}"
        )
        end = "Ctrl-C stops it" if stay else "it stops at the end of the recording"
        print_message(f"     {end}")

    with (
        # A page that stays shows the recording again and again.
        open_source(str(path), speed=speed, loop=stay) as source,
        Session(StreamDetector(Model.load(model), source)) as session,
    ):
        # Port 0: a free one, as 8080 may be taken.
        run_page(
            session, announce, host=LOCALHOST, port=0, folder=folder,
            report=print_message, stay=stay,
        )  # fmt: skip
