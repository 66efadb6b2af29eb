"""Data of a study: recordings that the twin makes, and real ones where there are any."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from holdfast.cli.console import say
from holdfast.cli.simulate import grasps, make_all

if TYPE_CHECKING:
    from holdfast.study.corpus import Corpus

REAL = "uskin_pick_move"
"""Folder of the real recordings, within `HOLDFAST_DATA`."""
SOURCE = "https://github.com/imanlab/proactive-slip-control"
REAL_TARE = "first"
"""They begin in contact."""


class Kind(NamedTuple):
    """How the recordings of a corpus are made.

    Attributes:
        profile: of the twin.
        later: added to the seed.
        others: other objects than the twin's own.
    """

    profile: str = "reference"
    later: int = 0
    others: bool = False


FULL = {
    "main": Kind(),
    "fresh": Kind(later=1),
    "others": Kind(others=True),
    "gentle": Kind("gentle"),
    "vigorous": Kind("vigorous"),
}
QUICK = {name: FULL[name] for name in ("main", "others")}
REPEATS = 5
"""Of every object and case, as in the paper's protocol."""
FEW = {"main": 2, "others": 1}
"""The same in a quick study."""


def twin_corpora(out: Path, seed: int, *, quick: bool, jobs: int, tare: str) -> "dict[str, Corpus]":
    """Makes what is not there yet in `out`, a folder for each corpus.

    Raises:
        OutputError: what is there was made from another seed.
    """
    from holdfast.study.corpus import corpus_of

    corpora = {}
    kinds = QUICK if quick else FULL
    for number, (name, kind) in enumerate(kinds.items(), 1):
        say(f"recordings of the twin, {number} of {len(kinds)}: {name}")
        repeats = FEW[name] if quick else REPEATS
        _simulate(out / name, kind, seed, repeats, jobs)
        corpora[name] = corpus_of(name, out / name, tare)
    return corpora


def _simulate(folder: Path, kind: Kind, seed: int, repeats: int, jobs: int) -> None:
    from holdfast.errors import OutputError
    from holdfast.twin.objects import OTHER_OBJECTS

    table = OTHER_OBJECTS if kind.others else None
    wanted = grasps("", "1,2", repeats, kind.profile, seed + kind.later, table=table)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        make_all(wanted, folder, jobs=jobs, force=False)
    except OutputError as cause:
        made, _, advice = str(cause).rpartition(": ")
        if "--force" not in advice:
            raise
        raise OutputError(f"{made}: choose another OUT, or delete its data") from cause


def real_corpus(out: Path) -> "tuple[Corpus | None, list[str]]":
    """The real recordings, imported into `out`; and in a sentence why they are left out."""
    from holdfast.errors import HoldfastError
    from holdfast.study.corpus import corpus_of

    source = Path(os.environ.get("HOLDFAST_DATA", "../shared/data"), REAL)
    if not source.is_dir():
        return None, [
            f"real recordings, for none are here. Get them from {SOURCE.removeprefix('https://')} "
            f"into a folder {REAL}, and let HOLDFAST_DATA name the folder that holds it."
        ]
    try:
        _import(source, out)
        return corpus_of("real", out, REAL_TARE), []
    except (HoldfastError, ValueError) as cause:
        say(f"the real recordings are left out: {cause}")
        return None, [f"real recordings, for those of HOLDFAST_DATA cannot be used ({cause})."]


def _import(source: Path, out: Path) -> None:
    from holdfast.io import import_recordings, save_recording

    out.mkdir(parents=True, exist_ok=True)
    for recording in import_recordings(source):
        path = out / f"{recording.name}.parquet"
        if not path.exists():
            save_recording(recording, path)
