"""`holdfast demo`: a real recording, then the whole chain on simulated data."""

import sys
import time
from collections.abc import Iterable, Iterator, Sequence
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
from holdfast.cli.terminal.console import (
    format_number,
    print_json,
    print_line,
    print_lines,
    print_message,
)
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.metrics import Metrics
    from holdfast.model import Model
    from holdfast.recordings import Recording
    from holdfast.training import Trained
    from holdfast.twin.simulation import Grasp

DEMO_MODEL = "builtin:twin"
"""The model of the demo: the best one that ships for the sensor of the simulated hand."""
DEMO_OBJECTS, DEMO_CASES, N_DEMO_REPEATS = "mug,carton", "1,2", 1
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
    from holdfast.cli.demo_replay import show_clip
    from holdfast.cli.serve import has_browser
    from holdfast.files import refuse_overwrite
    from holdfast.model import Model
    from holdfast.training import evaluate
    from holdfast.twin.objects import OTHER_OBJECTS
    from holdfast.twin_recordings import plan_grasps

    check_speed("twin:", speed)
    start = time.monotonic()
    folder, model = out / "recordings", out / "model.json"
    folder.mkdir(parents=True, exist_ok=True)
    refuse_overwrite(model, force=force)  # before minutes of simulation
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
    if browser is None:
        browser = has_browser() and sys.stdin.isatty()
    page = bool(browser and speed and not as_json)  # at speed 0 a page would show only the end
    n_updates = _replay(ours, shown, out, speed, page=page)
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
    from holdfast.io import load_dataset
    from holdfast.parallel import Engine
    from holdfast.twin_recordings import simulate_grasps

    names = DEMO_OBJECTS.replace(",", " and ")
    print_message(f"2/5  simulating {len(grasps)} grasps: {names}, Allegro hand, uSkin fingertips")

    def steps(items: Iterable[list[str]], what: str, total: float) -> Iterator[list[str]]:
        for new in progress(items, what, total):
            print_message(f"     {', '.join(new)}")
            yield new

    simulate_grasps(
        grasps, folder, engine=Engine(-1), force=force, notify=print_message, steps=steps
    )
    return load_dataset(folder)


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


def _replay(model: "Model", recording: "Recording", out: Path, speed: float, *, page: bool) -> int:
    """Replay a recording on a page or in the terminal; return the number of estimates."""
    from holdfast.cli.demo_replay import TrueEvents, replay, replay_on_page

    at_speed = f" at speed {speed:g}" if speed else ""
    print_message(f"5/5  replaying {recording.name} sample by sample{at_speed}")
    path = out / "recordings" / f"{recording.name}.parquet"
    if page:
        replay_on_page(model, path, out / "recorded", speed)
        return 0
    return replay(model, path, speed, TrueEvents.of(model, recording))


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
