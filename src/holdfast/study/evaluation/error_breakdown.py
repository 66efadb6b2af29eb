"""Where the errors of a recording are: in which phase, at which force, in which direction."""

from collections.abc import Mapping

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import HELD_PHASES, STABLE, UNKNOWN, Phase
from holdfast.metrics import Decisions, FingerDecisions, calibration_sums
from holdfast.metrics.events import ROUNDING
from holdfast.metrics.masks import runs
from holdfast.recordings import Truth
from holdfast.sensors.types import Array
from holdfast.study.evaluation.recording_features import RecordingFeatures
from holdfast.study.methods import HAND

Mask = npt.NDArray[np.bool_]

AXES = {
    "down": (0.0, 0.0, -1.0),
    "up": (0.0, 0.0, 1.0),
    "left": (0.0, -1.0, 0.0),
    "right": (0.0, 1.0, 0.0),
    "away": (-1.0, 0.0, 0.0),
    "towards": (1.0, 0.0, 0.0),
}
"""Directions of a push in the world; further than 30 degrees from all of them is oblique."""
NEAR = np.cos(np.radians(30.0))


class GripErrors(msgspec.Struct, frozen=True):
    """Errors of a finger in a recording while the object is held.

    Attributes:
        force: mean size of its true contact force, locked [N].
        counts: samples labelled stable, of them wrong; labelled otherwise, of them wrong.
    """

    force: float
    counts: tuple[int, int, int, int]


class DisturbanceErrors(msgspec.Struct, frozen=True):
    """One disturbance.

    Attributes:
        direction: one of `AXES`, or "oblique".
        n: samples of all fingers labelled not stable.
        wrong: of them called stable.
    """

    direction: str
    n: int
    wrong: int


class ErrorBreakdown(msgspec.Struct, frozen=True):
    """Where the errors of one recording are.

    Attributes:
        phases: by phase, samples of all fingers and errors among them.
        grips: of each finger.
        pushes: of each disturbance.
    """

    phases: dict[str, tuple[int, int]]
    grips: list[GripErrors]
    pushes: list[DisturbanceErrors]


def break_down_errors(seen: RecordingFeatures, decided: Decisions) -> ErrorBreakdown:
    """Where the errors are; nothing, where the truth is not known.

    Of a method that judges the hand as a whole, those of the hand.
    """
    truth = seen.truth
    judged = evaluated_units(decided)
    if truth is None or not {"phase", "outside_force"} <= set(truth.hand) or not judged:
        return ErrorBreakdown({}, [], [])
    return ErrorBreakdown(_phases(truth, judged), _grips(truth, judged), _pushes(truth, judged))


def evaluated_units(decided: Decisions) -> Mapping[str, FingerDecisions]:
    """What a method decides itself: the fingers, or the hand under the name `HAND`."""
    if decided.fingers or decided.hand is None:
        return decided.fingers
    return {HAND: decided.hand}


def _phases(truth: Truth, fingers: Mapping[str, FingerDecisions]) -> dict[str, tuple[int, int]]:
    counts = {str(phase): np.zeros(2, dtype=np.int64) for phase in Phase}
    for finger in fingers.values():
        known, wrong = _errors(finger)
        phase = truth.hand["phase"][_at(truth, finger.times)]
        for name, total in counts.items():
            here = known & (phase == name)
            total[:] += (here.sum(), (here & wrong).sum())
    return {name: (int(n), int(wrong)) for name, (n, wrong) in counts.items() if n}


def _grips(truth: Truth, fingers: Mapping[str, FingerDecisions]) -> list[GripErrors]:
    phase = truth.hand["phase"]
    grips = []
    locked = phase == Phase.LOCKED
    for name, finger in fingers.items():
        if "contact_force" not in truth.fingers.get(name, {}) or not locked.any():
            continue
        force = np.linalg.norm(truth.fingers[name]["contact_force"], axis=1)
        held = np.isin(phase, HELD_PHASES)[_at(truth, finger.times)]
        known, wrong = _errors(finger)
        stable = finger.labels == STABLE
        parts = (known & held & stable, known & held & ~stable)
        counts = [int(x) for part in parts for x in (part.sum(), (part & wrong).sum())]
        grips.append(GripErrors(float(force[locked].mean()), tuple(counts)))  # type: ignore[arg-type]
    return grips


def _pushes(truth: Truth, fingers: Mapping[str, FingerDecisions]) -> list[DisturbanceErrors]:
    pushing = np.isin(truth.hand["phase"], (Phase.DISTURBED, Phase.SLIPPING))
    found = []
    for start, end in runs(pushing):
        n = n_wrong = 0
        for finger in fingers.values():
            known, wrong = _errors(finger)
            here = np.zeros(len(finger.times), dtype=np.bool_)
            here[slice(*np.searchsorted(finger.times, truth.times[[start, end - 1]]))] = True
            here &= known & (finger.labels != STABLE)
            n, n_wrong = n + int(here.sum()), n_wrong + int((here & wrong).sum())
        force = truth.hand["outside_force"][start:end].mean(axis=0)
        found.append(DisturbanceErrors(_direction(force), n, n_wrong))
    return found


def _direction(force: Array) -> str:
    along = {name: float(force @ np.array(axis)) for name, axis in AXES.items()}
    best = max(along, key=lambda name: along[name])
    return best if along[best] >= NEAR * float(np.linalg.norm(force)) else "oblique"


def _errors(finger: FingerDecisions) -> tuple[Mask, Mask]:
    """Which samples have a label and a decision, and which decisions are wrong."""
    known = (finger.labels != UNKNOWN) & (finger.states != UNKNOWN)
    return known, (finger.labels == STABLE) != (finger.states == STABLE)


def _at(truth: Truth, times: Array) -> npt.NDArray[np.intp]:
    """The latest sample of the truth at those times."""
    return np.maximum(np.searchsorted(truth.times, times + ROUNDING) - 1, 0)


def calibration_counts(decided: Decisions) -> list[list[float]]:
    """(10, 3) sum of probabilities, stable samples and samples of each bin of probabilities."""
    sums = calibration_sums(list(evaluated_units(decided).values()))
    return [[float(x) for x in row] for row in sums]
