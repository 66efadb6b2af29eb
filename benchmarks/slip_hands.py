"""Simulate the randomized hands from which the slip head of `builtin:any` is trained.

    python benchmarks/slip_hands.py FOLDER --hands 420

Every recording is another hand and begins with an open hand; `train_slips.py` cuts a second copy
that begins in contact. The seed comes from the id of a commit that is older than this file.
"""

import argparse
from pathlib import Path

from holdfast.files import file_stem
from holdfast.io import save_recording
from holdfast_lab.randomized.simulation import RandomHold, simulate_random

COMMIT = "0a4578fa0cf2e94e8ea60017a22c415f2ca32ac8"
"""The commit from which the work on this head began; seeds are digits of its id."""
MEASURED = ("scan", "filter", "noise", "vibration")
"""Mechanisms of real skins and arms with which the hands are read."""


def seed_of(commit: str, part: int = 0) -> int:
    """Return a seed: six of each eight digits of the id of a commit.

    Example:
        >>> seed_of("0a4578fa0cf2e94e8ea60017a22c415f2ca32ac8", 1)
        16387314
    """
    return int(commit[8 * part : 8 * part + 6], 16)


def simulate_hands(folder: Path, first: int, last: int) -> None:
    """Simulate the hands of some numbers whose recordings do not exist."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(first, last):
        hold = RandomHold(number, seed_of(COMMIT, 1), measured=MEASURED, whole=True)
        path = folder / f"{file_stem(hold.name)}.parquet"
        if not path.exists():
            save_recording(simulate_random(hold), path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--hands", type=int, default=420)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    simulate_hands(options.folder, options.first, options.hands)
