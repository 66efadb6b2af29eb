"""Recordings of the twin: which grasps are simulated, and their files.

The same call continues a run that was stopped, as recordings that exist are kept.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path
from typing import Any, TypeVar

from holdfast.errors import OutputError
from holdfast.files import file_stem, whole_file
from holdfast.io import load_recording, save_recording
from holdfast.parallel import Engine
from holdfast.twin import simulation
from holdfast.twin.magnetic_faults import MagneticFaults
from holdfast.twin.objects import load_objects
from holdfast.twin.profile import GRASP_ATTEMPTS
from holdfast.twin.profile import profile as check_profile
from holdfast.twin.simulation import GRASP_CASES, USKIN, Grasp

T = TypeVar("T")
GraspSteps = Callable[[Iterable[T], str, float], Iterable[T]]
"""Function that yields items, and shows what they are and how many there will be."""


def without_steps(items: Iterable[T], what: str, total: float) -> Iterable[T]:
    """Return the items; nothing is shown."""
    return items


def plan_grasps(
    objects: str,
    cases: str,
    repeats: int,
    profile: str,
    seed: int,
    *,
    server: bool = False,
    table: Path | None = None,
    faults: str = "",
    sensor: str = USKIN,
) -> list[Grasp]:
    """Return the grasps of all objects, cases and repeats.

    Raises:
        ValueError: an unknown object, case, profile, fault or sensor, or a number out of range.
    """
    names = [name.strip() for name in objects.split(",")] if objects else list(load_objects(table))
    check_profile(profile)
    if not {case.strip() for case in cases.split(",")} <= {str(case) for case in GRASP_CASES}:
        raise ValueError(f"--cases 1, 2 or 1,2 expected, {cases!r} given")
    check_numbers(repeats, seed)
    chosen = sorted({int(case) for case in cases.split(",")})
    source, troubles = None if table is None else str(table), MagneticFaults.parse(faults)
    grasps = [
        Grasp(
            name, case, repeat, profile, seed,
            server=server, table=source, faults=troubles, sensor=sensor,
        )
        for name, case, repeat in product(names, chosen, range(1, repeats + 1))
    ]  # fmt: skip
    grasps[0].fingertip  # noqa: B018 (raises for an unknown sensor; all have the same)
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


def simulate_grasps(
    grasps: Sequence[Grasp],
    out: Path,
    *,
    engine: Engine,
    force: bool,
    notify: Callable[[str], None],
    steps: GraspSteps[list[str]] = without_steps,
) -> list[str]:
    """Simulate the grasps whose recordings do not exist; return the names of new recordings.

    Args:
        grasps: from `plan_grasps`.
        out: folder for the recordings.
        engine: makes the calls.
        force: overwrite recordings.
        notify: receives how many recordings exist already.
        steps: shows the progress; its items are the names of the recordings of each grasp.

    Raises:
        OutputError: an existing recording has another seed, profile or sensor.
    """
    missing = [grasp for grasp in grasps if force or not _is_finished(grasp, out)]
    return simulate_all(
        simulate_grasp, missing, len(grasps), out,
        engine=engine, force=force, notify=notify, steps=steps,
    )  # fmt: skip


def simulate_all(
    simulate_one: Callable[..., list[str]],
    missing: Sequence[Any],
    n_wanted: int,
    out: Path,
    *,
    engine: Engine,
    force: bool,
    notify: Callable[[str], None],
    steps: GraspSteps[list[str]] = without_steps,
) -> list[str]:
    """Simulate what is missing, in parallel; return the names of the recordings.

    Args:
        simulate_one: called with one of `missing`, the folder and `force`; returns names.
        missing: what is to be simulated.
        n_wanted: how many there are with those that exist.
        out: folder for the recordings.
        engine: makes the calls.
        force: overwrite recordings.
        notify: receives how many exist already.
        steps: shows the progress, as in `simulate_grasps`.
    """
    if len(missing) < n_wanted:
        notify(f"{n_wanted - len(missing)} of {n_wanted} recordings exist already")
    if len(missing) == 1 and engine.scheduler is None:
        engine = engine._replace(n_jobs=1)  # one task needs no other process
    tasks = ((task, engine.path(out), force) for task in missing)

    def checked() -> Iterator[list[str]]:
        for names in engine.map_ordered(simulate_one, tasks):
            # At the first result: a cluster that writes to other disks is found early.
            engine.check_written(path_of(names[-1], out))
            yield names

    finished = steps(checked(), "simulating", len(missing))
    return [name for names in finished for name in names]


def simulate_grasp(grasp: Grasp, out: Path, force: bool) -> list[str]:
    """Simulate a grasp until it succeeds; return the names of the recordings."""
    names = []
    for attempt in range(GRASP_ATTEMPTS):
        trial = replace(grasp, attempt=attempt)
        # A failed attempt is kept, so that a run that was stopped does not simulate it again.
        if not force and _exists(trial, path_of(trial.failed_name, out)):
            continue
        recording = simulation.simulate(trial)
        save_recording(recording, path_of(recording.name, out), force=force)
        names.append(recording.name)
        if recording.metadata["case"] != "failed":
            break
    if force:  # with another seed, other attempts fail: older recordings of this grasp go
        failed = [f"{grasp.name}-failed{attempt + 1}" for attempt in range(GRASP_ATTEMPTS)]
        for name in {grasp.name, *failed} - set(names):
            path_of(name, out).unlink(missing_ok=True)
    return names


def path_of(name: str, out: Path) -> Path:
    """Return the path of the recording of that name."""
    return out / f"{file_stem(name)}.parquet"


def is_recorded(path: Path, expected: dict[str, object]) -> bool:
    """Return whether a recording exists, and check that it has the expected settings.

    Raises:
        OutputError: the recording has other settings.
    """
    if not path.exists():
        return False
    metadata = load_recording(path, labels=False).metadata
    recorded = {name: metadata.get(name) for name in expected}
    if recorded != expected:
        has, wanted = (
            ", ".join(f"{name} {value}" for name, value in settings.items() if value is not None)
            for settings in (recorded, expected)
        )
        raise OutputError(
            f"{path} has {has}; {wanted} given: choose another folder, or overwrite it with --force"
        )
    return True


def _is_finished(grasp: Grasp, out: Path) -> bool:
    """Return whether the recording of the grasp, or of its last failed attempt, exists."""
    last_failed = f"{grasp.name}-failed{GRASP_ATTEMPTS}"
    return any(_exists(grasp, path_of(name, out)) for name in (grasp.name, last_failed))


def _exists(grasp: Grasp, path: Path) -> bool:
    faults = None if grasp.faults.changes_nothing else asdict(grasp.faults)
    expected = {"profile": grasp.profile, "seed": grasp.seed, "server": grasp.server}
    other = None if grasp.sensor == USKIN else grasp.sensor
    return is_recorded(path, expected | {"magnetic_faults": faults, "sensor": other})


def film_all(
    grasps: Sequence[Grasp],
    out: Path,
    fps: float | None,
    *,
    engine: Engine,
    force: bool,
    steps: GraspSteps[None],
) -> None:
    """Write the videos of a webcam that do not exist; `label auto tracking` reads them.

    Args:
        grasps: those whose recordings are in the folder.
        out: the folder.
        fps: pictures per second of the webcam; None for its default.
        engine: makes the calls.
        force: overwrite videos.
        steps: shows the progress.
    """
    paths = [engine.path(path_of(grasp.name, out)) for grasp in grasps]
    missing = [path for path in paths if path.exists() and (force or not _video_of(path).exists())]
    done = engine.map_ordered(film_recording, ((path, fps, force) for path in missing))
    for _ in steps(done, "filming", len(missing)):
        pass


def film_recording(path: Path, fps: float | None, force: bool) -> None:
    """Write the video of a recording beside it."""
    from holdfast.twin.webcam import Webcam, film_stickers

    with whole_file(_video_of(path), force=force) as part:
        film_stickers(load_recording(path), part, Webcam() if fps is None else Webcam(fps=fps))


def _video_of(path: Path) -> Path:
    return path.with_suffix(".mp4")
