"""`holdfast demo`: a real recording, then the whole chain on simulated data."""

import time
from collections.abc import Mapping
from itertools import chain, count
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
from holdfast.files import refuse_overwrite, whole_file

if TYPE_CHECKING:
    from holdfast.recordings import Label

DEMO_MODEL = "builtin:twin"
"""The model of the demo: the best one that ships for the sensor of the simulated hand."""
DEMO_OBJECTS, DEMO_CASES, N_DEMO_REPEATS = "mug,carton", "1,2", 1
"""Objects of the demo, with the cases and grasps of each; `DEMO_MODEL` was trained on others."""

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
        Path | None,
        typer.Argument(
            help="Folder for the results; it is created if missing.",
            show_default="holdfast-demo, or holdfast-demo-2, ... if it exists",
        ),
    ] = None,
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
    terminal. Draw the real recording with the labels of its authors. All of it takes 41 s
    from a fresh clone, with the packages in the cache, and 29 s once it is installed.

    Example:
      holdfast demo
      holdfast demo --no-browser
      holdfast demo results/ --speed 0 --json
    """
    check_speed("twin:", speed)
    if seed < 0:
        raise ValueError(f"--seed: at least 0 expected, {seed} given")
    start = time.monotonic()
    out = out or new_folder(force=force)
    folder, model = out / "recordings", out / "model.json"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise OutputError(f"cannot write to {out}: {cause.strerror}") from cause
    refuse_overwrite(model, force=force)  # before minutes of simulation
    print_message("1/5  a real recording: a robot carries a box between two uSkin sensors")
    real, slip = show_real_recording(speed)
    # The core shows the recording; what comes now needs the extras, and takes long to import.
    require_extras("twin", "train", "parquet", "plot")
    print_message(f"2/5  simulating grasps of {DEMO_OBJECTS}: an Allegro hand with uSkin")
    from holdfast import Model, load_dataset
    from holdfast.parallel import Engine
    from holdfast.simulated_grasps import path_of, plan_grasps, simulate_grasps
    from holdfast.training import Setting, train
    from holdfast.training.evaluation import evaluate_recordings
    from holdfast.twin.objects import OTHER_OBJECTS

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
    # At speed 0 a page would show only the end.
    wanted = browser if speed and not as_json else False
    replayed = replay(shown, out / "recorded", speed, browser=wanted)
    lead, picture = slip.start - unstable_since(real, slip), draw_real_recording(out, force=force)
    seconds = time.monotonic() - start
    if as_json:
        print_json({
            "real": real, "recordings": folder, "model": model, "replay": replayed,
            "accuracy": trained.cross_validation.pooled.accuracy, "seconds": seconds,
            "shipped": {"model": DEMO_MODEL, "metrics": evaluation.metrics},
            "picture": picture, "lead": lead,
        })  # fmt: skip
        return
    print_line()
    print_line(f"finished in {seconds:.0f} s; recordings and model.json are in {out}/. Next:")
    print_next_steps(shown, folder)
    print_line()
    print_line(f"{DEMO_MODEL} on {len(recordings)} grasps of objects that it was not trained on:")
    print_paragraph(evaluation.verdict or "")
    print_line("a model of the paper's features, trained here, each grasp left out once:")
    print_paragraph(trained.verdict or "")
    # The result is printed last; all lines fit a screen of 24 lines.
    print_line()
    side = "before" if lead >= 0 else "after"
    print_line(f"{picture}: UNSTABLE {abs(lead):.2f} s {side} the authors' label")


def new_folder(*, force: bool) -> Path:
    """Return `holdfast-demo`, or with a number if it exists and may not be replaced."""
    names = chain(["holdfast-demo"], map("holdfast-demo-{}".format, count(2)))
    return next(path for path in map(Path, names) if force or not path.exists())


def replay(
    shown: Path, recorded: Path, speed: float, *, browser: bool | None
) -> dict[str, Any] | None:
    """Replay a recording on a page, or in the terminal: then return its summary.

    Args:
        shown: the recording.
        recorded: folder for what is recorded on the page.
        speed: of the replay.
        browser: whether it is a page; None if this is a terminal and may have a browser.
    """
    from holdfast.cli.detect.output import watch
    from holdfast.live.web.serving import show_recording
    from holdfast.web.server import wants_browser

    if wants_browser(browser):
        show_recording(DEMO_MODEL, shown, recorded, speed, print_message)
        return None
    return watch(DEMO_MODEL, shown, REPLAY_SPEED * speed, fingers=False)


def show_real_recording(speed: float) -> "tuple[dict[str, Any], Label]":
    """Show the changes of a real recording, and what its authors labelled.

    It needs the core alone.

    Returns:
        The summary of the detection, and the authors' label of the slip.
    """
    from holdfast.cli.detect.output import watch
    from holdfast.demo_data import BOX_SLIPS
    from holdfast.io import load_recording

    summary = watch("builtin:any", BOX_SLIPS, speed)
    labels = [x for x in load_recording(BOX_SLIPS).modules["finger1"].labels if x.cause]
    causes = ", ".join(f"{label.cause} at {label.start:.3f} s" for label in labels)
    print_message(f"     the authors of the recording label: {causes}")
    return summary, labels[0]


def unstable_since(summary: Mapping[str, Any], label: "Label") -> float:
    """Return since when the hand is UNSTABLE as a label begins, or becomes so after it [s]."""
    events = [x for x in summary["events"] if x["finger"] == "hand"]
    ends = [*(x["time"] for x in events[1:]), inf]
    spans = zip(events, ends, strict=True)
    return float(
        next(x["time"] for x, end in spans if x["state"] == "UNSTABLE" and end > label.start)
    )


def draw_real_recording(folder: Path, *, force: bool) -> Path:
    """Draw force, states and the authors' labels of the real recording; return the path."""
    from holdfast import Model, detect, load_recording
    from holdfast.demo_data import BOX_SLIPS
    from holdfast.plots.detection import figure_of_detection
    from holdfast.plots.style import FONT_SIZE

    recording, path = load_recording(BOX_SLIPS), folder / "box-slips.png"
    figure = figure_of_detection(detect(Model.load("builtin:any"), recording))
    for axes, module in zip(figure.axes, recording.modules.values(), strict=True):
        for label in module.labels:
            if label.cause:
                axes.axvline(label.start, color="black", linestyle="--", linewidth=1)
                axes.annotate(
                    f" label: {label.cause}", (label.start, 0.5), fontsize=FONT_SIZE,
                    xycoords=("data", "axes fraction"),
                )  # fmt: skip
    with whole_file(path, force=force) as part:
        figure.savefig(part)
    return path


def print_next_steps(shown: Path, folder: Path) -> None:
    """Print what to try next, one command a line."""
    for command, purpose in NEXT_STEPS.items():
        words = command.format(shown=shown, folder=folder)
        print_line(f"  holdfast {words}" + f"  # {purpose}" * bool(purpose))
