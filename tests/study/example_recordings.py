"""Recordings whose truth is known: the synthetic ones, with a course of things made by hand."""

from dataclasses import replace

import numpy as np

from holdfast.contact import Phase
from holdfast.io import save_recording
from holdfast.recordings import Truth
from holdfast.synthetic import synthetic_recording

PHASES = (
    (0.0, Phase.FREE),
    (1.5, Phase.CLOSING),
    (2.3, Phase.LOCKED),
    (5.3, Phase.DISTURBED),
    (6.5, Phase.LOCKED),
    (9.5, Phase.RELEASED),
    (10.0, Phase.FREE),
)
"""As the schedule of the synthetic recordings has it [s]."""
SLIPS = ((5.6, 5.9), (6.0, 6.2))
"""Sliding on the first finger [s]; the second rest is too short for another slip."""
GLITCH = 8.0
"""The set point jumps [s]."""
PUSH = (0.0, 0.0, -1.0)
"""Outside force of the disturbance [N]."""


def truth_of(times, fingers):
    """A truth for the schedule: 2 N on each finger while it is held, pushed down."""
    phase = np.array([str(name) for t in times for name in [phase_at(t)]])
    held = np.isin(phase, (Phase.LOCKED, Phase.DISTURBED))
    outside = np.outer(phase == Phase.DISTURBED, PUSH)
    force = np.outer(held, (2.0, 0.0, 0.0))
    sliding = np.zeros(len(times))
    for start, end in SLIPS:
        sliding[(times >= start - 1e-9) & (times < end - 1e-9)] = 0.01
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
    """Recordings of three objects by turns, one for each seed."""
    return save_all(folder, [synthetic_recording(f"grasp-{s}", s, fingers) for s in seeds])
