"""Recordings of a study: those that the twin simulates, the real ones, and the plan of both."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from holdfast import simulated_grasps
from holdfast.errors import HoldfastError, OutputError
from holdfast.files import file_stem
from holdfast.io import import_recordings, save_recording
from holdfast.parallel import Engine
from holdfast.simulated_grasps import GraspSteps
from holdfast.twin.objects import OTHER_OBJECTS
from holdfast_lab.study.plan import Corpus, StudyPlan, scan_corpus

Notify = Callable[[str], None]

REAL_DATA = "uskin_pick_move"
"""Folder of the real recordings, within `HOLDFAST_DATA`."""
REAL_DATA_URL = "https://github.com/imanlab/proactive-slip-control"
REAL_TARE = "first"
"""The real recordings begin in contact."""


class TwinCorpus(NamedTuple):
    """Settings of a corpus that the twin simulates.

    Attributes:
        profile: profile of the twin.
        seed_offset: number that is added to the seed.
        other_objects: use another set of objects.
        glitch_rate: glitches of the hand's controller per second [1/s]; None for the profile's.
        repeats: grasps of each object and case; None for `N_REPEATS`.
        cases: 1 (held), 2 (held and disturbed), or both.
        faults: troubles of the skins, as in `--faults`.
    """

    profile: str = "reference"
    seed_offset: int = 0
    other_objects: bool = False
    glitch_rate: float | None = None
    repeats: int | None = None
    cases: str = "1,2"
    faults: str = ""


TWIN_CORPORA = {
    "main": TwinCorpus(),
    "fresh": TwinCorpus(seed_offset=1),
    "others": TwinCorpus(other_objects=True),
}
"""Corpora of the paper's tables and of the comparison of methods."""
FULL_CORPORA = TWIN_CORPORA | {
    "gentle": TwinCorpus("gentle", repeats=3),
    "vigorous": TwinCorpus("vigorous", repeats=3),
    **{
        f"glitch-{n}": TwinCorpus(seed_offset=2, other_objects=True, glitch_rate=n / 60, repeats=2)
        for n in (0, 1)
    },
    "aged": TwinCorpus(other_objects=True, seed_offset=3, cases="2", repeats=3,
                       faults="invented-months=4"),
    "impacts": TwinCorpus("coupled", other_objects=True, seed_offset=3, cases="2", repeats=3),
    "slips": TwinCorpus("slips", other_objects=True, seed_offset=3, cases="2", repeats=3),
    "taught": TwinCorpus("slips", seed_offset=4, cases="2", repeats=1),
    "taught-pushes": TwinCorpus(seed_offset=4, cases="2", repeats=1),
}  # fmt: skip
"""Those of a full study. The seeds were fixed before the first run."""
QUICK_CORPORA = {
    "main": TwinCorpus(repeats=2), "others": TwinCorpus(other_objects=True, repeats=1)
}  # fmt: skip
N_REPEATS = 5
"""Grasps of each object and case, as in the protocol of the paper."""


def plan_study(
    data: Path | None,
    out: Path,
    seed: int,
    tare: str,
    jobs: int,
    *,
    quick: bool,
    full: bool = False,
    notify: Notify,
    steps: GraspSteps[list[str]],
) -> tuple[StudyPlan, list[str]]:
    """Return the plan and what is left out; simulate the recordings if there is no `data`.

    Own recordings that the twin did not simulate are the real recordings of the study.
    """
    if data is None:
        folder = out / "data" / "quick" if quick else out / "data"
        settings = QUICK_CORPORA if quick else FULL_CORPORA if full else TWIN_CORPORA
        corpora = twin_corpora(
            folder, seed, settings, jobs=jobs, tare=tare, notify=notify, steps=steps
        )
    else:
        corpora = {"main": scan_corpus("main", data, tare)}
        if not corpora["main"].is_simulated:
            return StudyPlan(corpora, corpora["main"], quick, seed, full), []
    real, left_out = real_corpus(out / "data" / "real", notify)
    return StudyPlan(corpora, real, quick, seed, full), left_out


def twin_corpora(
    out: Path,
    seed: int,
    settings: Mapping[str, TwinCorpus],
    *,
    jobs: int,
    tare: str,
    notify: Notify,
    steps: GraspSteps[list[str]],
) -> dict[str, Corpus]:
    """Simulate the missing recordings in `out`, in one folder for each corpus.

    Args:
        out: folder of the corpora.
        seed: of the grasps.
        settings: of each corpus, by name.
        jobs: number of processes.
        tare: how the baseline is found.
        notify: called with each message.
        steps: shows the progress.

    Raises:
        OutputError: existing recordings have another seed.
    """
    corpora = {}
    for number, (name, corpus) in enumerate(settings.items(), 1):
        notify(f"recordings of the twin, {number} of {len(settings)}: {name}")
        simulate_corpus(out / name, corpus, seed, corpus.repeats or N_REPEATS, jobs, notify, steps)
        corpora[name] = scan_corpus(name, out / name, tare)
    return corpora


def simulate_corpus(
    folder: Path,
    corpus: TwinCorpus,
    seed: int,
    repeats: int,
    jobs: int,
    notify: Notify,
    steps: GraspSteps[list[str]],
) -> None:
    """Simulate the missing recordings of a corpus.

    Raises:
        OutputError: existing recordings have another seed.
    """
    table = OTHER_OBJECTS if corpus.other_objects else None
    seed += corpus.seed_offset
    grasps = [
        replace(grasp, glitch_rate=corpus.glitch_rate)
        for grasp in simulated_grasps.plan_grasps(
            "", corpus.cases, repeats, corpus.profile, seed, table=table, faults=corpus.faults
        )
    ]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        simulated_grasps.simulate_grasps(
            grasps, folder,
            engine=Engine(jobs), force=False, notify=notify, steps=steps,
        )  # fmt: skip
    except OutputError as cause:
        problem, _, advice = str(cause).rpartition(": ")
        if "--force" not in advice:
            raise
        raise OutputError(f"{problem}: choose another OUT, or delete its data") from cause


def real_corpus(out: Path, notify: Notify) -> tuple[Corpus | None, list[str]]:
    """Import the real recordings into `out`; otherwise return why they are left out."""
    source = Path(os.environ.get("HOLDFAST_DATA", "../shared/data"), REAL_DATA)
    if not source.is_dir():
        return None, [
            "real recordings, because none were found. Download them from "
            f"{REAL_DATA_URL.removeprefix('https://')} into a folder {REAL_DATA}, and set "
            "HOLDFAST_DATA to the folder that contains it."
        ]
    try:
        out.mkdir(parents=True, exist_ok=True)
        for recording in import_recordings(source):
            path = out / f"{file_stem(recording.name)}.parquet"
            if not path.exists():
                save_recording(recording, path)
        return scan_corpus("real", out, REAL_TARE), []
    except (HoldfastError, ValueError) as cause:
        notify(f"the real recordings are left out: {cause}")
        return None, [f"real recordings, because those in HOLDFAST_DATA cannot be used ({cause})."]
