"""`holdfast simulate`: recordings of the twin, with exact truth."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.terminal.console import print_json, say, show
from holdfast.cli.terminal.progress import Bar
from holdfast.twin.profile import ATTEMPTS

if TYPE_CHECKING:
    from holdfast.twin.simulation import Grasp


def simulate(
    out: Annotated[Path, typer.Argument(help="A folder; it is made if missing.")],
    objects: Annotated[
        str, typer.Option(help="Names, separated by commas; by default all of the table.")
    ] = "",
    table: Annotated[
        Path | None, typer.Option(help="Objects of your own: a .toml file like the twin's.")
    ] = None,
    cases: Annotated[str, typer.Option(help="1: hold; 2: hold and disturb; or 1,2.")] = "1,2",
    repeats: Annotated[int, typer.Option(help="Of every object and case.")] = 5,
    profile: Annotated[str, typer.Option(help="gentle, reference or vigorous.")] = "reference",
    seed: Annotated[int, typer.Option(help="The same seed gives the same bytes.")] = 0,
    server: Annotated[
        bool,
        typer.Option("--server", help="Unsteady stamps and repeated packets, as servers send."),
    ] = False,
    jobs: Annotated[int, typer.Option(help="Grasps at a time; -1: one a processor.")] = -1,
    video: Annotated[
        Path | None,
        typer.Option(help="Render the first grasp to this .gif, .png, .webp or .mp4 file."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Make all anew.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")] = False,
) -> None:
    """Makes recordings of grasps by the physical twin.

    The paper's protocol: an Allegro hand with uSkin fingertips closes on an object, holds it
    (case 1) or holds it while a person disturbs it (case 2), and lets go. Every recording
    carries the truth: forces, sliding, poses, phases. What was finished before is kept, so a
    run that was stopped goes on where it was. A grasp that fails is kept as "...-failed1" and
    tried again, a little calmer.

    Example:
      holdfast simulate twin/
      holdfast simulate few/ --objects can,ball --cases 2 --repeats 1 --profile vigorous
    """
    from holdfast.files import refuse_overwrite

    if video is not None:
        from holdfast.twin.render import check_film

        check_film(video)
        refuse_overwrite(video, force=force)
    wanted = grasps(objects, cases, repeats, profile, seed, server=server, table=table)
    out.mkdir(parents=True, exist_ok=True)
    made = make_all(wanted, out, jobs=jobs, force=force)
    if video is not None:
        _film(wanted[0], video, force)
    failed = [name for name in made if "-failed" in name]
    if as_json:
        print_json({"out": out, "recordings": made, "failed": failed, "profile": profile})
        return
    show(f"{len(made)} recordings in {out}, {len(failed)} of them of grasps that failed")


def make_all(wanted: "Sequence[Grasp]", out: Path, *, jobs: int, force: bool) -> list[str]:
    """Simulates what is not there yet; the names of what was written."""
    from holdfast.parallel import map_ordered

    tasks = [(grasp, out, force) for grasp in wanted if force or not _done(grasp, out)]
    if len(tasks) < len(wanted):
        say(f"{len(wanted) - len(tasks)} of {len(wanted)} recordings are there already")
    made = []
    with Bar("simulating", len(tasks)) as bar:
        for names in map_ordered(make, tasks, 1 if len(tasks) == 1 else jobs):
            made += names
            bar.advance()
    return made


def make(grasp: "Grasp", out: Path, force: bool) -> list[str]:
    """Simulates a grasp, again and calmer as long as it fails; the names of what was written."""
    from dataclasses import replace

    from holdfast.io import save_recording
    from holdfast.twin.simulation import simulate as run

    names = []
    for attempt in range(ATTEMPTS):
        tried = replace(grasp, attempt=attempt)
        if not force and _failed_before(tried, out):
            continue
        recording = run(tried)
        path = out / f"{recording.name}.parquet"
        save_recording(recording, path, force=force)
        names.append(recording.name)
        if recording.metadata["case"] != "failed":
            break
    if force:
        _clear(grasp, out, names)
    return names


def grasps(
    objects: str,
    cases: str,
    repeats: int,
    profile: str,
    seed: int,
    *,
    server: bool = False,
    table: Path | None = None,
) -> "list[Grasp]":
    """The grasps that a user asks for.

    Raises:
        ValueError: an unknown object, case or profile, or a number out of range.
    """
    from holdfast.twin.objects import load_things
    from holdfast.twin.profile import profile as known_profile
    from holdfast.twin.simulation import CASES, Grasp

    names = [name.strip() for name in objects.split(",")] if objects else list(load_things(table))
    known_profile(profile)
    if not {case.strip() for case in cases.split(",")} <= {str(case) for case in CASES}:
        raise ValueError(f"--cases 1, 2 or 1,2 expected, {cases!r} given")
    if repeats < 1 or seed < 0:
        raise ValueError(
            f"repeats of at least 1 and a seed of at least 0 expected; {repeats} and {seed} given"
        )
    chosen = sorted({int(case) for case in cases.split(",")})
    source = None if table is None else str(table)
    wanted = [
        Grasp(name, case, repeat, profile, seed, server=server, table=source)
        for name, case, repeat in product(names, chosen, range(1, repeats + 1))
    ]
    for grasp in wanted:
        grasp.thing  # noqa: B018 (refuses an unknown object before any work is done)
    return wanted


def _done(grasp: "Grasp", out: Path) -> bool:
    """Whether it was finished before, from the same seed and profile.

    Raises:
        OutputError: what is there was made otherwise.
    """
    path = out / f"{grasp.name}.parquet"
    last_failed = out / f"{grasp.name}-failed{ATTEMPTS}.parquet"
    for existing in (path, last_failed):
        if existing.exists():
            _check_origin(grasp, existing)
            return True
    return False


def _clear(grasp: "Grasp", out: Path, names: "Sequence[str]") -> None:
    """Removes what is left of the grasp from before: another seed fails at other times."""
    failed = [f"{grasp.name}-failed{attempt + 1}" for attempt in range(ATTEMPTS)]
    for name in (grasp.name, *failed):
        if name not in names:
            (out / f"{name}.parquet").unlink(missing_ok=True)


def _failed_before(grasp: "Grasp", out: Path) -> bool:
    path = out / f"{grasp.failed_name}.parquet"
    if path.exists():
        _check_origin(grasp, path)
    return path.exists()


def _check_origin(grasp: "Grasp", path: Path) -> None:
    from holdfast.errors import OutputError
    from holdfast.io import load_recording

    metadata = load_recording(path, labels=False).metadata
    made = {name: metadata.get(name) for name in ("profile", "seed", "server")}
    wanted = {"profile": grasp.profile, "seed": grasp.seed, "server": grasp.server}
    if made != wanted:
        raise OutputError(
            f"{path} was made with {_listed(made)}; {_listed(wanted)} asked for: choose another "
            "folder, or give --force"
        )


def _listed(origin: "dict[str, object]") -> str:
    return ", ".join(f"{name} {value}" for name, value in origin.items())


def _film(grasp: "Grasp", video: Path, force: bool) -> None:
    from holdfast.files import whole_file
    from holdfast.twin.film import film

    say(f"rendering {grasp.name}: about a minute")
    with whole_file(video, force=force) as part:
        film(grasp, part)
