"""Output of `holdfast detect`: JSON lines, a summary, or lines of changes, from estimates."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import Any

from msgspec.json import Encoder

from holdfast.cli.terminal.console import (
    print_json,
    print_line,
    print_message,
    print_table,
    visible_json,
)
from holdfast.contact import ContactState
from holdfast.detection import HAND, Model
from holdfast.devices.sources import open_source
from holdfast.live.documents import estimate_line
from holdfast.live.estimate_chunks import (
    CHANGES_HEADER,
    ChangeLines,
    DetectionSummary,
    EstimateChunk,
    chunk_from_stream,
)
from holdfast.live.stream_detector import StreamDetector
from holdfast.recordings import shown_origin

LINES_PER_BLOCK = 8192
"""Number of lines that are encoded at a time: some 3 MB of text, of a chunk of all fingers."""
MAX_EVENTS_SHOWN = 40
"""Maximum number of events in the table; JSON has all of them."""


def json_lines(chunk: EstimateChunk) -> Iterator[str]:
    """Yield blocks of JSON lines, sorted by time and then in the order of the fingers."""
    lines = [
        estimate_line(finger, estimate)
        for finger, estimates in chunk.fingers.items()
        for estimate in estimates
    ]
    lines.sort(key=attrgetter("time"))  # each finger has times of its own
    encoder = Encoder()
    for start in range(0, len(lines), LINES_PER_BLOCK):
        # A list, because msgspec 0.22 leaks the items of an iterator.
        yield visible_json(encoder.encode_lines(lines[start : start + LINES_PER_BLOCK]).decode())


def print_tables(document: Mapping[str, Any], start: float) -> None:
    """Print tables of shares, of reasons and faults, and of the first events and slips.

    Args:
        document: of a `DetectionSummary`.
        start: time of the first instant [s].
    """
    fingers = {**document["fingers"], HAND: document["hand"]}
    print_table(
        (document["name"], "samples", *(f"{state} %" for state in ContactState)),
        [
            (name, x["n_samples"], *(f"{100 * share:.1f}" for share in x["states"].values()))
            for name, x in fingers.items()
        ],
    )
    print_line()
    counts = {
        name: [", ".join(f"{k} {n}" for k, n in x[key].items()) for key in ("reasons", "faults")]
        for name, x in document["fingers"].items()
    }
    print_table(
        ("finger", "reasons", "faults"),
        [(name, *(text or "-" for text in texts)) for name, texts in counts.items()],
    )
    origin = shown_origin(start)
    events, slips = document["events"], document["slips"]
    print_line()
    if origin:
        print_line(f"times since the first sample, at {origin:.3f} s")
    print_table(
        ("time [s]", "finger", "state", "previous"),
        [
            (f"{x['time'] - origin:.3f}", x["finger"], x["state"], x["previous"])
            for x in events[:MAX_EVENTS_SHOWN]
        ],
    )
    if len(events) > MAX_EVENTS_SHOWN:
        print_line(f"and {len(events) - MAX_EVENTS_SHOWN} more events (--json prints all)")
    if slips is not None:  # a model without a slip rule has none to count
        print_slips(slips, origin)


def print_slips(slips: Sequence[Mapping[str, Any]], origin: float) -> None:
    """Print a table of the first slips, with times since `origin` [s]."""
    print_line()
    if not slips:
        print_line("no slips")
        return
    rows = [
        (
            f"{x['begin'] - origin:.3f}",
            "-" if x["end"] is None else f"{x['end'] - origin:.3f}",
            x["finger"],
            f"{100 * x['max_probability']:.0f}",
            "-" if x["distance"] is None else f"{x['distance']:.1f}",
        )
        for x in slips[:MAX_EVENTS_SHOWN]
    ]
    print_table(("slip from [s]", "to [s]", "finger", "largest P(slip) %", "slid [mm]"), rows)
    if len(slips) > MAX_EVENTS_SHOWN:
        print_line(f"and {len(slips) - MAX_EVENTS_SHOWN} more slips (--json prints all)")


def print_estimates(chunks: Iterator[EstimateChunk], *, live: bool) -> None:
    """Print JSON lines: of a live source each chunk at once."""
    for chunk in chunks:
        for text in json_lines(chunk):
            sys.stdout.write(text)
        if live:
            sys.stdout.flush()  # a program that reads the pipe acts on each estimate


def print_changes(chunks: Iterator[EstimateChunk], *, live: bool) -> None:
    """Print the changes that lasted: of a live source at once, else below the progress bar."""
    changes = ChangeLines(from_first=live)
    if live:
        print_message("times since the first sample; --json prints every estimate; Ctrl-C stops")
        print_line(CHANGES_HEADER)
        for chunk in chunks:
            for line in changes.add(chunk):
                print_line(line)
                sys.stdout.flush()
        return
    lines = [line for chunk in chunks for line in changes.add(chunk)]
    if changes.origin:
        print_message(f"times since the first sample, at {changes.origin:.3f} s")
    for line in (CHANGES_HEADER, *lines):
        print_line(line)


def print_summary(chunks: Iterator[EstimateChunk], model: str, *, as_json: bool) -> None:
    """Print the summary of all chunks."""
    summary = DetectionSummary()
    for chunk in chunks:
        summary.add(chunk)
    if as_json:
        print_json({"model": model, **summary.to_dict()})
    else:
        print_tables(summary.to_dict(), summary.start or 0.0)


def watch(model: str, path: Path, speed: float, *, fingers: bool = True) -> dict[str, Any]:
    """Play a recording as a live source; print its changes and slips on stderr.

    Args:
        model: name of the model.
        path: of the recording.
        speed: 1 is real time, 0 as fast as possible.
        fingers: print the changes of each finger, not only those of the hand.

    Returns:
        The summary, as JSON values.
    """
    lines = ChangeLines(from_first=True, hand_only=not fingers)
    summary = DetectionSummary()
    with open_source(str(path), speed=speed) as source:
        stream = StreamDetector(Model.load(model), source)
        while not source.ended:
            chunk = chunk_from_stream(path.stem, stream.read().estimates)
            summary.add(chunk)
            for line in lines.add(chunk):
                print_message(line)
    return summary.to_dict()
