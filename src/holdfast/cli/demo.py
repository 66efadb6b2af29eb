"""`holdfast demo`: the whole chain, from simulation to replay, on simulated data."""

import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import JsonOption
from holdfast.cli.terminal.console import print_json, print_line, print_message

if TYPE_CHECKING:
    from rich.table import Table

    from holdfast.contact import ContactEstimate, HandEstimate
    from holdfast.model import Model

OBJECTS, N_REPEATS = "can,box", 2
"""Objects of the demo, and grasps of each object and case."""
REFRESH_INTERVAL = 0.1
"""Time between two updates of the table on the terminal [s]."""
MIN_DURATION, HYSTERESIS = 0.1, 0.1
"""Debouncing of the states that a person watches: duration [s] and distance in probability."""
BAR_WIDTH = 20
COLOURS = {"UNKNOWN": "dim", "NO_CONTACT": "white", "UNSTABLE": "bold red", "STABLE": "green"}


def demo(
    out: Annotated[
        Path, typer.Argument(help="Folder for the results; it is created if missing.")
    ] = Path("holdfast-demo"),
    speed: Annotated[
        float, typer.Option(help="Speed of the replay: 1 is real time, 0 as fast as possible.")
    ] = 1.0,
    seed: Annotated[int, typer.Option(help="Seed of the recordings.")] = 0,
    browser: Annotated[
        bool,
        typer.Option("--browser/--no-browser", help="Replay on a web page, or in the terminal."),
    ] = True,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an earlier demo.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Simulate grasps, train a model on them, and replay one of them.

    Simulate grasps of a can and a box with the physical twin. Train a model on them, and print
    its cross-validated accuracy. Replay one recording sample by sample, as a hand would send it,
    on a web page or in the terminal.

    Example:
      holdfast demo
      holdfast demo --no-browser
      holdfast demo results/ --speed 0 --json
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
    print_message("2/4  training and cross-validation (the first run also compiles the kernels)")
    recordings = load_dataset(folder)
    trained = train(recordings, Setting(trials=0, seed=seed))
    trained.model.save(model, force=force)
    accuracy = trained.cross_validation.pooled.accuracy
    print_message(f"3/4  accuracy on recordings left out of training: {accuracy:.1f} % of samples")
    name = [name for name in names if name in recordings.names][-1]  # a grasp may have failed
    at_speed = f" at speed {speed:g}" if speed else ""
    print_message(f"4/4  replaying {name} sample by sample{at_speed}")
    path, steady_model = folder / f"{name}.parquet", with_debouncing(trained.model)
    n_updates = 0
    if browser and speed and not as_json:
        _replay_on_page(steady_model, path, out, speed)
    else:
        n_updates = replay(steady_model, path, speed)
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
    _print_next_steps(out, folder, model, name, time.monotonic() - start)


def _simulate(folder: Path, seed: int, force: bool) -> list[str]:
    """Simulate grasps with and without disturbances; return their names."""
    from holdfast.cli.simulate import plan_grasps, simulate_grasps

    grasps = plan_grasps(OBJECTS, "1,2", N_REPEATS, "reference", seed)
    print_message(f"1/4  simulating {len(grasps)} grasps: an Allegro hand with uSkin fingertips")
    simulate_grasps(grasps, folder, jobs=-1, force=force)
    return [grasp.name for grasp in grasps]


def with_debouncing(model: "Model") -> "Model":
    """Return the model with debouncing, so that a person can follow its states."""
    from msgspec.structs import replace

    from holdfast.model import Debounce

    return replace(model, debounce=Debounce(MIN_DURATION, HYSTERESIS))


def _replay_on_page(model: "Model", path: Path, out: Path, speed: float) -> None:
    """Replay on a web page; at a terminal the page stays open until Ctrl-C."""
    from holdfast.cli.serve import open_browser, run_page
    from holdfast.sources import open_source

    stay = sys.stdin.isatty()
    with open_source(str(path), speed=speed, loop=stay) as source:

        def announce(url: str) -> None:
            opened = open_browser(url)
            print_message(f"     {url} {'has opened' if opened else '(open it in a browser)'}")
            print_message(
                "     Ctrl-C stops it" if stay else "     it stops at the end of the recording"
            )

        run_page(model, source, announce, port=0, folder=out / "recorded", stay=stay)


def replay(model: "Model", path: Path, speed: float) -> int:
    """Play a recording sample by sample through a detector, and print the states.

    On a terminal a table follows all states; elsewhere each change of the hand is one line.

    Args:
        model: the model to use.
        path: path of the recording.
        speed: 1 is real time, 0 as fast as possible.

    Returns:
        Number of estimates.
    """
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.sources import open_source

    with open_source(str(path), speed=speed) as source:
        estimates = iter(StreamDetector(model, source))
        if speed and sys.stderr.isatty():
            return _show_table(estimates)
        return _print_changes(estimates)


def _print_changes(estimates: "Iterator[HandEstimate]") -> int:
    previous: str = "UNKNOWN"
    n_updates = 0
    for estimate in estimates:
        n_updates += 1
        if estimate.state != previous:
            print_message(f"  {estimate.time:7.3f} s  hand {previous} -> {estimate.state}")
            previous = estimate.state
    return n_updates


def _show_table(estimates: "Iterator[HandEstimate]") -> int:
    from rich.console import Console
    from rich.live import Live

    updated_at, n_updates = 0.0, 0
    with Live(console=Console(stderr=True), auto_refresh=False) as screen:
        for estimate in estimates:
            n_updates += 1
            if time.monotonic() - updated_at > REFRESH_INTERVAL:
                updated_at = time.monotonic()
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


def _print_next_steps(out: Path, folder: Path, model: Path, name: str, seconds: float) -> None:
    print_line(f"finished in {seconds:.0f} s; results in {out}:")
    print_line(f"  {folder}: simulated recordings, {model}: the model")
    print_line("what to try next:")
    print_line(f"  holdfast info {folder}/{name}.parquet --plot grasp.png")
    print_line(f"  holdfast evaluate {model} {folder}")
    print_line(f"  holdfast detect {model} {folder}/{name}.parquet | head")
    print_line(f"  holdfast serve {model} twin:?object=ball    (live page of the twin)")
    print_line("  holdfast serve builtin:twin xela://auto    (live page of your own hand)")
    print_line("  holdfast simulate twin/    (the whole protocol: six objects, 60 grasps)")
    print_line("  holdfast import YOUR-DATA recordings/    (formats: holdfast import --help)")
