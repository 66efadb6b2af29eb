"""Synthetic recordings for the tests of the study, with ground truth, and folders of them."""

from dataclasses import replace

import msgspec
import numpy as np

from holdfast.contact import Phase
from holdfast.io import save_recording
from holdfast.recordings import Truth
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.plan import scan_corpus

PHASES = (
    (0.0, Phase.FREE),
    (1.5, Phase.CLOSING),
    (2.3, Phase.LOCKED),
    (5.3, Phase.DISTURBED),
    (6.5, Phase.LOCKED),
    (9.5, Phase.RELEASED),
    (10.0, Phase.FREE),
)
"""Phases of the synthetic recordings, with their start [s]."""
SLIPS = ((5.6, 5.9), (6.0, 6.2))
"""Slip on the first finger [s]; the pause before the second is too short for another slip."""
TIMES = np.arange(1725) / 150
"""Times of their samples [s]."""
GLITCH = 8.0
"""Jump of the set point [s]."""
PUSH = (0.0, 0.0, -1.0)
"""Outside force of the disturbance [N]."""


def truth_of(times, fingers):
    """Ground truth of the schedule: 2 N on each finger during the hold, and a push downwards."""
    phase = np.array([str(name) for t in times for name in [phase_at(t)]])
    held = np.isin(phase, (Phase.LOCKED, Phase.DISTURBED))
    outside = np.outer(phase == Phase.DISTURBED, PUSH)
    force = np.outer(held, (2.0, 0.0, 0.0))
    sliding = 0.01 * inside(SLIPS, times)
    jump = np.where(np.abs(times - GLITCH) < 2e-3, 0.1, 0.0)
    hand = {"phase": phase, "outside_force": outside, "set_point_error": jump}
    speeds = [sliding, *[np.zeros(len(times))] * (len(fingers) - 1)]
    return Truth(
        times,
        hand,
        {
            name: {"contact_force": force, "slip_speed": speed}
            for name, speed in zip(fingers, speeds, strict=True)
        },
    )


def inside(spans, times=TIMES):
    """Return which times are in one of the spans, (start, end) [s]."""
    found = np.zeros(len(times), dtype=bool)
    for start, end in spans:
        found |= (times >= start - 1e-9) & (times < end - 1e-9)
    return found


def phase_at(time):
    return [phase for start, phase in PHASES if start <= time + 1e-9][-1]


def recording_with_truth(name, seed, fingers=("thumb", "index")):
    recording = synthetic_recording(name, seed, fingers)
    times = recording.modules[fingers[0]].times
    return replace(recording, truth=truth_of(times, fingers))


def save_all(folder, recordings):
    folder.mkdir(exist_ok=True)
    for recording in recordings:
        save_recording(recording, folder / f"{recording.name}.parquet")
    return folder


def save_synthetic(folder, seeds, fingers=("thumb", "index")):
    """Save one recording for each seed, of three objects in turn."""
    return save_all(folder, [synthetic_recording(f"grasp-{s}", s, fingers) for s in seeds])


def corpora_of(folder, seeds, make=synthetic_recording):
    """Save and scan a corpus for each role, of a recording for each of its seeds."""
    return {
        role: scan_corpus(
            role,
            save_all(folder / role, [make(f"grasp-{s}", s, ("thumb", "index")) for s in each]),
        )
        for role, each in seeds.items()
    }


def results_of(tasks):
    """Return the result of each task by name, each call once, through msgpack as it is stored."""
    done, results = {}, {}
    for task in tasks:
        key = (task.function.__qualname__, msgspec.msgpack.encode(task.arguments))
        if key not in done:
            done[key] = msgspec.msgpack.encode(task.function(*task.arguments))
        results[task.name] = msgspec.msgpack.decode(done[key], type=task.result)
    return results


def rows_of(table, **keys):
    """Return the rows of a table that have these keys."""
    return [row for row in table.rows if keys.items() <= row.keys.items()]


def recordings_of_cases(cases, start=0):
    """A synthetic recording of each case, by its metadata; names begin with the case."""
    for seed, case in enumerate(cases, start):
        made = synthetic_recording(f"{case}-{seed}", seed, ("index", "thumb"))
        yield replace(made, metadata={**made.metadata, "case": case})
