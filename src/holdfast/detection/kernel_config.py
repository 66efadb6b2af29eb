"""Tables of the C kernel, by the names of its structs: those of a plan, and of a model."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from holdfast.contact import CAUSES, SLIP_CODE
from holdfast.detection.heads import HEAD_NAMES, Head
from holdfast.detection.plan import StreamPlan
from holdfast.detection.specs import KINDS, SCOPES, TRANSFORMS, FeatureSpec
from holdfast.kernel import _extension
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Flags

if TYPE_CHECKING:
    from holdfast.detection.model import FingerModel, Model

Struct = dict[str, Any]
StreamTables = tuple[Struct, list[Struct], list[Struct], list[Struct], Array, Array, Array]
"""Hand, fingers, features of all fingers, lags; then used taxels, rotations and places in lanes."""

TARE_KINDS = ("seconds", "first", "none", "interval")
"""Kinds of tare. The code of a kind is its position."""
N_COMPONENTS = 4
"""Values with a Haar window: F_a, and the components of F_tip."""
COUNT_NOISE = float(1 / np.sqrt(12))
"""Standard deviation of rounding to whole counts: the least noise of a reading [count]."""
NEWTON_NOISE = 1e-6
"""Least noise of a reading in newtons, whose step is not known [N]."""
NOISE_SECONDS, LOADED_NOISE_SECONDS = 0.5, 0.2
"""Time over which the noise of a sensor is measured, where the tare takes no time; and where the
stream begins in contact [s]."""
END_SHARE = 0.01
"""A reading is near an end of the range within this share of it. Real readings were never nearer
than 23 %."""
OFFSET_SHARE = 0.25
"""Share of the range by which the mean of all readings cannot change. A uSkin that is pressed with
the full range of every taxel changes by 7 %; real recordings had 0.5 %."""
SUM_OF_WEIGHTS = 1.0 + float(np.sqrt(2.0)) / 1.5 + float(np.sqrt(3.0)) / 1.6
"""Of the axes in the sum of the readings, see `kernel/faults.c`."""
MAX_EARTH_FIELDS = {"anyskin": 130.0}
"""Twice the field of the earth, by sensors whose readings are in microtesla: it is at most 65 µT,
and changes by twice that when a hand is turned over [µT]."""
GAP_LIMIT_PERIODS = 3.0003
"""A step in time of more sample periods is a gap. The part over 3 allows for rounding."""
MAX_BRIDGED_SECONDS = 0.10001
"""Longest gap that windows in seconds bridge: 0.1 s, with an allowance for rounding."""
AVERAGE_SECONDS = 0.02
"""Time constant of averages of squared second differences [s]."""
RING_SPARE = 2
"""Samples that the history of relative features holds, as a multiple of those of its longest lag:
for bursts, and for a rate that rises."""


def stream_tables(plan: StreamPlan) -> StreamTables:
    """Return the tables of a stream: hand, fingers, features, lags, and three of taxels."""
    features = [plan.features[finger] for finger in plan.fingers]
    seconds = sorted({spec.seconds for specs in features for spec in specs if spec.seconds})
    lags = [_lag(lag, plan.rate, [s for specs in features for s in specs]) for lag in seconds]
    used = [plan.used(finger) for finger in plan.fingers]
    n_taxels = [len(flags) for flags in used]
    # Fingers begin at whole vectors of the processor, so that its loops need no remainder.
    n_lanes = [-(-n // _extension.LANES) * _extension.LANES for n in n_taxels]
    sensors = plan.sensors.values()
    fingers = [
        _finger(sensor, int(flags.sum()), plan, specs)
        | {"first_taxel": sum(n_taxels[:f]), "n_taxels": n_taxels[f], "first": sum(n_lanes[:f])}
        for f, (sensor, flags, specs) in enumerate(zip(sensors, used, features, strict=True))
    ]
    taxels = list(zip(sensors, used, n_lanes, strict=True))
    return (
        _hand(plan, features, lags) | {"n_lanes": sum(n_lanes)},
        fingers,
        [row for specs in features for row in _features(specs, plan.width, seconds)],
        lags,
        np.concatenate([_in_lanes(flags.astype(np.float64), n) for _, flags, n in taxels]),
        np.concatenate(
            # A rotation of 0 takes an ignored taxel out of all sums without a branch.
            [_in_lanes(np.where(u[:, None, None], s.rotations, 0), n) for s, u, n in taxels]
        ),
        np.concatenate([_in_lanes(_places(s, u), n) for s, u, n in taxels]),
    )


def n_levels(window: int) -> int:
    """Return the number of sizes of blocks in windows up to this one."""
    return (window // 2).bit_length()


def _hand(
    plan: StreamPlan, features: Sequence[Sequence[FeatureSpec]], lags: Sequence[Struct]
) -> Struct:
    tare, specs = plan.used_tare, [spec for own in features for spec in own]
    n_history = max([plan.window, *(spec.window for spec in specs)])
    # The stretch of the tare shows the noise too, as nothing touches; where the tare takes no
    # time, the first samples after it do. Under load the hand may move soon, so less is taken.
    noise_seconds = plan.tare.seconds if plan.tare.kind == "seconds" else NOISE_SECONDS
    if plan.start.loaded:
        noise_seconds = LOADED_NOISE_SECONDS
    # A second difference looks back by two lags.
    reach = max([lag["samples"] * (1 + lag["has_seconds"]) for lag in lags], default=0)
    return {
        "n_fingers": len(features),
        "n_features": plan.width,
        "n_lags": len(lags),
        "n_history": n_history,
        "n_channels": N_COMPONENTS if any(KINDS[spec.kind].of_components for spec in specs) else 1,
        "n_levels": n_levels(n_history),
        "n_track": RING_SPARE * reach + 1,
        "period": 1.0 / plan.rate,
        "tare_kind": TARE_KINDS.index(tare.kind),
        "tare_seconds": tare.seconds,
        "noise_seconds": noise_seconds,
        "average_gain": -float(np.expm1(-1.0 / (plan.rate * AVERAGE_SECONDS))),
        "alike": len({tuple(own) for own in features}) == 1,
        "has_centres": any(lag["has_changes"] for lag in lags),
        "has_ratios": any(lag["has_ratios"] for lag in lags),
    }


def _finger(sensor: Sensor, n_used: int, plan: StreamPlan, specs: Sequence[FeatureSpec]) -> Struct:
    """Return the constants of a finger; each used taxel rounds its readings."""
    # Without a range nothing is near its end, and the mean of the readings may change at will.
    low, high = sensor.range or (-np.inf, np.inf)
    end = END_SHARE * (high - low) if sensor.range else 0.0
    noise = COUNT_NOISE if sensor.unit == "count" else NEWTON_NOISE
    # Haar windows count samples, which a gap breaks; lags in seconds bridge a short one by time. So
    # a finger bridges gaps only if all its features are over lags, and is ready after two samples.
    in_seconds = all(spec.seconds for spec in specs)
    bridges, gap = in_seconds and bool(specs), GAP_LIMIT_PERIODS / plan.rate
    return {
        "n_used": float(n_used),
        "low": low,
        "high": high,
        "low_end": low + end,
        "high_end": high - end,
        "max_offset": OFFSET_SHARE * (high - low) * n_used * SUM_OF_WEIGHTS,
        "min_noise": float(noise * np.sqrt(n_used)),
        "rounding_noise": noise if sensor.unit == "count" else np.nan,
        "is_magnetic": bool(sensor.magnetic),
        # The load of the start, when it goes, may look like a field.
        "max_field": MAX_EARTH_FIELDS.get(sensor.name, np.inf)
        if sensor.magnetic and not plan.zero_unknown
        else 0.0,
        "max_step": max(gap, MAX_BRIDGED_SECONDS) if bridges else gap,
        **{f"normal[{axis}]": float(value) for axis, value in enumerate(sensor.normal)},
        "sigma_window": plan.window,
        "ready_window": 2 if in_seconds else max([plan.window, *(s.window for s in specs)]),
        "bridges": bridges,
    }


def _features(specs: Sequence[FeatureSpec], width: int, seconds: Sequence[float]) -> list[Struct]:
    """Return the features of a finger, padded to those of the finger that has most."""
    # Scope is left out: `hand` takes the largest of values that each finger has computed anyway.
    own = [(spec.kind, spec.window, spec.transform, spec.floor, spec.seconds) for spec in specs]
    padding: Struct = {
        "kind": -1, "transform": 0, "of_hand": False, "window": 0, "lag": 0, "same_as": 0,
        "floor": 0.0,
    }  # fmt: skip
    return [
        {
            "kind": list(KINDS).index(spec.kind),
            "transform": 0 if spec.seconds else TRANSFORMS.index(spec.transform),
            "of_hand": spec.scope == SCOPES[1],
            "window": spec.window,
            "lag": seconds.index(spec.seconds) if spec.seconds else 0,
            "same_as": own.index(alike),
            "floor": spec.floor,
        }
        for spec, alike in zip(specs, own, strict=True)
    ] + [padding] * (width - len(specs))


def _lag(seconds: float, rate: float, specs: Sequence[FeatureSpec]) -> Struct:
    families = {KINDS[spec.kind].family for spec in specs if spec.seconds == seconds}
    return {
        "samples": max(1, round(seconds * rate)),
        "seconds": seconds,
        "has_changes": not families.isdisjoint(("change", "load")),
        "has_seconds": not families.isdisjoint(("second", "mean_second")),
        "has_means": "mean_second" in families,
        "has_ratios": "ratio" in families,
    }


def _places(sensor: Sensor, used: Flags) -> Array:
    """Return the taxels' places about their centroid, in root mean square distances from it."""
    if not used.any():
        return np.zeros_like(sensor.positions)
    places = sensor.positions - sensor.positions[used].mean(axis=0)
    radius = float(np.sqrt((places[used] ** 2).sum(axis=1).mean()))
    return places / radius if radius > 0 else np.zeros_like(places)


