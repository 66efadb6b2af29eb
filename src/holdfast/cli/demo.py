"""`holdfast demo`: the whole chain, from simulation to replay, on simulated data."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import (
    BrowserOption,
    ForceOption,
    JsonOption,
    SeedOption,
    SpeedOption,
    check_speed,
)
from holdfast.cli.terminal.console import print_json, print_line, print_lines, print_message
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.metrics import Metrics
    from holdfast.model import Model
    from holdfast.recordings import Recording
    from holdfast.training import Trained

DEMO_MODEL = "builtin:twin"
"""The model of the demo: the best one that ships for the sensor of the simulated hand."""
OBJECTS, CASES, N_REPEATS = "mug,carton", "1,2", 1
"""Objects of the demo, none of which `DEMO_MODEL` was trained on; cases and grasps of each."""


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
    """Simulate grasps, detect and train on them, and replay one.

    Simulate grasps of a mug and a carton with the physical twin. Evaluate the model that ships
    with holdfast on them; it has not seen these objects. Train a model with the features of the
    paper on them. Replay one recording sample by sample, as a hand would send it, on a web page
    or in the terminal.

    Example:
      holdfast demo
      holdfast demo --no-browser
      holdfast demo results/ --speed 0 --json
    """
    require_extras("twin", "train", "parquet")
    from holdfast.files import refuse_overwrite
    from holdfast.model import Model
    from holdfast.training import evaluate

    check_speed("twin:", speed)
    start = time.monotonic()
    folder, model = out / "recordings", out / "model.json"
    folder.mkdir(parents=True, exist_ok=True)
    refuse_overwrite(model, force=force)
    recordings = _simulate(folder, seed, force)
    print_message(f"2/4  evaluating {DEMO_MODEL}, which was not trained on these objects")
    print_message("     (the first run on a machine compiles the detector here)")
    ours = Model.load(DEMO_MODEL)
    metrics = evaluate(ours, recordings)
    trained = _train(recordings, model, seed, force)
    shown = recordings[-1]
    n_updates = _replay(ours, shown, out, speed, page=_on_page(browser, speed, as_json=as_json))
    if as_json:
        print_json(
            {
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


def _simulate(folder: Path, seed: int, force: bool) -> "Sequence[Recording]":
    """Simulate grasps with and without disturbances; return those that did not fail."""
    from holdfast.cli.simulate import plan_grasps, simulate_grasps
    from holdfast.io import load_dataset
    from holdfast.twin.objects import OTHER_OBJECTS

    grasps = plan_grasps(OBJECTS, CASES, N_REPEATS, "reference", seed, table=OTHER_OBJECTS)
    names = OBJECTS.replace(",", " and ")
    print_message(f"1/4  simulating {len(grasps)} grasps: {names}, Allegro hand, uSkin fingertips")
    simulate_grasps(grasps, folder, jobs=-1, force=force, report=_report_grasp)
    return load_dataset(folder)


def _report_grasp(names: Sequence[str]) -> None:
    print_message(f"     {', '.join(names)}")


def _train(recordings: "Sequence[Recording]", path: Path, seed: int, force: bool) -> "Trained":
    """Train a model with the features of the paper, and save it with a name."""
    from dataclasses import replace

    import msgspec

    from holdfast.training import Setting, train

    print_message("3/4  training a model with the features of the paper, one grasp left out")
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
    print_message(f"4/4  replaying {recording.name} sample by sample{at_speed}")
    path = out / "recordings" / f"{recording.name}.parquet"
    if page:
        _replay_on_page(model, path, out, speed)
        return 0
    from holdfast.cli.demo_replay import TrueEvents, replay

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

        run_page(model, session, announce, port=0, folder=out / "recorded", stay=stay)


def _print_results(metrics: "Metrics", trained: "Trained", n: int) -> None:
    hand = metrics.events.hand
    missed, delay = hand.missed["0.1"], hand.delay_median
    detected = "-" if missed is None else f"{100 - missed:.0f} %"
    print_line()
    print_line(f"{DEMO_MODEL} on {n} grasps of objects that it was not trained on:")
    print_line(f"  {hand.n_events} disturbances of a held object, {detected} detected within 0.1 s")
    print_line(f"  median delay {'-' if delay is None else f'{1000 * delay:.0f} ms'}")
    print_line(f"  {_text(hand.false_alarms_per_minute)} false alarms per minute of quiet hold")
    print_line(f"  {_text(metrics.pooled.accuracy)} % of all samples are classified as labelled")
    own = trained.cross_validation.pooled.accuracy
    print_line("a model of the paper's features, trained here, each grasp left out once:")
    print_line(f"  {_text(own)} % of all samples are classified as labelled")


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


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
