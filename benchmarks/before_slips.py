"""Print how often a finger is UNSTABLE before it slips, and how often in quiet hold.

    holdfast simulate fresh/ --cases 2 --repeats 3 --seed 531
    python benchmarks/before_slips.py fresh/ builtin:any builtin:twin

Slips of fingers by the truth; quiet hold is still and undisturbed by the truth.
"""

import argparse
from pathlib import Path

import numpy as np

from holdfast.contact import STABLE, UNSTABLE
from holdfast.detector import detect
from holdfast.io import load_dataset
from holdfast.metrics.slip_truth import slip_truth
from holdfast.model import Model
from holdfast.recordings import Recording

LATE = 0.1
"""Time after the onset in which UNSTABLE still counts, for the second figure [s]."""


def row(model: Model, recordings: list[Recording]) -> list[str]:
    at_onset, soon, before_1mm = [], [], []
    n_starts = n_stable = n_quiet = 0
    seconds = 0.0
    for recording in recordings:
        for finger, trace in detect(model, recording).fingers.items():
            truth = slip_truth(recording, finger, trace.times)
            if truth is None:
                continue
            unstable, quiet = trace.state == UNSTABLE, truth.quiet
            for slip in truth.slips:
                first, last = np.searchsorted(trace.times, (slip.onset, slip.onset + LATE))
                if first == len(unstable):
                    continue
                at_onset.append(unstable[first])
                soon.append(unstable[first : last + 1].any())
                if np.isfinite(slip.reached[0]):
                    end = max(np.searchsorted(trace.times, slip.reached[0]), first + 1)
                    before_1mm.append(unstable[first:end].any())
            starts = unstable[1:] & (trace.state[:-1] == STABLE)
            n_starts += int((starts & quiet[1:] & quiet[:-1]).sum())
            n_stable += int((trace.state[quiet] == STABLE).sum())
            n_quiet += int(quiet.sum())
            seconds += quiet.sum() / recording.rate
    shares = (100 * np.mean(x) if x else np.nan for x in (at_onset, soon, before_1mm))
    return [
        f"{len(at_onset)}, {len(before_1mm)}",
        *(f"{share:.0f}" for share in shares),
        f"{60 * n_starts / seconds:.1f}",
        f"{n_stable / n_quiet:.2f}",
    ]


def main(folder: Path, names: list[str]) -> None:
    recordings = list(load_dataset(folder))
    print("| UNSTABLE | slips, over 1 mm | at the onset, % | within 0.1 s, % | before 1 mm, % |"
          " false starts a minute of quiet hold | quiet hold STABLE |")  # fmt: skip
    print("|---|" + "--:|" * 6)
    for name in names:
        print(f"| {name} | {' | '.join(row(Model.load(name), recordings))} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("models", nargs="+")
    options = parser.parse_args()
    main(options.folder, options.models)
