"""Print how much own handling is enough: real sets by the seconds that a model is calibrated on.

    python benchmarks/calibration_curve.py DATA [MODEL]

The sets and figures are those of `real_sets.py`. Of the recordings of own handling, the first are
used, and the last of them is cut, until they last so long.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from real_sets import box_figures, tug_figures
from real_slips import boxes, tugs

from holdfast.errors import TrainingError
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.training.calibration import calibrate

SECONDS = (6.0, 8.0, 10.0, 12.0, 17.0)
"""Own handling [s]; the calm boxes have 10 to 15, half of the tugs 17."""


def first_seconds(recordings: Sequence[Recording], seconds: float) -> list[Recording]:
    """Return the first recordings, cut to so many seconds in all.

    Raises:
        TrainingError: they are shorter.
    """
    kept, left = [], seconds
    for recording in recordings:
        if left <= 0:
            break
        end = recording.start + left
        modules = {
            name: module.slice(0, sum(module.times <= end))
            for name, module in recording.modules.items()
        }
        kept.append(replace(recording, modules=modules))
        left -= recording.duration
    if left > 0:
        raise TrainingError(f"{seconds - left:.1f} s of handling given, {seconds:g} s expected")
    return kept


def main(folder: Path, name: str) -> None:
    model = Model.load(name)
    sets = {
        "boxes": (box_figures, boxes(folder / "uskin_pick_move")),
        "tugs": (tug_figures, list(tugs(folder / "eflesh_slip"))),
    }
    for title, (figures, recordings) in sets.items():
        columns = {"0 s": figures(lambda _: model, recordings)}
        for seconds in SECONDS:
            try:
                columns[f"{seconds:g} s"] = figures(
                    lambda handling, s=seconds: calibrate(model, first_seconds(handling, s)),
                    recordings,
                )
            except TrainingError as error:
                print(f"{title}, {seconds:g} s: {error}")
        print(f"| {title} | {' | '.join(columns)} |\n|---|{'--:|' * len(columns)}")
        for row in next(iter(columns.values())):
            print(f"| {row} | {' | '.join(f'{column[row]:.2f}' for column in columns.values())} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("model", nargs="?", default="builtin:any")
    options = parser.parse_args()
    main(options.data, options.model)
