"""What is counted of a recording and the decisions about it: slips, errors and where they are."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import STABLE, UNKNOWN, Phase
from holdfast.metrics import Decisions, FingerDecisions
from holdfast.metrics.events import ROUNDING, STABLE_BEFORE
from holdfast.recordings import Truth
from holdfast.sensors.values import Array
from holdfast.study.expert import Seen
from holdfast.twin.labels import LabelRule

Mask = npt.NDArray[np.bool_]

HELD = (Phase.LOCKED, Phase.DISTURBED, Phase.SLIPPING)

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

N_BINS = 10
"""Of probabilities, for the reliability curve."""


class Slip(NamedTuple):
    """An object begins to slide on a fingertip of a hand that holds it.

    Attributes:
        onset: first sample at which it slides [s].
        told: when the hand was first said not to be stable, at the onset or later [s]; None
            where it never was before the sliding ended.
    """

    onset: float
    told: float | None


class Grip(msgspec.Struct, frozen=True):
    """Errors of a finger in a recording while the object is held.

    Attributes:
        force: mean size of its true contact force, locked [N].
        counts: samples labelled stable, of them wrong; labelled otherwise, of them wrong.
    """

    force: float
    counts: tuple[int, int, int, int]


class Pushed(msgspec.Struct, frozen=True):
    """One disturbance.

    Attributes:
        direction: one of `AXES`, or "oblique".
        n: samples of all fingers labelled not stable.
        wrong: of them called stable.
    """

    direction: str
    n: int
    wrong: int


class Breakdown(msgspec.Struct, frozen=True):
    """Where the errors of one recording are.

    Attributes:
        phases: by phase, samples of all fingers and errors among them.
        grips: of each finger.
        pushes: of each disturbance.
    """

    phases: dict[str, tuple[int, int]]
    grips: list[Grip]
    pushes: list[Pushed]


def slips_of(seen: Seen, hand: FingerDecisions) -> list[Slip]:
    """The slips of a recording, and when each was told; none where the truth is not known."""
    if seen.truth is None or "phase" not in seen.truth.hand:
        return []
    times = seen.truth.times
    sliding = _sliding(seen.truth)
    slips, rested = [], -np.inf
    for start, end in _runs(sliding):
        since = max(rested, _held_since(seen.truth, start))
        if times[start] - since >= STABLE_BEFORE - ROUNDING:
            slips.append(_slip(float(times[start]), float(times[end - 1]), hand))
        rested = float(times[end - 1])
    return slips


def _sliding(truth: Truth) -> Mask:
    """Whether the object slides on a finger of a hand that holds it."""
    rule = LabelRule()
    held = np.isin(truth.hand["phase"], HELD)
    found = np.zeros(len(truth.times), dtype=np.bool_)
    for finger in truth.fingers.values():
        touching = np.linalg.norm(finger["contact_force"], axis=1) > rule.contact
        found |= touching & (finger["slip_speed"] > rule.sliding)
    return np.asarray(held & found)


def _held_since(truth: Truth, place: int) -> float:
    held = np.isin(truth.hand["phase"][: place + 1], HELD)
    free = np.flatnonzero(~held)
    return float(truth.times[free[-1]]) if len(free) else float(truth.times[0])


def _slip(onset: float, end: float, hand: FingerDecisions) -> Slip:
    last = max(end, onset) + ROUNDING
    rows = (hand.times >= onset - ROUNDING) & (hand.times <= max(last, onset + 0.2 + ROUNDING))
    told = rows & (hand.states != STABLE) & (hand.states != UNKNOWN)
    return Slip(onset, float(hand.times[np.argmax(told)]) if told.any() else None)


def n_found(slips: Sequence[Slip], within: float) -> int:
    """Slips that were told within that time [s]."""
    return sum(s.told is not None and s.told <= s.onset + within + ROUNDING for s in slips)


def count(seen: Seen, decided: Decisions) -> Breakdown:
    """Where the errors are; nothing, where the truth is not known."""
    truth = seen.truth
    if truth is None or "phase" not in truth.hand or not decided.fingers:
        return Breakdown({}, [], [])
    return Breakdown(
        _phases(truth, decided), _grips(truth, decided), _pushes(truth, decided.fingers)
    )


def _phases(truth: Truth, decided: Decisions) -> dict[str, tuple[int, int]]:
    counts = {str(phase): np.zeros(2, dtype=np.int64) for phase in Phase}
    for finger in decided.fingers.values():
        known, wrong = _errors(finger)
        phase = truth.hand["phase"][_at(truth, finger.times)]
        for name, total in counts.items():
            here = known & (phase == name)
            total[:] += (here.sum(), (here & wrong).sum())
    return {name: (int(n), int(wrong)) for name, (n, wrong) in counts.items() if n}


def _grips(truth: Truth, decided: Decisions) -> list[Grip]:
    phase = truth.hand["phase"]
    grips = []
    for name, finger in decided.fingers.items():
        force = np.linalg.norm(truth.fingers[name]["contact_force"], axis=1)
        locked = phase == Phase.LOCKED
        if not locked.any():
            continue
        held = np.isin(phase, HELD)[_at(truth, finger.times)]
        known, wrong = _errors(finger)
        stable = finger.labels == STABLE
        parts = (known & held & stable, known & held & ~stable)
        counts = [int(x) for part in parts for x in (part.sum(), (part & wrong).sum())]
        grips.append(Grip(float(force[locked].mean()), tuple(counts)))  # type: ignore[arg-type]
    return grips


def _pushes(truth: Truth, fingers: Mapping[str, FingerDecisions]) -> list[Pushed]:
    pushing = np.isin(truth.hand["phase"], (Phase.DISTURBED, Phase.SLIPPING))
    found = []
    for start, end in _runs(pushing):
        n = n_wrong = 0
        for finger in fingers.values():
            known, wrong = _errors(finger)
            here = np.zeros(len(finger.times), dtype=np.bool_)
            here[slice(*np.searchsorted(finger.times, truth.times[[start, end - 1]]))] = True
            here &= known & (finger.labels != STABLE)
            n, n_wrong = n + int(here.sum()), n_wrong + int((here & wrong).sum())
        force = truth.hand["outside_force"][start:end].mean(axis=0)
        found.append(Pushed(_direction(force), n, n_wrong))
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


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """First sample of each run of True, and the first after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def calibration_counts(decided: Sequence[FingerDecisions]) -> list[list[float]]:
    """(10, 3) sum of probabilities, stable samples and samples of each bin of probabilities."""
    total = np.zeros((N_BINS, 3))
    for finger in decided:
        known = (finger.labels != UNKNOWN) & (finger.states != UNKNOWN)
        p = finger.stable_probability[known]
        stable = (finger.labels[known] == STABLE).astype(np.float64)
        bins = np.clip((p * N_BINS).astype(np.int64), 0, N_BINS - 1)
        for column, weights in enumerate((p, stable, np.ones(len(p)))):
            total[:, column] += np.bincount(bins, weights=weights, minlength=N_BINS)
    return [[float(x) for x in row] for row in total]
