"""`holdfast simulate`: recordings of the physical twin, with exact truth."""

from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.extensions import SimulatorOptions
from holdfast.cli.options import EngineOptions, ForceOption, FpsOption, JsonOption
from holdfast.cli.simulate.options import GraspOptions
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras


def simulate(
    out: Annotated[
        Path, typer.Argument(help="Folder for the recordings; it is created if missing.")
    ],
    *,
    options: GraspOptions,
    simulators: SimulatorOptions,
    parallel: EngineOptions,
    video: Annotated[
        bool,
        typer.Option(
            "--video",
            help="Write NAME.mp4 beside each recording: stickers on object and fingers, by webcam.",
        ),
    ] = False,
    fps: FpsOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Simulate recordings of grasps with the physical twin.

    It follows the protocol of the paper: an Allegro hand with uSkin fingertips closes on an
    object, holds it (case 1) or holds it while a person disturbs it (case 2), and releases it.
    Every recording contains the truth: forces, slip, poses and phases. Existing recordings are
    kept without --force, so the same command continues a run that was stopped. The same seed gives
    the same bytes. If the object is dropped, the recording is named "...-failed1" and the grasp is
    repeated with weaker disturbances.

    With --randomize, every recording has another hand: two to four fingers or a parallel
    gripper, six kinds of sensors in counts or newtons at 30 to 500 Hz, another object, and an arm
    that carries, swings, brakes and turns; with --grasps, several recordings of each. Only
    --repeats, --grasps, --seed, --engine, --jobs and --force apply then (--help-all). With --engine
    dask:ADDRESS, the workers write into OUT, which all machines need at the same path.

    Example:
      holdfast simulate twin/ --jobs -1
      holdfast simulate hands/ --randomize --repeats 100
      holdfast simulate hands/ --randomize --repeats 12 --grasps 20
      holdfast simulate few/ --objects can,ball --cases 2 --repeats 1
      holdfast simulate filmed/ --profile slips --cases 2 --repeats 1 --video
    """
    require_extras("twin", "parquet", *(("video",) if video else ()))
    engine = parallel.start()
    if chosen := simulators.chosen():
        profile, simulator, values = chosen[0]
        names = simulator.simulate(out, options, values, engine=engine, force=force)
        text = f"{len(names)} recordings of {profile} hands in {out}"
    else:
        from holdfast.simulated_grasps import film_all, simulate_grasps

        profile, planned = options.profile, options.plan(engine)
        out.mkdir(parents=True, exist_ok=True)
        names = simulate_grasps(
            planned, out, engine=engine, force=force, notify=print_message, steps=progress
        )
        if video:
            film_all(planned, out, fps, engine=engine, force=force, steps=progress)
        n_failed = sum("-failed" in name for name in names)
        text = f"{len(names)} recordings in {out}, {n_failed} of them of failed grasps"
    if as_json:
        failed = [name for name in names if "-failed" in name]
        print_json({"out": out, "recordings": names, "failed": failed, "profile": profile})
    else:
        print_line(text)
