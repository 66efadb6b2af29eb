"""`holdfast simulate`: recordings of the physical twin, with exact truth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    check_shared,
    start_engine,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import ProgressBar
from holdfast.errors import require_extras
from holdfast.twin.profile import GRASP_ATTEMPTS

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

    def plan(self, engine: "Engine") -> "list[Grasp]":
        """Return the grasps of an Allegro hand.

        Raises:
            ValueError: an unknown object, case or profile, or a number out of range.
        """
        table = None if self.table is None else engine.path(self.table)
        return plan_grasps(
            self.objects, self.cases, self.repeats, self.profile, self.seed,
            server=self.server, table=table,
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
        names = _simulate_planned(options, out, film, engine=started, force=force)
        if video:
            _film_stickers(options.plan(started), out, fps, engine=started, force=force)
        n_failed = len(_failed(names))
        profile = options.profile
        text = f"{len(names)} recordings in {out}, {n_failed} of them of failed grasps"
    if as_json:
        failed = _failed(names)
        print_json({"out": out, "recordings": names, "failed": failed, "profile": profile})
    else:
        print_line(text)


def _failed(names: list[str]) -> list[str]:
    return [name for name in names if "-failed" in name]


def _simulate_planned(
    options: GraspOptions, out: Path, film: Path | None, *, engine: "Engine", force: bool
) -> list[str]:
    """Simulate the grasps of an Allegro hand, and the film if it is wanted."""
    if film is not None:
        from holdfast.files import refuse_overwrite
        from holdfast.twin.render import check_film

        check_film(film)
        refuse_overwrite(film, force=force)
    planned = options.plan(engine)
    out.mkdir(parents=True, exist_ok=True)
    names = simulate_grasps(planned, out, engine=engine, force=force)
    if film is not None:
        _write_film(planned[0], film, force)
    return names


def _film_stickers(
    grasps: "Sequence[Grasp]", out: Path, fps: float | None, *, engine: "Engine", force: bool
) -> None:
    """Write the videos of a webcam that do not exist; `label auto tracking` reads them."""
    paths = [engine.path(path_of(grasp.name, out)) for grasp in grasps]
    missing = [path for path in paths if path.exists() and (force or not _video_of(path).exists())]
    with ProgressBar("filming", len(missing)) as bar:
        for _ in engine.map_ordered(film_recording, ((path, fps, force) for path in missing)):
            bar.advance()


def film_recording(path: Path, fps: float | None, force: bool) -> None:
    """Write the video of a recording beside it."""
    from holdfast.files import whole_file
    from holdfast.io import load_recording
    from holdfast.twin.webcam import Webcam, film_stickers

    with whole_file(_video_of(path), force=force) as part:
        film_stickers(load_recording(path), part, Webcam() if fps is None else Webcam(fps=fps))


def _video_of(path: Path) -> Path:
    return path.with_suffix(".mp4")


def simulate_grasps(
    grasps: "Sequence[Grasp]",
    out: Path,
    *,
    jobs: int = -1,
    engine: "Engine | None" = None,
    force: bool,
    report: Callable[[list[str]], None] = lambda _: None,
) -> list[str]:
    """Simulate the grasps whose recordings do not exist; return the names of new recordings.

    They are simulated in `jobs` processes of this machine, or by `engine`. `report` is called
    with the names of the recordings of each finished grasp.

    Raises:
        OutputError: an existing recording has another seed or profile.
    """
    from holdfast.parallel import Engine

    missing = [grasp for grasp in grasps if force or not _is_finished(grasp, out)]
    return simulate_all(
        simulate_grasp, missing, len(grasps), out,
        engine=engine or Engine(jobs), force=force, report=report,
    )  # fmt: skip


def simulate_all(
    simulate_one: Callable[..., list[str]],
    missing: "Sequence[Any]",
    n_wanted: int,
    out: Path,
    *,
    engine: "Engine",
    force: bool,
    report: Callable[[list[str]], None] = lambda _: None,
) -> list[str]:
    """Simulate what is missing, in parallel; return the names of the recordings.

    Args:
        simulate_one: called with one of `missing`, the folder and `force`; returns names.
        missing: what is to be simulated.
        n_wanted: how many there are with those that exist.
        out: folder for the recordings.
        engine: makes the calls.
        force: overwrite recordings.
        report: called with the names of the recordings of each finished call.
    """
    if len(missing) < n_wanted:
        print_message(f"{n_wanted - len(missing)} of {n_wanted} recordings exist already")
    if len(missing) == 1 and engine.scheduler is None:
        engine = engine._replace(n_jobs=1)  # one task needs no other process
    tasks = ((grasp, engine.path(out), force) for grasp in missing)
    written = []
    with ProgressBar("simulating", len(missing)) as bar:
        for names in engine.map_ordered(simulate_one, tasks):
            check_shared(path_of(names[-1], out), engine)
            written += names
            report(names)
            bar.advance()
    return written


def simulate_grasp(grasp: "Grasp", out: Path, force: bool) -> list[str]:
    """Simulate a grasp until it succeeds; return the names of the recordings."""
    from dataclasses import replace

    from holdfast.io import save_recording
    from holdfast.twin.simulation import simulate as run

    names = []
    for attempt in range(GRASP_ATTEMPTS):
        trial = replace(grasp, attempt=attempt)
        if not force and _exists(trial, path_of(trial.failed_name, out)):
            continue
        recording = run(trial)
        save_recording(recording, path_of(recording.name, out), force=force)
        names.append(recording.name)
        if recording.metadata["case"] != "failed":
            break
    if force:
        _remove_others(grasp, out, names)
    return names


def plan_grasps(
    objects: str,
    cases: str,
    repeats: int,
    profile: str,
    seed: int,
    *,
    server: bool = False,
    table: Path | None = None,
) -> "list[Grasp]":
    """Return the grasps of all objects, cases and repeats.

    Raises:
        ValueError: an unknown object, case or profile, or a number out of range.
    """
    from holdfast.twin.objects import load_objects
    from holdfast.twin.profile import profile as check_profile
    from holdfast.twin.simulation import GRASP_CASES, Grasp

    names = [name.strip() for name in objects.split(",")] if objects else list(load_objects(table))
    check_profile(profile)
    if not {case.strip() for case in cases.split(",")} <= {str(case) for case in GRASP_CASES}:
        raise ValueError(f"--cases 1, 2 or 1,2 expected, {cases!r} given")
    check_numbers(repeats, seed)
    chosen = sorted({int(case) for case in cases.split(",")})
    source = None if table is None else str(table)
    grasps = [
        Grasp(name, case, repeat, profile, seed, server=server, table=source)
        for name, case, repeat in product(names, chosen, range(1, repeats + 1))
    ]
    for grasp in grasps:
        grasp.item  # noqa: B018 (raises for an unknown object before the simulation starts)
    return grasps


def check_numbers(repeats: int, seed: int) -> None:
    """Check the number of repeats and the seed.

    Raises:
        ValueError: one is out of range.
    """
    if repeats < 1 or seed < 0:
        raise ValueError(
            f"repeats of at least 1 and a seed of at least 0 expected; {repeats} and {seed} given"
        )


def path_of(name: str, out: Path) -> Path:
    """Return the path of the recording of that name."""
    from holdfast.files import file_stem

    return out / f"{file_stem(name)}.parquet"


def _is_finished(grasp: "Grasp", out: Path) -> bool:
    """Return whether the recording of the grasp, or of its last failed attempt, exists."""
    last_failed = f"{grasp.name}-failed{GRASP_ATTEMPTS}"
    return any(_exists(grasp, path_of(name, out)) for name in (grasp.name, last_failed))


def _exists(grasp: "Grasp", path: Path) -> bool:
    """Return whether the recording of a grasp exists; see `_is_recorded`."""
    expected = {"profile": grasp.profile, "seed": grasp.seed, "server": grasp.server}
    return is_recorded(path, expected)


def is_recorded(path: Path, expected: "dict[str, object]") -> bool:
    """Return whether a recording exists, and check that it has the expected settings.

    Raises:
        OutputError: the recording has other settings.
    """
    from holdfast.errors import OutputError
    from holdfast.io import load_recording

    if not path.exists():
        return False
    metadata = load_recording(path, labels=False).metadata
    recorded = {name: metadata.get(name) for name in expected}
    if recorded != expected:
        raise OutputError(
            f"{path} has {_list(recorded)}; {_list(expected)} given: choose another folder, "
            "or overwrite it with --force"
        )
    return True


def _list(settings: "dict[str, object]") -> str:
    shown = {name: value for name, value in settings.items() if value is not None}
    return ", ".join(f"{name} {value}" for name, value in shown.items())


def _remove_others(grasp: "Grasp", out: Path, names: "Sequence[str]") -> None:
    """Remove older recordings of the grasp that were not overwritten.

    With another seed, other attempts fail.
    """
    failed = [f"{grasp.name}-failed{attempt + 1}" for attempt in range(GRASP_ATTEMPTS)]
    for name in (grasp.name, *failed):
        if name not in names:
            path_of(name, out).unlink(missing_ok=True)


def _write_film(grasp: "Grasp", path: Path, force: bool) -> None:
    from holdfast.files import whole_file
    from holdfast.twin.render import film

    print_message(f"rendering {grasp.name}: about a minute")
    with whole_file(path, force=force) as part:
        film(grasp, part)
