"""The errors of one recording by phase, grip force and direction of the disturbance."""

from collections.abc import Mapping

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import HELD_PHASES, STABLE, TIME_TOLERANCE, UNKNOWN, Phase
from holdfast.metrics import Decisions, FingerDecisions, calibration_sums
from holdfast.metrics.masks import Mask, runs
from holdfast.recordings import Truth
from holdfast.sensors.types import Array
from holdfast_lab.study.methods import HAND

PULL_DIRECTIONS = {
    "down": (0.0, 0.0, -1.0),
    "up": (0.0, 0.0, 1.0),
    "left": (0.0, -1.0, 0.0),
    "right": (0.0, 1.0, 0.0),
    "away": (-1.0, 0.0, 0.0),
    "towards": (1.0, 0.0, 0.0),
}
"""Unit vectors of the directions of a disturbance in the world frame."""
OBLIQUE = "oblique"
"""Direction of a disturbance that is more than 30 degrees away from all of `PULL_DIRECTIONS`."""
MIN_DIRECTION_COSINE = np.cos(np.radians(30.0))

CountPair = tuple[int, int]
"""Number of samples, and of wrong decisions among them."""


class GripErrors(msgspec.Struct, frozen=True):
    """Errors of one finger in one recording while the hand holds the object.

    Attributes:
        force: mean magnitude of the true contact force while the object is locked [N].
        stable: count of the samples labelled stable.
        not_stable: count of the samples with another label.
    """

    force: float
    stable: CountPair
    not_stable: CountPair


class DisturbanceErrors(msgspec.Struct, frozen=True):
    """Errors of all fingers during one disturbance.

    Attributes:
        direction: of the mean outside force: one of `PULL_DIRECTIONS`, or `OBLIQUE`.
        n: samples labelled not stable.
        n_wrong: of those, samples called stable.
    """

    direction: str
    n: int
    n_wrong: int


class ErrorBreakdown(msgspec.Struct, frozen=True):
    """The errors of one recording by phase, finger and disturbance.

    Attributes:
        phases: count of all fingers in each phase.
        grips: of each finger.
        disturbances: of each disturbance.
    """

    phases: dict[str, CountPair]
    grips: list[GripErrors]
    disturbances: list[DisturbanceErrors]


def break_down_errors(truth: Truth | None, decisions: Decisions) -> ErrorBreakdown:
    """Return the errors of a recording by phase, finger and disturbance.

    A method that decides for the whole hand has the errors of the hand. The breakdown is empty
    if the truth is not known.
    """
    units = decided_units(decisions)
    if truth is None or not {"phase", "outside_force"} <= set(truth.hand) or not units:
        return ErrorBreakdown({}, [], [])
    return ErrorBreakdown(
        _phase_errors(truth, units), _grip_errors(truth, units), _disturbance_errors(truth, units)
    )


def decided_units(decisions: Decisions) -> Mapping[str, FingerDecisions]:
    """Return what a method decides for: the fingers, or the hand under the name `HAND`."""
    if decisions.fingers or decisions.hand is None:
        return decisions.fingers
    return {HAND: decisions.hand}


def _phase_errors(truth: Truth, units: Mapping[str, FingerDecisions]) -> dict[str, CountPair]:
    counts = {str(phase): np.zeros(2, dtype=np.int64) for phase in Phase}
    for unit in units.values():
        known, wrong = _known_and_wrong(unit)
        phase = truth.hand["phase"][_truth_rows(truth, unit.times)]
        for name, total in counts.items():
            total[:] += _count(known & (phase == name), wrong)
    return {name: (int(n), int(n_wrong)) for name, (n, n_wrong) in counts.items() if n}


def _grip_errors(truth: Truth, units: Mapping[str, FingerDecisions]) -> list[GripErrors]:
    phase = truth.hand["phase"]
    locked = phase == Phase.LOCKED
    grips = []
    for name, unit in units.items():
        if "contact_force" not in truth.fingers.get(name, {}) or not locked.any():
            continue
        force = np.linalg.norm(truth.fingers[name]["contact_force"], axis=1)
        held = np.isin(phase, HELD_PHASES)[_truth_rows(truth, unit.times)]
        known, wrong = _known_and_wrong(unit)
        stable = unit.labels == STABLE
        grips.append(
            GripErrors(
                force=float(force[locked].mean()),
                stable=_count(known & held & stable, wrong),
                not_stable=_count(known & held & ~stable, wrong),
            )
        )
    return grips


def _disturbance_errors(
    truth: Truth, units: Mapping[str, FingerDecisions]
) -> list[DisturbanceErrors]:
    disturbed = np.isin(truth.hand["phase"], (Phase.DISTURBED, Phase.SLIPPING))
    disturbances = []
    for start, end in runs(disturbed):
        n = n_wrong = 0
        for unit in units.values():
            known, wrong = _known_and_wrong(unit)
            inside = np.zeros(len(unit.times), dtype=np.bool_)
            inside[slice(*np.searchsorted(unit.times, truth.times[[start, end - 1]]))] = True
            of_unit, wrong_of_unit = _count(inside & known & (unit.labels != STABLE), wrong)
            n, n_wrong = n + of_unit, n_wrong + wrong_of_unit
        force = truth.hand["outside_force"][start:end].mean(axis=0)
        disturbances.append(DisturbanceErrors(_direction(force), n, n_wrong))
    return disturbances


def _direction(force: Array) -> str:
    along = {name: float(force @ np.array(axis)) for name, axis in PULL_DIRECTIONS.items()}
    best = max(along, key=lambda name: along[name])
    return best if along[best] >= MIN_DIRECTION_COSINE * float(np.linalg.norm(force)) else OBLIQUE


def _known_and_wrong(unit: FingerDecisions) -> tuple[Mask, Mask]:
    """Return which samples have a label and a decision, and which decisions are wrong."""
    known = (unit.labels != UNKNOWN) & (unit.states != UNKNOWN)
    return known, (unit.labels == STABLE) != (unit.states == STABLE)


def _count(samples: Mask, wrong: Mask) -> CountPair:
    return int(samples.sum()), int((samples & wrong).sum())


def _truth_rows(truth: Truth, times: Array) -> npt.NDArray[np.intp]:
    """Return the latest row of the truth at each time."""
    return np.maximum(np.searchsorted(truth.times, times + TIME_TOLERANCE) - 1, 0)


def calibration_counts(decisions: Decisions) -> list[list[float]]:
    """Return (10, 3): sum of probabilities, stable samples and all samples of each bin.

    The bins are ten equal intervals of the probability of stability.
    """
    sums = calibration_sums(list(decided_units(decisions).values()))
    return [[float(x) for x in row] for row in sums]
