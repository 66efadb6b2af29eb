"""Write a recording for the page: quiet holds, a tug that is held, and a tug that slips.

    python benchmarks/tug_replay.py DATA/eflesh_slip tugs.mcap
    holdfast serve builtin:any tugs.mcap

The first 33 s are the first half second of 67 sequences, in which nobody tugs, one after another:
handling for the button Calibrate. Then come, after pauses of 1 s, two whole sequences: those whose
score, by the model that is calibrated so, is the median of their label. Every part is shifted so
that its first tenth of a second has the mean of that of the first sequence, because the offsets
of the sequences differ.
"""

import argparse
from pathlib import Path

import numpy as np

from holdfast.io import save_recording
from holdfast.io.importers import import_recordings
from holdfast.recordings import STARTS_LOADED, Recording, Tactile

HELD, SLIPPED = "seq_92", "seq_22"
RATE = 100.0
N_QUIET = 50
"""Number of samples in which nobody tugs."""
N_START = 10
"""Number of samples whose mean is the same in all parts."""
PAUSE = 1.0
"""Pause before a tug, and after the last [s]."""
N_AFTER = 10
"""Number of quiet parts after the last tug."""


def montage(folder: Path) -> Recording:
    sequences = {recording.name: recording for recording in import_recordings(folder)}
    quiet = [name for name in sequences if name not in (HELD, SLIPPED)]
    parts = [(name, N_QUIET, 0.0) for name in quiet]
    parts += [(HELD, None, PAUSE), (SLIPPED, None, PAUSE), (quiet[0], N_QUIET, PAUSE)]
    parts += [(name, N_QUIET, 0.0) for name in quiet[1:N_AFTER]]
    first = next(iter(sequences.values())).modules
    times, readings, end = [], {name: [] for name in first}, 0.0
    for name, n, pause in parts:
        modules = sequences[name].modules
        for finger, module in modules.items():
            values = module.readings[:n]
            level = first[finger].readings[:N_START].mean(axis=0)
            readings[finger].append(values - values[:N_START].mean(axis=0) + level)
        n_samples = len(values)
        times.append(end + pause + np.arange(n_samples) / RATE)
        end += pause + n_samples / RATE
    clock = np.concatenate(times)
    return Recording(
        "tugs",
        {
            finger: Tactile(module.sensor, clock, np.concatenate(readings[finger]))
            for finger, module in first.items()
        },
        {STARTS_LOADED: True, "source": "eFlesh, parts one after another"},
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    save_recording(montage(arguments.folder), arguments.out)