def _in_lanes(values: Array, n_lanes: int) -> Array:
    """Return values of the taxels of a finger (n_taxels, ...) in lanes: (..., n_lanes)."""
    own = values.reshape(len(values), -1).T
    return np.pad(own, ((0, 0), (0, n_lanes - own.shape[1]))).ravel()


ALWAYS_CONTACT, BY_FORCE, BY_NOISE, BY_LOAD = range(4)

Rules = tuple[list[Struct], list[Struct], Array]
"""Rules of the fingers, four heads for each of them, and the numbers of all heads."""

ESTIMATE = np.dtype(
    [
        ("time", np.float64), ("state", np.int32), ("reason", np.int32), ("cause", np.int32),
        ("faults", np.uint32), ("taxels", np.int64), ("probability", np.float64),
        ("slip", np.float64), ("speed", np.float64), ("distance", np.float64),
        ("sigma", np.float64), ("force", np.float64, 3),
    ]
)  # fmt: skip
"""`holdfast_finger_estimate`."""


def model_table(model: "Model", plan: StreamPlan) -> Struct:
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


def rules_of(model: "Model", plan: StreamPlan) -> Rules:
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


def _contact(part: "FingerModel") -> Struct:
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


def _numbers(part: "FingerModel", head: Head | None) -> tuple[Array, Array, list[int]]:
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
