"""Print how often the grip law takes noise for a shock, in quiet holds of sensors and the twin.

    python benchmarks/shocks.py DATA [--n 12] [--seed 905]

The real holds are those of `real_sets.py`: boxes that are carried and do not slip, the first half
second of tugs, a gripper whose servos stand still. The twin holds an object without jerks, with its
own sensor and with one that reads steps of 0.1 N. The last column has the opposite error: impacts
on the object in such holds in which no shock was found within 0.1 s.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from real_sets import QUIET_FROM, TUG_START

from holdfast.contact import STABLE
from holdfast.detection import Detector, Model, detect
from holdfast.io.importers import import_recordings
from holdfast.recordings import Recording, label_states
from holdfast.twin.hand import FINGERS, RATE
from holdfast.twin.simulation import Simulation
from holdfast_grip.laws.base import Touch
from holdfast_grip.laws.shocks import Shocks
from holdfast_lab.trial.trials import draw_trial

FROM, UNTIL = 1.0, 5.0
"""Quiet time of a hold of the twin, after the lock [s]; three impacts follow in 3 s more."""
AFTER_IMPACT = 0.6
"""Time after an impact that is not quiet [s]."""
FOUND_WITHIN = 0.1
"""Time after an impact within which a shock finds it [s]."""


class Forces(NamedTuple):
    """Forces of a hold: times (n,), normal and tangential (n, n_fingers), quiet (n,), impacts."""

    times: np.ndarray
    normal: np.ndarray
    tangential: np.ndarray
    quiet: np.ndarray
    impacts: Sequence[float] = ()


def forces_of(recording: Recording, model: Model, start: float, end: float) -> Forces:
    """Return the forces of a recording between two shares of its time, quiet where not labelled."""
    parts = []
    for name, trace in detect(model, recording).fingers.items():
        module = recording.modules[name]
        along = trace.force @ module.sensor.normal
        across = np.sqrt(np.maximum((trace.force**2).sum(axis=1) - along**2, 0.0))
        labels = label_states(module.labels, trace.times)
        quiet = labels == STABLE if module.labels else np.ones(len(trace), bool)
        parts.append((np.maximum(along, 0.0), across, quiet & ~np.isnan(along)))
    normal, tangential, quiet = (np.stack(part, axis=1) for part in zip(*parts, strict=True))
    rows = slice(*(round(share * len(normal)) for share in (start, end)))
    times = trace.times[rows]
    return Forces(times, normal[rows], tangential[rows], quiet.all(axis=1)[rows])


def twin_forces(number: int, seed: int, sensor: str | None, n_impacts: int, model: Model) -> Forces:
    """Return the forces of a hold of the twin with the first grip."""
    trial = draw_trial(number, seed, n_impacts=n_impacts)
    grasp = replace(trial.grasp, glitch_rate=0.0, sensor=sensor or trial.grasp.sensor)
    load = trial.load._replace(start=UNTIL + n_impacts)
    trial = replace(trial, grasp=grasp, load=load)
    simulation = Simulation(grasp, plan=trial.plan(), loads=[load])
    sensors = {finger: skin.sensor for finger, skin in simulation.skins.items()}
    detector = Detector(model, sensors)
    touches = {name: Touch(name, tuple(sensors[name].normal.tolist())) for name in FINGERS}
    rows, impacts = [], [impact.start for impact in trial.impacts()]
    while simulation.held_for < load.start and simulation.protocol.lost_at is None:
        simulation.step(np.ones(len(FINGERS)))
        time = simulation.n_samples / RATE
        for name, finger in detector.update(simulation.read(), time).fingers.items():
            touches[name].read(finger)
        if (now := simulation.held_for) > FROM / 2:
            struck = any(0 <= now - start < AFTER_IMPACT for start in impacts)
            forces = [(touch.normal, touch.tangential) for touch in touches.values()]
            rows.append((now, *np.ravel(forces), now > FROM and not struck))
    table = np.array(rows).reshape(-1, 2 + 2 * len(FINGERS))
    return Forces(table[:, 0], table[:, 1:-1:2], table[:, 2:-1:2], table[:, -1] > 0, impacts)


def shocks_in(forces: Forces) -> np.ndarray:
    """Return where the law finds a shock, (n,)."""
    change = sum(
        np.abs(np.diff(part, 2, axis=0, prepend=part[[0, 0]])).sum(axis=1)
        for part in (forces.normal, forces.tangential)
    )
    press = forces.normal[forces.quiet].sum(axis=1).mean() if forces.quiet.any() else 0.0
    shocks, steps = Shocks(knows_slips=True), np.diff(forces.times, prepend=forces.times[0])
    rows = zip(change.tolist(), forces.times.tolist(), steps.tolist(), strict=True)
    return np.array([shocks.update(row, press, time, dt, time) for row, time, dt in rows])


def print_row(name: str, holds: Iterator[Forces]) -> None:
    """Print the row of a set."""
    n = n_impacts = n_found = 0
    minutes = 0.0
    for forces in holds:
        if not len(forces.times):
            continue  # the first grip failed
        found = shocks_in(forces)
        n += int((found & forces.quiet).sum())
        minutes += float(np.median(np.diff(forces.times))) * forces.quiet.sum() / 60
        for start in forces.impacts:
            rows = slice(*np.searchsorted(forces.times, (start - 1 / RATE, start + FOUND_WITHIN)))
            n_impacts, n_found = n_impacts + 1, n_found + bool(found[rows].any())
    missed = f"{n_impacts - n_found} of {n_impacts}" if n_impacts else ""
    print(f"| {name} | {minutes:.2f} | {n} | {n / minutes:.1f} | {missed} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("--n", type=int, default=12, help="holds of the twin of each kind")
    parser.add_argument("--seed", type=int, default=905)
    given = parser.parse_args()
    model = Model.load("builtin:any")
    print("| quiet holds | minutes | shocks | a minute | impacts missed |\n|---|--:|--:|--:|--:|")
    for name, folder, of, start in (
        ("GTac gripper", "gtac_v2", None, QUIET_FROM),
        ("boxes", "uskin_pick_move", None, 0.0),
        ("tugs, eFlesh", "eflesh_slip", "eflesh", 0.0),
    ):
        recordings = import_recordings(given.data / folder, of)
        holds = (item if isinstance(item, Recording) else item[0] for item in recordings)
        # Nobody tugs in the first half second of the 3 s of a sequence.
        end = TUG_START / 3 if of else 1.0
        print_row(name, (forces_of(item, model, start, end) for item in holds))
    for sensor in (None, "orca-finger"):
        for n_impacts in (0, 3):
            holds = (twin_forces(k, given.seed, sensor, n_impacts, model) for k in range(given.n))
            title = f"twin, {sensor or 'uSkin'}{', impacts' if n_impacts else ''}"
            print_row(title, holds)
