"""`holdfast demo`: a real recording, then the whole chain on simulated data."""

import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from holdfast.cli.options import (
    BrowserOption,
    ForceOption,
    JsonOption,
    SeedOption,
    SpeedOption,
    check_speed,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message, print_paragraph
from holdfast.cli.terminal.progress import progress
from holdfast.errors import OutputError, require_extras
from holdfast.files import refuse_overwrite

DEMO_MODEL = "builtin:twin"
"""The model of the demo: the best one that ships for the sensor of the simulated hand."""
DEMO_OBJECTS, DEMO_CASES, N_DEMO_REPEATS = "mug,carton", "1,2", 1
"""Objects of the demo, none of which `DEMO_MODEL` was trained on; cases and grasps of each."""

REPLAY_SPEED = 2.0
"""Speed of the replay in the terminal, as a multiple of `--speed`: 26 s of a grasp are long."""

NEXT_STEPS = {
    "info {shown} --plot grasp.png": "",
    f"evaluate {DEMO_MODEL} {{folder}}": "all figures",
    f"serve {DEMO_MODEL} 'twin:?object=can'": "a live page of the twin",
    "serve builtin:any xela://auto": "a live page of your own hand",
    "import --help": "your own recordings",
}
"""Commands that are printed at the end, and what they are for."""


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

    Run the detector on a recording of a real robot that loses a box, as holdfast detect does.
    Simulate grasps of a mug and a carton with the physical twin. Evaluate the model that ships with
    holdfast on them; it has not seen these objects. Train a model with the features of the paper on
    them. Replay one recording sample by sample, as a hand would send it, on a web page or in the
    terminal.

    Example:
      holdfast demo
      holdfast demo --no-browser
      holdfast demo results/ --speed 0 --json
    """
    check_speed("twin:", speed)
    if seed < 0:
        raise ValueError(f"--seed: at least 0 expected, {seed} given")
    start = time.monotonic()
    folder, model = out / "recordings", out / "model.json"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise OutputError(f"cannot write to {out}: {cause.strerror}") from cause
    refuse_overwrite(model, force=force)  # before minutes of simulation
    print_message("1/5  a real recording: a robot carries a box between two uSkin sensors")
    real = show_real_recording(speed)
    # The core shows the recording; what comes now needs the extras, and takes long to import.
    require_extras("twin", "train", "parquet")
    print_message(f"2/5  simulating grasps of {DEMO_OBJECTS}: an Allegro hand with uSkin")
    from holdfast import Model, load_dataset
    from holdfast.cli.detect.output import watch
    from holdfast.live.web.serving import show_recording
    from holdfast.parallel import Engine
    from holdfast.simulated_grasps import path_of, plan_grasps, simulate_grasps
    from holdfast.training import Setting, train
    from holdfast.training.evaluation import evaluate_recordings
    from holdfast.twin.objects import OTHER_OBJECTS
    from holdfast.web.server import has_browser

    grasps = plan_grasps(
        DEMO_OBJECTS, DEMO_CASES, N_DEMO_REPEATS, "reference", seed, table=OTHER_OBJECTS
    )
    simulate_grasps(
        grasps, folder, engine=Engine(-1), force=force, notify=print_message, steps=progress
    )
    recordings = load_dataset(folder)
    print_message(f"3/5  evaluating {DEMO_MODEL}, which was not trained on these objects")
    evaluation = evaluate_recordings(Model.load(DEMO_MODEL), recordings)
    print_message("4/5  training a model with the features of the paper, one grasp left out")
    trained = train(recordings, Setting(trials=0, seed=seed))
    trained.model.save(model, force=force)
    shown = path_of(recordings.names[-1], folder)
    print_message(f"5/5  replaying {shown.stem} sample by sample, with the changes of the hand")
    wanted = has_browser() and sys.stdin.isatty() if browser is None else browser
    page = wanted and speed and not as_json  # at speed 0 a page would show only the end
    replayed = None if page else watch(DEMO_MODEL, shown, REPLAY_SPEED * speed, fingers=False)
    if page:
        show_recording(DEMO_MODEL, shown, out / "recorded", speed, print_message)
    seconds = time.monotonic() - start
    if as_json:
        print_json({
            "real": real, "recordings": folder, "model": model, "replay": replayed,
            "accuracy": trained.cross_validation.pooled.accuracy, "seconds": seconds,
            "shipped": {"model": DEMO_MODEL, "metrics": evaluation.metrics},
        })  # fmt: skip
        return
    print_line()
    print_line(f"finished in {seconds:.0f} s; recordings and model.json are in {out}/. Next:")
    print_next_steps(shown, folder)
    # The verdicts stand last, where the eye is; all of it fits a screen of 24 lines.
    print_line()
    print_line(f"{DEMO_MODEL} on {len(recordings)} grasps of objects that it was not trained on:")
    print_paragraph(evaluation.verdict or "")
    print_line("a model of the paper's features, trained here, each grasp left out once:")
    print_paragraph(trained.verdict or "")


def show_real_recording(speed: float) -> dict[str, Any]:
    """Show the changes of a real recording, and what its authors labelled; return its summary.

    It needs the core alone.
    """
    from holdfast.cli.detect.output import watch
    from holdfast.demo_data import BOX_SLIPS
    from holdfast.io import load_recording

    summary = watch("builtin:any", BOX_SLIPS, speed)
    labels = load_recording(BOX_SLIPS).modules["finger1"].labels
    causes = ", ".join(f"{label.cause} at {label.start:.3f} s" for label in labels if label.cause)
    print_message(f"     the authors of the recording label: {causes}")
    return summary


def print_next_steps(shown: Path, folder: Path) -> None:
    """Print what to try next, one command a line."""
    for command, purpose in NEXT_STEPS.items():
        words = command.format(shown=shown, folder=folder)
        print_line(f"  holdfast {words}" + f"  # {purpose}" * bool(purpose))
