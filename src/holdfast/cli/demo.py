"""`holdfast demo`: a real recording, then the whole chain on simulated data."""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from holdfast.cli.options import (
    BrowserOption,
    ForceOption,
    JsonOption,
    SeedOption,
    SpeedOption,
    check_speed,
)
from holdfast.cli.terminal.console import (
    format_number,
    print_json,
    print_line,
    print_lines,
    print_message,
)
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from rich.table import Table

    from holdfast.contact import ContactEstimate, ContactEvent, HandEstimate
    from holdfast.devices.sources import Source
    from holdfast.metrics import InstabilityEvent, Metrics
    from holdfast.model import Model
    from holdfast.recordings import Recording
    from holdfast.training import Trained
    from holdfast.twin.simulation import Grasp

DEMO_MODEL = "builtin:twin"
"""The model of the demo: the best one that ships for the sensor of the simulated hand."""
DEMO_OBJECTS, DEMO_CASES, N_DEMO_REPEATS = "mug,carton", "1,2", 1
"""Objects of the demo, none of which `DEMO_MODEL` was trained on; cases and grasps of each."""
MIN_DURATION = 0.15
"""Minimum time that a new state must last to be printed [s]."""
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


def demo(
    out: Annotated[
        Path, typer.Argument(help="Folder for the results; it is created if missing.")
    ] = Path("holdfast-demo"),
    speed: SpeedOption = 1.0,
    seed: SeedOption = 0,
    browser: BrowserOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Detect on real and simulated recordings; train; replay live.

    Run the detector on a recording of a real robot that loses a box, with one sentence for
    each event. Simulate grasps of a mug and a carton with the physical twin. Evaluate the model
    that ships with holdfast on them; it has not seen these objects. Train a model with the
    features of the paper on them. Replay one recording sample by sample, as a hand would send
    it, on a web page or in the terminal.

    Example:
      holdfast demo
      holdfast demo --no-browser
      holdfast demo results/ --speed 0 --json
    """
    require_extras("twin", "train", "parquet")
    from holdfast.cli.real_clip import show_clip
    from holdfast.cli.simulate import plan_grasps
    from holdfast.files import refuse_overwrite
    from holdfast.model import Model
    from holdfast.training import evaluate
    from holdfast.twin.objects import OTHER_OBJECTS

    check_speed("twin:", speed)
    start = time.monotonic()
    folder, model = out / "recordings", out / "model.json"
    folder.mkdir(parents=True, exist_ok=True)
    refuse_overwrite(model, force=force)
    grasps = plan_grasps(
        DEMO_OBJECTS, DEMO_CASES, N_DEMO_REPEATS, "reference", seed, table=OTHER_OBJECTS
    )
    real = show_clip(speed, print_message)
    recordings = _simulate(grasps, folder, force)
    print_message(f"3/5  evaluating {DEMO_MODEL}, which was not trained on these objects")
    ours = Model.load(DEMO_MODEL)
    metrics = evaluate(ours, recordings)
    trained = _train(recordings, model, seed, force)
    shown = recordings[-1]
    n_updates = _replay(ours, shown, out, speed, page=_on_page(browser, speed, as_json=as_json))
    if as_json:
        print_json(
            {
                "real": [event._asdict() for event in real],
                "recordings": folder,
                "model": model,
                "accuracy": trained.cross_validation.pooled.accuracy,
                "shipped": {"model": DEMO_MODEL, "metrics": metrics},
                "updates": n_updates,
                "seconds": time.monotonic() - start,
            }
        )
        return
    _print_results(metrics, trained, len(recordings))
    _print_next_steps(out, folder / f"{shown.name}.parquet", time.monotonic() - start)


def _simulate(grasps: "Sequence[Grasp]", folder: Path, force: bool) -> "Sequence[Recording]":
    """Simulate grasps with and without disturbances; return those that did not fail."""
    from holdfast.cli.simulate import simulate_grasps
    from holdfast.io import load_dataset

    names = DEMO_OBJECTS.replace(",", " and ")
    print_message(f"2/5  simulating {len(grasps)} grasps: {names}, Allegro hand, uSkin fingertips")
    simulate_grasps(grasps, folder, jobs=-1, force=force, report=_report_grasp)
    return load_dataset(folder)


def _report_grasp(names: Sequence[str]) -> None:
    print_message(f"     {', '.join(names)}")


def _train(recordings: "Sequence[Recording]", path: Path, seed: int, force: bool) -> "Trained":
    """Train a model with the features of the paper, and save it with a name."""
    from dataclasses import replace

    import msgspec

    from holdfast.training import Setting, train

    print_message("4/5  training a model with the features of the paper, one grasp left out")
    trained = train(recordings, Setting(trials=0, seed=seed))
    named = replace(trained, model=msgspec.structs.replace(trained.model, name="demo"))
    named.model.save(path, force=force)
    return named


def _on_page(browser: bool | None, speed: float, *, as_json: bool) -> bool:
    """Return whether the replay is shown on a page."""
    from holdfast.cli.serve import has_browser

    wanted = has_browser() and sys.stdin.isatty() if browser is None else browser
    return bool(wanted and speed and not as_json)


def _replay(model: "Model", recording: "Recording", out: Path, speed: float, *, page: bool) -> int:
    """Replay a recording on a page or in the terminal; return the number of estimates."""
    at_speed = f" at speed {speed:g}" if speed else ""
    print_message(f"5/5  replaying {recording.name} sample by sample{at_speed}")
    path = out / "recordings" / f"{recording.name}.parquet"
    if page:
        _replay_on_page(model, path, out, speed)
        return 0
    return replay(model, path, speed, TrueEvents.of(model, recording))


def _replay_on_page(model: "Model", path: Path, out: Path, speed: float) -> None:
    """Replay on a web page; at a terminal the page stays open until Ctrl-C."""
    from holdfast.cli.serve import open_browser, run_page
    from holdfast.devices.sources import open_source
    from holdfast.live.session import Session
    from holdfast.live.stream_detector import StreamDetector

    stay = sys.stdin.isatty()
    with (
        open_source(str(path), speed=speed, loop=stay) as source,
        Session(StreamDetector(model, source)) as session,
    ):

        def announce(url: str) -> None:
            opened = open_browser(url)
            print_message(f"     {url} {'has opened' if opened else '(open it in a browser)'}")
            print_message(
                "     Ctrl-C stops it" if stay else "     it stops at the end of the recording"
            )

        run_page(session, announce, port=0, folder=out / "recorded", stay=stay)


def _print_results(metrics: "Metrics", trained: "Trained", n: int) -> None:
    hand = metrics.events.hand
    missed, delay = hand.missed["0.1"], hand.delay_median
    false_alarms = format_number(hand.false_alarms_per_minute, 1)
    accuracies = (metrics.pooled.accuracy, trained.cross_validation.pooled.accuracy)
    shipped, trained_here = (format_number(accuracy, 1) for accuracy in accuracies)
    detected = "-" if missed is None else f"{100 - missed:.0f} %"
    print_line()
    print_line(f"{DEMO_MODEL} on {n} grasps of objects that it was not trained on:")
    print_line(f"  {hand.n_events} disturbances of a held object, {detected} detected within 0.1 s")
    print_line(f"  median delay {'-' if delay is None else f'{1000 * delay:.0f} ms'}")
    print_line(f"  {false_alarms} false alarms per minute of quiet hold")
    print_line(f"  {shipped} % of all samples are classified as labelled")
    print_line("a model of the paper's features, trained here, each grasp left out once:")
    print_line(f"  {trained_here} % of all samples are classified as labelled")


def _print_next_steps(out: Path, shown: Path, seconds: float) -> None:
    print_line()
    print_line(f"finished in {seconds:.0f} s; recordings and model.json are in {out}/. Next:")
    for command, purpose in (
        (f"info {shown} --plot grasp.png", "a picture of this grasp"),
        (f"evaluate {DEMO_MODEL} {out}/recordings", "all figures"),
        (f"serve {DEMO_MODEL} 'twin:?object=can'", "a live page of the twin"),
        ("serve builtin:any xela://auto", "a live page of your own hand"),
        ("import --help", "your own recordings"),
    ):
        print_lines((f"  # {purpose}", f"  holdfast {command}"))


class TrueEvents(NamedTuple):
    """What happens in a recording, by its truth.

    Attributes:
        causes: (start [s], end [s], words) of each time in which a finger is not stable.
        events: onsets of instability of the hand, with the alarms of a model.
    """

    causes: "Sequence[tuple[float, float, str]]" = ()
    events: "Sequence[InstabilityEvent]" = ()

    @classmethod
    def of(cls, model: "Model", recording: "Recording") -> "TrueEvents":
        """Return the true events of a recording; none if its truth is not known."""
        from holdfast.metrics import match_decisions
        from holdfast.metrics.truth_labels import LabelRule, labels_by_truth
        from holdfast.training import compute_decisions

        labels = labels_by_truth(recording, LabelRule(margin=0.0))
        causes = sorted(
            (label.start, label.end, CAUSE_WORDS[label.cause])
            for finger_labels in labels.values()
            for label in finger_labels
            if label.cause is not None
        )
        hand = compute_decisions(model, recording).hand
        return cls(causes, match_decisions(hand).events if causes and hand else ())

    def words(self, change: "ContactEvent") -> str:
        """Return what happens when the state of the hand changes."""
        if change.state != "UNSTABLE":
            return STATES[change.state]
        for start, end, words in self.causes:
            if start - CAUSE_TOLERANCE <= change.time < end + CAUSE_TOLERANCE:
                return words + self._delay(change.time)
        return STATES[change.state]

    def _delay(self, instant: float) -> str:
        for event in self.events:
            if event.onset - CAUSE_TOLERANCE <= instant <= event.end and event.alarm is not None:
                delay = round(1000 * event.delay)
                return f"; detected after {delay} ms" if delay > 0 else "; detected at once"
        return ""


def replay(model: "Model", path: Path, speed: float, true_events: TrueEvents) -> int:
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
    from holdfast.devices.sources import open_source

    with open_source(str(path), speed=speed) as source:
        if speed and sys.stderr.isatty():
            return _show_table(model, source, true_events)
        estimates = print_changes(model, source, true_events, print_message)
        return sum(1 for _ in estimates)


def print_changes(
    model: "Model", source: "Source", true_events: TrueEvents, write: Callable[[str], None]
) -> "Iterator[HandEstimate]":
    """Yield the estimates of a source, and write a line for each change that lasted."""
    from holdfast.contact import StateChanges
    from holdfast.detector import HAND
    from holdfast.live.stream_detector import StreamDetector

    write(f"     {'time':>8}   {'hand':10}  what happens, by the truth of the simulation")
    changes = StateChanges([HAND], MIN_DURATION)
    for estimate in StreamDetector(model, source):
        for change in changes.update([estimate.state], estimate.time):
            words = true_events.words(change)
            write(f"     {change.time:6.2f} s   {change.state:10}  {words}")
        yield estimate


def _show_table(model: "Model", source: "Source", true_events: TrueEvents) -> int:
    from rich.console import Console
    from rich.live import Live

    updated_at, n_updates = 0.0, 0
    console = Console(stderr=True, highlight=False)
    with Live(console=console, auto_refresh=False, transient=True, redirect_stdout=False) as screen:
        for estimate in print_changes(model, source, true_events, console.print):
            n_updates += 1
            if time.monotonic() - updated_at > SCREEN_INTERVAL:
                updated_at = time.monotonic()
                screen.update(finger_table(estimate), refresh=True)
    return n_updates


def finger_table(estimate: "HandEstimate") -> "Table":
    """Return a table of the fingers, at most 80 columns wide."""
    from rich.table import Table

    title = f"{estimate.time:.1f} s   hand {_coloured(estimate.state)}"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for heading, width in (("finger", 8), ("state", 18), ("stable", 6), ("", BAR_WIDTH)):
        table.add_column(heading, width=width)
    table.add_column("instability", width=11, justify="right")
    table.add_column(r"force \[counts]", width=14, justify="right")
    for name, finger in estimate.fingers.items():
        table.add_row(name, *_cells(finger))
    return table


def _cells(finger: "ContactEstimate") -> tuple[str, ...]:
    probability = finger.stable_probability
    known = finger.state != "UNKNOWN"
    amplitude = sum(value * value for value in finger.force) ** 0.5
    return (
        _coloured(finger.state) + (f" {finger.reason}" if finger.reason else ""),
        _number(probability, 2) if known else "-",
        "#" * round(BAR_WIDTH * probability) if known else "",
        _number(finger.instability, 1),
        _number(amplitude, 0),
    )


def _number(value: float, digits: int) -> str:
    """Return a number without a sign on zero; a dash if it is not finite.

    Example:
        >>> _number(-0.001, 1), _number(float("nan"), 1), _number(12.34, 1)
        ('0.0', '-', '12.3')
    """
    return "-" if value - value != 0 else f"{round(value, digits) + 0.0:.{digits}f}"


def _coloured(state: str) -> str:
    return f"[{TERMINAL_COLOURS[state]}]{state:10}[/]"
