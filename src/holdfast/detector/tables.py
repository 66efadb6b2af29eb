"""The tables of a detector in C, by the names of the structs in `kernel/detector.h`."""

import numpy as np
import numpy.typing as npt

from holdfast.contact import CAUSES, MAX_TAXELS, SLIP_CODE, n_mask_words
from holdfast.features.tables import StreamPlan, Struct
from holdfast.model import FingerModel, Head, Model
from holdfast.model.heads import HEAD_NAMES
from holdfast.sensors.types import Array

ALWAYS_CONTACT, BY_FORCE, BY_NOISE, BY_LOAD = range(4)

Rules = tuple[list[Struct], list[Struct], Array]
"""Rules of the fingers, four heads for each of them, and the numbers of all heads."""

ESTIMATE = np.dtype(
    [
        ("time", np.float64), ("state", np.int32), ("reason", np.int32), ("cause", np.int32),
        ("faults", np.uint32), ("taxels", np.uint64, n_mask_words(MAX_TAXELS)),
        ("probability", np.float64), ("slip", np.float64), ("speed", np.float64),
        ("distance", np.float64), ("sigma", np.float64), ("force", np.float64, 3),
    ]
)  # fmt: skip
"""`holdfast_finger_estimate`."""


def model_table(model: Model, plan: StreamPlan) -> Struct:
    """Return the settings of a model that hold for all fingers."""
    return {
        "n_model_fingers": model.n_fingers(plan.fingers),
        "hysteresis": model.debounce.hysteresis,
        "min_duration": model.debounce.min_duration,
        "hold": model.debounce.hold,
        "has_filter": model.debounce.switching_rate > 0,
        "switching": model.debounce.switching_rate,
        "zero_unknown": plan.zero_unknown,
    }


def rules_of(model: Model, plan: StreamPlan) -> Rules:
    """Return the rules of the fingers of a plan, in its order."""
    parts = [model.finger(name, sensor) for name, sensor in plan.sensors.items()]
    heads: list[Struct] = []
    numbers = [np.empty(0)]
    for part in parts:
        for name in HEAD_NAMES:
            head = part.head(name)
            rows, squares, causes = _numbers(part, head)
            heads.append(
                {
                    # Without the head they are not read.
                    "threshold": 0.0 if head is None else head.threshold,
                    "gain": 1.0 if head is None else head.gain(plan.rate),
                    "hold": 0.0 if head is None else head.hold,
                    "highest": 0.0 if head is None else head.highest or 0.0,
                    "n_outputs": len(rows),
                    "n_features": rows.shape[1] - 1,
                    "first": sum(map(len, numbers)),
                    "has_squares": len(squares) > 0,
                    "causes": causes + [0] * (len(CAUSES) - len(causes)),
                }
            )
            numbers += [rows.ravel(), squares.ravel()]
    return [_contact(part) for part in parts], heads, np.concatenate(numbers)


def stable_head(rules: Rules, finger: int) -> Struct:
    """Return the head of stability of a finger."""
    return rules[1][finger * len(HEAD_NAMES) + HEAD_NAMES.index("stable")]


def _contact(part: FingerModel) -> Struct:
    # In this order: a model of relative features has a limit by load; and a limit in the unit of
    # the readings, which was measured, is better than a multiple of the noise.
    for kind, limit in (
        (BY_LOAD, part.contact_load),
        (BY_FORCE, part.contact_threshold),
        (BY_NOISE, part.contact_noise),
    ):
        if limit is not None:
            return {"contact": kind, "contact_limit": limit}
    return {"contact": ALWAYS_CONTACT, "contact_limit": 0.0}


def _numbers(part: FingerModel, head: Head | None) -> tuple[Array, Array, list[int]]:
    """Return the weights (n_outputs, 1 + n) of the first n features, those of squares, and causes.

    A slip is no likely cause where a head decides about slips.
    """
    if head is None:
        return np.zeros((0, 1)), np.zeros((0, 0)), []
    columns = part.indices(head)
    # A head reads the features up to the last that it uses; those of slips read all.
    is_slip = head.name in ("slip", "slip_speed")
    n = len(part.features) if is_slip else int(columns.max(initial=0)) + 1
    # A row is the intercept, then a weight for each feature: 0 for those that it does not use.
    rows = np.zeros((head.rule.n_outputs, n + 1))
    rows[:, np.append(0, columns + 1)] = head.rule.raw_weights()
    squares = np.zeros((3 if head.rule.squares else 0, n))
    squares[:, columns] = head.rule.raw_squares()[: len(squares)]
    # The kernel goes through the causes in the order of their codes, whatever that of the model.
    codes = [CAUSES.index(cause) + 1 for cause in head.classes]
    order = np.argsort(codes)
    kept = [k for k in order if part.slip is None or codes[k] != SLIP_CODE]
    if head.classes:
        return rows[kept], squares, [codes[k] for k in kept]
    return rows, squares, []


def estimate_rows(n: int, n_fingers: int) -> tuple[npt.NDArray[np.void], Array]:
    """Return estimates to be filled (n, n_fingers), and the same memory as numbers."""
    numbers = np.zeros((n, n_fingers, ESTIMATE.itemsize // 8))
    return numbers.view(ESTIMATE)[..., 0], numbers
