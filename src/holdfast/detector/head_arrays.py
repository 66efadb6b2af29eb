"""Layout of the heads of a model in the arrays of the compiled decision rule.

What a model does not have is an empty array or NaN in them, nowhere else.
"""

import math
from collections.abc import Sequence

import numpy as np

from holdfast.classifiers import Linear
from holdfast.contact import CAUSES, SLIP_CODE
from holdfast.detector import arrays as rule_at
from holdfast.detector.arrays import DecisionRule
from holdfast.features.stream import StreamPlan
from holdfast.model import FingerModel, HeadName, Model
from holdfast.sensors.types import Array


def rule_of(model: Model, plan: StreamPlan) -> DecisionRule:
    """Return the constants of a model for the fingers of a plan, in its order."""
    parts = [model.finger(name, sensor) for name, sensor in plan.sensors.items()]
    # Steps read the first features of a finger: up to the last that a head uses.
    used = {name: [_n_used(part, name) for part in parts] for name in ("stable", "cause")}
    width = max(*used["stable"], *used["cause"])
    all_features = [len(part.features) for part in parts]
    slips, squares = _rows(parts, "slip", max(all_features))
    speeds, speed_squares = _rows(parts, "slip_speed", max(all_features))
    limits = [
        (part.stable.threshold, part.contact_threshold, part.contact_noise, part.contact_load)
        for part in parts
    ]
    has_causes = any(part.head("cause") for part in parts)
    has_squares = any(part.slip is not None and part.slip.linear.squares for part in parts)
    has_speeds = any(part.head("slip_speed") for part in parts)
    no_squares = np.zeros((len(parts), 3, 0))
    return DecisionRule(
        weights=_rows(parts, "stable", width)[0],
        # Of an ONNX file the offset alone, which `ProbabilityFeeder` writes.
        n_weights=np.array(
            [
                n + 1 if isinstance(part.stable.rule, Linear) else 1
                for n, part in zip(used["stable"], parts, strict=True)
            ]
        ),
        causes=_cause_rows(parts, width) if has_causes else np.zeros((len(parts), 0, width + 1)),
        slips=slips,
        n_slip_weights=np.array(all_features) + 1,
        squares=squares if has_squares else no_squares,
        speeds=speeds if has_speeds else np.zeros((len(parts), 0)),
        speed_squares=speed_squares if has_speeds else no_squares,
        slip_limits=np.array([_slip_limits(part, plan.rate) for part in parts]),
        limits=np.array(limits, dtype=np.float64),  # None becomes NaN
        hysteresis=float(model.debounce.hysteresis),
        min_duration=float(model.debounce.min_duration),
        hold=float(model.debounce.hold),
        switching=model.debounce.switching_rate,
        n_model_fingers=model.n_fingers(plan.fingers),
    )


def _n_used(part: FingerModel, name: HeadName) -> int:
    """Return how many of the features of a finger come up to the last that a head uses."""
    head = part.head(name)
    return 0 if head is None else int(part.indices(head).max(initial=-1)) + 1


def _rows(parts: Sequence[FingerModel], name: HeadName, width: int) -> tuple[Array, Array]:
    """Return the weights of a head at the indices of all features, and those of its squares.

    Returns:
        (n_fingers, width + 1) and (n_fingers, 3, width); zeros without the head.
    """
    weights, squares = np.zeros((len(parts), width + 1)), np.zeros((len(parts), 3, width))
    for row, square, part in zip(weights, squares, parts, strict=True):
        head = part.head(name)
        if head is not None and isinstance(head.rule, Linear):
            columns = part.indices(head)
            row[np.append(0, columns + 1)] = head.rule.raw_weights()[0]
            square[:, columns] = head.rule.raw_squares()
    return weights, squares


def _cause_rows(parts: Sequence[FingerModel], width: int) -> Array:
    """Return (n_fingers, n_causes, width + 1) the weights of the causes.

    A cause that a finger does not tell apart never has the largest score: its offset is -infinity.
    So is that of a slip where a head decides about slips. Without the head all scores are 0.
    """
    weights = np.zeros((len(parts), len(CAUSES), width + 1))
    for rows, part in zip(weights, parts, strict=True):
        head = part.head("cause")
        if head is None:
            continue
        rows[:, 0] = -math.inf
        for cause, row in zip(head.classes, head.linear.raw_weights(), strict=True):
            if part.slip is None or CAUSES.index(cause) != SLIP_CODE - 1:
                rows[CAUSES.index(cause), np.append(0, part.indices(head) + 1)] = row
    return weights


def _slip_limits(part: FingerModel, rate: float) -> Array:
    """Return (SLIP_LIMITS_WIDTH,) the limits of the head of slips; NaN without it."""
    limits = np.full(rule_at.SLIP_LIMITS_WIDTH, np.nan)
    head, speed = part.slip, part.head("slip_speed")
    if head is not None:
        limits[: rule_at.HIGHEST_SPEED] = head.threshold, head.gain(rate), head.hold
    if speed is not None:
        limits[rule_at.HIGHEST_SPEED] = speed.highest
    return limits
