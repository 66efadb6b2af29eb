"""`holdfast demo`: the main job in one go, on data of its own."""

import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.terminal.console import print_json, say, show

if TYPE_CHECKING:
    from rich.table import Table

    from holdfast.contact import ContactEstimate, HandEstimate
    from holdfast.model import Model

OBJECTS, REPEATS = "can,box", 2
"""What is grasped in the demo, and how often in each case."""


def demo(
    out: Annotated[
        Path, typer.Argument(help="A folder for what is made; it is made if missing.")
    ] = Path("holdfast-demo"),
    speed: Annotated[
        float, typer.Option(help="Of the replay: 1 is real time, 0 as fast as it goes.")
    ] = 1.0,
    seed: Annotated[int, typer.Option(help="Of the recordings.")] = 0,
    browser: Annotated[
        bool,
        typer.Option("--browser/--no-browser", help="Replay on a page, or in the terminal."),
    ] = True,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an earlier demo.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")] = False,
) -> None:
    """Does the main job in one go, on data of its own.

    Simulates grasps of a can and a box with the physical twin, trains a model on them, tells how
    good it is on recordings that it has not seen, and replays one of those sample by sample, as
    a hand would send it: on a page of its own, or in the terminal.

    Example:
      holdfast demo
      holdfast demo --no-browser
      holdfast demo tried/ --speed 0 --json
    """
    from holdfast.files import refuse_overwrite
    from holdfast.io import load_dataset
    from holdfast.training import Setting, train

    if not (math.isfinite(speed) and speed >= 0):
        raise ValueError(f"--speed: at least 0 expected, {speed:g} given")
    start = time.monotonic()
    folder, model = out / "recordings", out / "model.json"
    folder.mkdir(parents=True, exist_ok=True)
    refuse_overwrite(model, force=force)
    names = _simulate(folder, seed, force)
    say("2/4  training, one recording left out at a time (compiles kernels the first time)")
    recordings = load_dataset(folder)
    trained = train(recordings, Setting(trials=0, seed=seed))
    trained.model.save(model, force=force)
    accuracy = trained.cross_validation.pooled.accuracy
    say(f"3/4  on recordings that it has not seen: {accuracy:.1f} % of samples right")
    name = [name for name in names if name in recordings.names][-1]  # one may have failed
    say(f"4/4  replaying {name} sample by sample" + (f" at speed {speed:g}" if speed else ""))
    shown, judged = folder / f"{name}.parquet", calmer(trained.model)
    n_updates = 0
    if browser and speed and not as_json:
        _show_page(judged, shown, out, speed)
    else:
        n_updates = replay(judged, shown, speed)
    if as_json:
        print_json(
            {
                "recordings": folder,
                "model": model,
                "accuracy": accuracy,
                "updates": n_updates,
                "seconds": time.monotonic() - start,
            }
        )
        return
    _farewell(out, folder, model, name, time.monotonic() - start)


def _simulate(folder: Path, seed: int, force: bool) -> list[str]:
    """A few grasps of the twin, with and without disturbances; names of those that held."""
    from holdfast.cli.simulate import grasps, make_all

    wanted = grasps(OBJECTS, "1,2", REPEATS, "reference", seed)
    say(f"1/4  simulating {len(wanted)} grasps: an Allegro hand with uSkin fingertips")
    make_all(wanted, folder, jobs=-1, force=force)
    return [grasp.name for grasp in wanted]


def _show_page(model: "Model", path: Path, out: Path, speed: float) -> None:
    """The replay on a page; it stays until Ctrl-C where somebody sits before a terminal."""
    from holdfast.cli.serve import open_page, show_page
    from holdfast.sources import open_source

    stay = sys.stdin.isatty()
    with open_source(str(path), speed=speed, loop=stay) as source:

        def tell(url: str) -> None:
            opened = open_page(url)
            say(f"     {url} {'has opened' if opened else 'shows it: open it in a browser'}")
            say("     Ctrl-C ends it" if stay else "     it ends with the recording")

        show_page(model, source, tell, port=0, folder=out / "recorded", stay=stay)


def _farewell(out: Path, folder: Path, model: Path, name: str, seconds: float) -> None:
    show(f"made in {seconds:.0f} s, in {out}:")
    show(f"  {folder}: recordings of the twin, {model}: the model")
    show("what to try next:")
    show(f"  holdfast info {folder}/{name}.parquet --plot grasp.png")
    show(f"  holdfast evaluate {model} {folder}")
    show(f"  holdfast detect {model} {folder}/{name}.parquet | head")
    show(f"  holdfast serve {model} twin:?object=ball    (the page, live)")
    show("  holdfast serve builtin:twin xela://auto    (your own hand)")
    show("  holdfast simulate twin/      (the whole protocol: six objects, 60 grasps)")
    show("  holdfast import YOUR-DATA recordings/    (holdfast import --help lists the formats)")


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
