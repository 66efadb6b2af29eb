"""Arrows of the taxels of a recording: where they are, where they point, how long they are."""

from typing import NamedTuple

import numpy as np

from holdfast.detection.plan import Tare, baseline_of, declared_baselines, offline_tare
from holdfast.errors import RecordingError
from holdfast.recordings import GAP_PERIODS, Recording
from holdfast.sensors.types import Array, Integers

SCENE_RATE = 30.0
"""Arrows and moving frames per second [Hz]."""
MAX_SCENE_SECONDS = 86_400.0
"""Longest recording that is exported [s]."""
BASELINE_SECONDS = 0.5
"""Time at the start whose mean is subtracted, unless the metadata have the baseline [s]."""
LONGEST_ARROW = 0.02
"""Length of the arrow of a strong reading [m]."""
STRONG_SHARE = 0.999
"""Quantile of the largest readings of all samples that has the longest arrow."""
SHORTEST_ARROW = 0.0004
"""Arrows that are shorter are left out [m]."""


def scene_instants(recording: Recording) -> Array:
    """Return the instants of arrows and moving frames, (n,) [s].

    Raises:
        RecordingError: the recording is longer than a day.
    """
    if recording.duration > MAX_SCENE_SECONDS:
        raise RecordingError(
            f"{recording.name}: {recording.duration:.3g} s given, at most {MAX_SCENE_SECONDS:g} s "
            "expected; cut it"
        )
    # From the start, so that the arrows of all modules are of the same instants. At a rate for
    # eyes: arrows at every sample would make files of gigabytes.
    n_instants = int(recording.duration * SCENE_RATE) + 1
    return np.asarray(recording.start + np.arange(n_instants) / SCENE_RATE)


class ModuleArrows(NamedTuple):
    """Arrows of one module.

    Attributes:
        forces: (n, n_taxels, 3) readings without the baseline, in the fingertip frame [unit].
        times: (n,) [s].
        period: of the samples [s].
    """

    forces: Array
    times: Array
    period: float

    def sample_at(self, time: float, tolerance: float) -> int | None:
        """Return the index of the latest sample, unless it is a gap ago."""
        k = int(np.searchsorted(self.times, time, side="right")) - 1
        is_old = k < 0 or time - self.times[k] > GAP_PERIODS * self.period + tolerance
        return None if is_old else k


def module_forces(recording: Recording, instants: Array) -> dict[str, ModuleArrows]:
    """Return the forces of all taxels at the latest samples of some instants, by module.

    Args:
        recording: the recording.
        instants: (n,) increasing times [s].
    """
    arrows = {}
    for name, module in recording.modules.items():
        if not module.n_samples:
            continue
        # Only the samples that are drawn are turned into the fingertip frame.
        rows = np.unique(np.searchsorted(module.times, instants, side="right") - 1)
        kept: Integers = rows[rows >= 0]
        forces = np.einsum("tij,ntj->nti", module.sensor.rotations, zeroed(recording, name, kept))
        finite = np.nan_to_num(forces, nan=0.0, posinf=0.0, neginf=0.0)
        arrows[name] = ModuleArrows(finite, module.times[kept], module.period)
    return arrows


def zeroed(recording: Recording, name: str, rows: Integers | slice = slice(None)) -> Array:
    """Return readings of a module without their baseline, (n, n_taxels, 3) in taxel frames.

    Args:
        recording: the recording.
        name: of the module.
        rows: samples.
    """
    module = recording.modules[name]
    readings = module.readings[rows].astype(np.float64)
    declared = declared_baselines(recording.metadata, {name: module.sensor})
    if name in declared:
        return np.asarray(readings - declared[name])
    # Newtons of a loaded start are forces already; a tare would take the load out of them.
    is_known = module.unit == "N" and recording.starts_loaded
    how = Tare("none") if is_known else offline_tare(BASELINE_SECONDS, module)
    try:
        return np.asarray(
            readings - baseline_of(module.readings, module.times, how, module.period)[0]
        )
    except ValueError:  # the module has no finite readings
        return readings


def arrow_scale(arrows: dict[str, ModuleArrows]) -> float:
    """Return the length of an arrow for a reading of 1, the same for all modules [m/unit]."""
    largest = [np.linalg.norm(x.forces, axis=2).max(axis=1) for x in arrows.values()]
    joined = np.concatenate(largest) if largest else np.empty(0)
    # A quantile: a single wrong reading would make all other arrows invisible.
    strong = float(np.quantile(joined, STRONG_SHARE)) if len(joined) else 0.0
    return LONGEST_ARROW / strong if strong > 0 else 0.0
