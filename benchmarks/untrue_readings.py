"""Faults of readings that cannot be true, in healthy recordings: there must be none.

    python benchmarks/untrue_readings.py --data DATA --minutes 10

The recordings are the real ones in `--data`, by their folders, and quiet skins of the twin in whole
counts: nothing touches them, or a constant load. With little noise, or coarse steps, their samples
repeat.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from frozen_skin import real_recordings

from holdfast.contact import Fault
from holdfast.detector import detect
from holdfast.model import Model
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.twin.uskin import Uskin
from holdfast.twin.uskin_readout import UskinParameters

FAULTS = ("saturated", "out_of_range", "offset", "repeated")
BITS = {name: 1 << tuple(Fault).index(Fault(name)) for name in FAULTS}
RATE = 150.0
SKINS = {
    "as measured": {},
    "noise 0.3": {"noise_counts": 0.3},
    "noise 0.1": {"noise_counts": 0.1},
    "steps of 7": {"step": 7},
    "noise 9, steps of 20": {"noise_counts": 9.0, "step": 20},
    "slow noise, still taxels": {"slow_share": 0.8, "still_share": 0.5},
}
"""Parameters of the skins, where they differ from those of the data sheet."""


def quiet(name: str, minutes: float, load: float) -> Recording:
    """Return a recording of a skin under a constant load of every taxel [N]."""
    tip, generator = sensor("uskin-curved"), np.random.default_rng(len(name))
    times = np.arange(round(60 * minutes * RATE)) / RATE
    parameters = replace(UskinParameters(), **SKINS[name])
    skin = Uskin(parameters, tip, tip.positions, generator)
    forces = np.zeros((len(times), tip.n_taxels, 3))
    forces[times > 1.0, :, 2] = load
    return Recording(name, {"index": Tactile(tip, times, skin.counts(forces, times))})


def main(data: Path | None, minutes: float) -> None:
    """Print one row for each set of recordings."""
    model = Model.load("builtin:noise-floor")
    sets = {} if data is None else real_recordings(data)
    print("| recordings | fingers | samples |", " | ".join(FAULTS), "|")
    print("|---" * (3 + len(FAULTS)) + "|")
    for name, load in ((name, load) for name in (*sets, *SKINS) for load in (0.0, 0.3)):
        if name in sets and load:
            continue
        recordings = sets.get(name) or [quiet(name, minutes, load)]
        traces = [t for each in recordings for t in detect(model, each).fingers.values()]
        faults = np.concatenate([trace.faults for trace in traces])
        numbers = [int(((faults & bit) != 0).sum()) for bit in BITS.values()]
        label = name if name in sets else f"twin, {name}, {load:g} N a taxel"
        print(f"| {label} | {len(traces)} | {len(faults)} |", *(f"{n} |" for n in numbers))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, help="folder with the sets of real recordings")
    parser.add_argument("--minutes", type=float, default=10.0, help="of each skin of the twin")
    given = parser.parse_args()
    main(given.data, given.minutes)
