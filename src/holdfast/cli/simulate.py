"""`holdfast simulate`: recordings of the physical twin, with exact truth."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.extensions import SimulatorOptions
from holdfast.cli.options import (
    RARE,
    EngineOption,
    ForceOption,
    FpsOption,
    JobsOption,
    JsonOption,
    SeedOption,
    start_engine,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.parallel import Engine
    from holdfast.twin.simulation import Grasp


@dataclass(frozen=True)
class GraspOptions:
    """Group of options: which grasps are simulated."""

    objects: Annotated[
        str, typer.Option(help="Names of objects, separated by commas; by default all objects.")
    ] = ""
    table: Annotated[
        Path | None,
        typer.Option(help="Your own objects: a .toml file like that of the twin."),
        RARE,
    ] = None
    cases: Annotated[str, typer.Option(help="1: hold; 2: hold and disturb; or 1,2.")] = "1,2"
    repeats: Annotated[
        int,
        typer.Option(help="Number of grasps of each object and case, or of --randomize hands."),
    ] = 5
    profile: Annotated[
        str,
        typer.Option(
            help="Profile of grip and disturbances: gentle, reference, vigorous, slips, "
            "long-hold, finger-gentle, ..."
        ),
        RARE,
    ] = "reference"
    seed: SeedOption = 0
    server: Annotated[
        bool,
        typer.Option(
            "--server", help="Add irregular times and repeated packets, as a XELA server has."
        ),
        RARE,
    ] = False
    faults: Annotated[
        str,
        typer.Option(
            help="Troubles of magnetic skins, as field=300,turn-time=3,zero-share=0.02,drift=20000,"
            "cross-talk=0.1,invented-months=4 (counts, s, shares, counts an hour, months)."
        ),
        RARE,
    ] = ""

    def plan(self, engine: "Engine") -> "list[Grasp]":
        """Return the grasps of an Allegro hand.

        Raises:
            ValueError: an unknown object, case, profile or fault, or a number out of range.
        """
        from holdfast.twin_recordings import plan_grasps

        table = None if self.table is None else engine.path(self.table)
        return plan_grasps(
            self.objects, self.cases, self.repeats, self.profile, self.seed,
            server=self.server, table=table, faults=self.faults,
        )  # fmt: skip


def simulate(
    out: Annotated[
        Path, typer.Argument(help="Folder for the recordings; it is created if missing.")
    ],
    *,
    options: GraspOptions,
    simulators: Annotated[SimulatorOptions, RARE],
    engine: EngineOption = "loky",
    jobs: JobsOption = -1,
    film: Annotated[
        Path | None,
        typer.Option(
            help="Write a film of the first grasp to this .gif, .png, .webp or .mp4 file."
        ),
        RARE,
    ] = None,
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
      holdfast simulate twin/
      holdfast simulate hands/ --randomize --repeats 100
      holdfast simulate hands/ --randomize --repeats 12 --grasps 20
      holdfast simulate few/ --objects can,ball --cases 2 --repeats 1
      holdfast simulate filmed/ --profile slips --cases 2 --repeats 1 --video
      holdfast simulate /shared/twin --engine dask:tcp://hub:8786
    """
    require_extras("twin", "parquet", *(("video",) if video else ()))
    started = start_engine(engine, jobs)
    if chosen := simulators.chosen():
        profile, simulator, values = chosen[0]
        names = simulator.simulate(out, options, values, engine=started, force=force)
        text = f"{len(names)} recordings of {profile} hands in {out}"
    else:
        from holdfast.twin_recordings import film_all

        names, profile = _simulate(options, out, film, started, force), options.profile
        if video:
            film_all(options.plan(started), out, fps, engine=started, force=force, steps=progress)
        n_failed = sum("-failed" in name for name in names)
        text = f"{len(names)} recordings in {out}, {n_failed} of them of failed grasps"
    if as_json:
        failed = [name for name in names if "-failed" in name]
        print_json({"out": out, "recordings": names, "failed": failed, "profile": profile})
    else:
        print_line(text)


def _simulate(
    options: GraspOptions, out: Path, film: Path | None, engine: "Engine", force: bool
) -> list[str]:
    """Simulate the grasps of an Allegro hand, and the film if it is wanted."""
    from holdfast.files import refuse_overwrite, whole_file
    from holdfast.twin_recordings import simulate_grasps

    if film is not None:
        from holdfast.twin.render import check_film

        check_film(film)
        refuse_overwrite(film, force=force)  # before minutes of simulation
    planned = options.plan(engine)
    out.mkdir(parents=True, exist_ok=True)
    names = simulate_grasps(
        planned, out, engine=engine, force=force, notify=print_message, steps=progress
    )
    if film is not None:
        from holdfast.twin.render import film as render

        print_message(f"rendering {planned[0].name}: about a minute")
        with whole_file(film, force=force) as part:
            render(planned[0], part)
    return names
