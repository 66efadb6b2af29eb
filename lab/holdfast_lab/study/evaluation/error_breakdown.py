"""The errors of one recording by phase, grip force and direction, and the glitches of its hand."""

from typing import Any

import msgspec
import numpy as np

from holdfast.contact import (
    CONTACT_FORCE,
    HELD_PHASES,
    SLIP_SPEED,
    STABLE,
    TIME_TOLERANCE,
    UNKNOWN,
    Phase,
)
from holdfast.metrics import Decisions, FingerDecisions
from holdfast.metrics.masks import Mask, runs
from holdfast.metrics.slip_truth import sample_durations
from holdfast.metrics.truth_labels import LabelRule, glitches
from holdfast.recordings import Truth
from holdfast.sensors.types import Array

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


class ErrorBreakdown(msgspec.Struct, frozen=True):
    """The errors of one recording by phase, finger and disturbance.

    Attributes:
        phases: count of all fingers in each phase.
        grips: of each finger.
        disturbances: direction of each, one of `PULL_DIRECTIONS` or `OBLIQUE`, and count of its
            samples labelled not stable, of all fingers.
    """

    phases: dict[str, CountPair] = {}
    grips: list[GripErrors] = []
    disturbances: list[tuple[str, CountPair]] = []


def break_down_errors(truth: Truth | None, decisions: Decisions) -> ErrorBreakdown:
    """Return the errors of a recording.

    Args:
        truth: with the phases and the outside force, else the breakdown is empty.
        decisions: of each finger; of a whole-hand method, of `HAND`, which has no grip.
    """
    if truth is None or not {"phase", "outside_force"} <= set(truth.hand):
        return ErrorBreakdown()
    phase = truth.hand["phase"]
    locked = phase == Phase.LOCKED
    disturbed = runs(np.isin(phase, (Phase.DISTURBED, Phase.SLIPPING)))
    phases = {str(name): (0, 0) for name in Phase}
    pushes, grips = [(0, 0)] * len(disturbed), []
    for name, unit in decisions.fingers.items():
        now = phase[latest_rows(truth, unit.times)]
        stable = unit.labels == STABLE
        for phase_name, count in phases.items():
            phases[phase_name] = _added(count, unit, now == phase_name)
        for k, (start, end) in enumerate(disturbed):
            inside = np.zeros(len(now), dtype=np.bool_)
            inside[slice(*np.searchsorted(unit.times, truth.times[[start, end - 1]]))] = True
            pushes[k] = _added(pushes[k], unit, inside & ~stable)
        if "contact_force" in truth.fingers.get(name, {}) and locked.any():
            force = np.linalg.norm(truth.fingers[name]["contact_force"], axis=1)
            grasped = np.isin(now, HELD_PHASES)
            counts = (_added((0, 0), unit, grasped & kind) for kind in (stable, ~stable))
            grips.append(GripErrors(float(force[locked].mean()), *counts))
    forces = (truth.hand["outside_force"][start:end].mean(axis=0) for start, end in disturbed)
    return ErrorBreakdown(
        {name: count for name, count in phases.items() if count[0]},
        grips,
        list(zip(map(_direction, forces), pushes, strict=True)),
    )


def _added(count: CountPair, unit: FingerDecisions, samples: Mask) -> CountPair:
    """Return a count with those of some samples that have a label and a decision."""
    counted = samples & (unit.labels != UNKNOWN) & (unit.states != UNKNOWN)
    wrong = counted & ((unit.labels == STABLE) != (unit.states == STABLE))
    return count[0] + int(counted.sum()), count[1] + int(wrong.sum())


def _direction(force: Array) -> str:
    along = {name: float(force @ np.array(axis)) for name, axis in PULL_DIRECTIONS.items()}
    best = max(along, key=lambda name: along[name])
    return best if along[best] >= MIN_DIRECTION_COSINE * float(np.linalg.norm(force)) else OBLIQUE


def latest_rows(truth: Truth, times: Array) -> Any:  # noqa: ANN401 (indices)
    """Return the latest row of the truth at each time."""
    return np.maximum(np.searchsorted(truth.times, times + TIME_TOLERANCE, side="right") - 1, 0)


class GlitchCount(msgspec.Struct, frozen=True):
    """Glitches of the hand's controller in one recording, while the hand holds the object.

    Attributes:
        distances: for each glitch, how far the object slides until the effect of the glitch and
            the sliding that began in it are over [m].
        grasped_seconds: time for which the hand holds the object [s].
    """

    distances: list[float] = []
    grasped_seconds: float = 0.0


def count_glitches(truth: Truth | None) -> GlitchCount:
    """Return the glitches while the hand holds the object, and how far the object slides."""
    if truth is None or not {"phase", "set_point_error"} <= set(truth.hand):
        return GlitchCount()
    grasped = np.isin(truth.hand["phase"], HELD_PHASES)
    steps = sample_durations(truth.times)
    # The speed on the finger on which the object slides fastest [m/s].
    speed = np.zeros(len(truth.times))
    for finger in truth.fingers.values():
        if {"contact_force", "slip_speed"} <= set(finger):
            touching = np.linalg.norm(finger["contact_force"], axis=1) > CONTACT_FORCE
            slips = touching & (finger["slip_speed"] > SLIP_SPEED)
            speed = np.maximum(speed, np.where(slips, finger["slip_speed"], 0.0))
    speed = np.where(grasped, speed, 0.0)
    sliding = runs(speed > 0)
    distances = []
    for start, end in runs(grasped & glitches(truth, LabelRule())):
        # A slide that the glitch began may outlast it: its whole way belongs to the glitch.
        begun = sliding[(sliding[:, 0] >= start) & (sliding[:, 0] < end)]
        last = max([end, *begun[:, 1].tolist()])
        distances.append(float((speed * steps)[start:last].sum()))
    return GlitchCount(distances, float(steps[grasped].sum()))
