"""Constants of the C kernel, as arrays of its structs, from a plan and a model."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from holdfast.contact import CAUSES, SLIP_CODE
from holdfast.detection.heads import KERNEL_HEADS, Debounce, FingerModel, Head
from holdfast.detection.plan import StreamPlan
from holdfast.detection.specs import KINDS, SCOPES, TRANSFORMS, FeatureSpec, kinds_of
from holdfast.kernel import _extension
from holdfast.kernel.structs import Structs, structs
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Flags

Row = dict[str, Any]
"""Values of a struct, by the names of its fields in `kernel/holdfast.h`."""

TARE_KINDS = ("seconds", "first", "none", "interval")
"""Kinds of tare. The code of a kind is its position."""
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
RING_SPARE = 2
"""Samples that the history of relative features holds, as a multiple of those of its longest lag:
for bursts, and for a rate that rises."""


class StreamConfig(NamedTuple):
    """Constants of a feature stream.

    Attributes:
        hand: (1,) of `holdfast_hand`.
        fingers: (n_fingers,) of `holdfast_finger`.
        features: (n_fingers * n_features,) of `holdfast_feature`.
        lags: (n_lags,) of `holdfast_lag`.
        used: (n_lanes,) 1 for each taxel that contributes, else 0.
        rotations: (9 n_lanes,) from the taxel frames to the fingertip frame.
        positions: (3 n_lanes,) of the taxels about their centroid, in radii of the patch.
    """

    hand: Structs
    fingers: Structs
    features: Structs
    lags: Structs
    used: Array
    rotations: Array
    positions: Array


class ModelConfig(NamedTuple):
    """Constants of a model, for the fingers of a plan.

    Attributes:
        model: (1,) of `holdfast_model`.
        rules: (n_fingers,) of `holdfast_rule`.
        weights: numbers of all heads.
    """

    model: Structs
    rules: Structs
    weights: Array


def packed(config: StreamConfig | ModelConfig) -> tuple[bytes, ...]:
    """Return the constants as the extension takes them: bytes, which nothing can change."""
    return tuple(array.tobytes() for array in config)


def stream_config(plan: StreamPlan) -> StreamConfig:
    """Return the constants of a stream."""
    features = [plan.features[finger] for finger in plan.fingers]
    seconds = sorted({spec.seconds for specs in features for spec in specs if spec.seconds})
    lags = [_lag(lag, plan.rate, [s for specs in features for s in specs]) for lag in seconds]
    used = [plan.used(finger) for finger in plan.fingers]
    # Fingers begin at whole vectors of the processor, so that its loops need no remainder.
    n_lanes = [-(-len(flags) // _extension.LANES) * _extension.LANES for flags in used]
    sensors = plan.sensors.values()
    first_taxels = [taxels.start for taxels in plan.slices.values()]
    fingers = [
        _finger(sensor, int(flags.sum()), plan, specs)
        | {"first_taxel": first_taxel, "n_taxels": len(flags), "first": sum(n_lanes[:f])}
        for f, (sensor, flags, specs, first_taxel) in enumerate(
            zip(sensors, used, features, first_taxels, strict=True)
        )
    ]
    taxels = list(zip(sensors, used, n_lanes, strict=True))
    return StreamConfig(
        structs("holdfast_hand", [_hand(plan, features, lags) | {"n_lanes": sum(n_lanes)}]),
        structs("holdfast_finger", fingers),
        structs("holdfast_feature", [
            row for specs in features for row in _features(specs, plan.width, seconds)
        ]),
        structs("holdfast_lag", lags),
        np.concatenate([_in_lanes(flags.astype(np.float64), n) for _, flags, n in taxels]),
        np.concatenate(
            # A rotation of 0 takes an ignored taxel out of all sums without a branch.
            [_in_lanes(np.where(u[:, None, None], s.rotations, 0), n) for s, u, n in taxels]
        ),
        np.concatenate([_in_lanes(_positions(s, u), n) for s, u, n in taxels]),
    )  # fmt: skip


def n_levels(window: int) -> int:
    """Return the number of sizes of blocks in windows up to this one."""
    return (window // 2).bit_length()


def _hand(plan: StreamPlan, features: Sequence[Sequence[FeatureSpec]], lags: Sequence[Row]) -> Row:
    tare, specs = plan.used_tare, [spec for x in features for spec in x]
    n_history = max([plan.window, *(spec.window for spec in specs)])
    # The stretch of the tare shows the noise too, as nothing touches; where the tare takes no
    # time, the first samples after it do. Under load the hand may move soon, so less is taken.
    noise_seconds = plan.tare.seconds if plan.tare.kind == "seconds" else NOISE_SECONDS
    if plan.start.loaded:
        noise_seconds = LOADED_NOISE_SECONDS
    samples = {lag["seconds"]: lag["samples"] for lag in lags}
    reach = max((samples[s.seconds] * KINDS[s.kind].reach for s in specs if s.seconds), default=0)
    n_track = max(RING_SPARE * reach + 1, 3 if lags else 1)
    return {
        "n_fingers": len(features),
        "n_features": plan.width,
        "n_lags": len(lags),
        "n_history": n_history,
        "n_channels": _extension.N_COMPONENTS
        if any(KINDS[spec.kind].of_components for spec in specs)
        else 1,
        "n_levels": n_levels(n_history),
        "n_track": n_track,
        "n_slides": n_track if any(lag["sliding"] for lag in lags) else 0,
        "period": 1.0 / plan.rate,
        "tare_kind": TARE_KINDS.index(tare.kind),
        "tare_seconds": tare.seconds,
        "noise_seconds": noise_seconds,
        "alike": len({tuple(x) for x in features}) == 1,
        "has_centres": any(lag["has_changes"] for lag in lags),
        "zero_unknown": plan.zero_unknown,
    }


def _finger(sensor: Sensor, n_used: int, plan: StreamPlan, specs: Sequence[FeatureSpec]) -> Row:
    """Return the constants of a finger; each used taxel rounds its readings."""
    # Without a range nothing is near its end, and the mean of the readings may change at will.
    low, high = sensor.range or (-np.inf, np.inf)
    end = END_SHARE * (high - low) if sensor.range else 0.0
    noise = COUNT_NOISE if sensor.unit == "count" else NEWTON_NOISE
    # Haar windows count samples, which a gap breaks; lags in seconds bridge a short one by time. So
    # a finger bridges gaps only if all its features are over lags, and is ready after two samples.
    in_seconds = all(spec.seconds for spec in specs)
    bridges, gap = in_seconds and bool(specs), _extension.GAP_LIMIT_PERIODS / plan.rate
    return {
        "n_used": float(n_used),
        "low": low,
        "high": high,
        "low_end": low + end,
        "high_end": high - end,
        "max_offset": OFFSET_SHARE * (high - low) * n_used * SUM_OF_WEIGHTS,
        "min_noise": float(noise * np.sqrt(n_used)),
        "step": sensor.step or (1.0 if sensor.unit == "count" else np.nan),
        "step_noise": noise if sensor.step is None else sensor.step * COUNT_NOISE,
        "is_magnetic": bool(sensor.magnetic),
        "rests_at_zero": bool(sensor.rests_at_zero),
        # The load of the start, when it goes, may look like a field.
        "max_field": MAX_EARTH_FIELDS.get(sensor.name, np.inf)
        if sensor.magnetic and not plan.zero_unknown
        else 0.0,
        "max_step": max(gap, _extension.MAX_BRIDGED_SECONDS) if bridges else gap,
        "normal": sensor.normal,
        "sigma_window": plan.window,
        "ready_window": 2 if in_seconds else max([plan.window, *(s.window for s in specs)]),
        "bridges": bridges,
    }


def _features(specs: Sequence[FeatureSpec], width: int, seconds: Sequence[float]) -> list[Row]:
    """Return the features of a finger, padded to the largest number of features of a finger."""
    # Scope is left out: `hand` takes the largest of values that each finger has computed anyway.
    keys = [(spec.kind, spec.window, spec.transform, spec.floor, spec.seconds) for spec in specs]
    padding: Row = {
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
            "same_as": keys.index(alike),
            "floor": spec.floor,
        }
        for spec, alike in zip(specs, keys, strict=True)
    ] + [padding] * (width - len(specs))


def _lag(seconds: float, rate: float, specs: Sequence[FeatureSpec]) -> Row:
    kinds = {spec.kind for spec in specs if spec.seconds == seconds}
    families = {KINDS[kind].family for kind in kinds}
    return {
        "samples": max(1, round(seconds * rate)),
        "seconds": seconds,
        "has_changes": not families.isdisjoint(("change", "load")),
        "sliding": sum(1 << i for i, kind in enumerate(kinds_of("sliding")) if kind in kinds),
    }


def _positions(sensor: Sensor, used: Flags) -> Array:
    """Return the taxels' positions about their centroid, in root mean square distances from it."""
    if not used.any():
        return np.zeros_like(sensor.positions)
    positions = sensor.positions - sensor.positions[used].mean(axis=0)
    radius = float(np.sqrt((positions[used] ** 2).sum(axis=1).mean()))
    return positions / radius if radius > 0 else np.zeros_like(positions)


def _in_lanes(values: Array, n_lanes: int) -> Array:
    """Return values of the taxels of a finger (n_taxels, ...) in lanes: (..., n_lanes)."""
    rows = values.reshape(len(values), -1).T
    return np.pad(rows, ((0, 0), (0, n_lanes - rows.shape[1]))).ravel()


def model_config(
    parts: Sequence[FingerModel], debounce: Debounce, n_model_fingers: int, plan: StreamPlan
) -> ModelConfig:
    """Return the constants of a model.

    Args:
        parts: model of each finger of the plan.
        debounce: of the model.
        n_model_fingers: number of fingers on which the state of the hand depends.
        plan: of the stream.
    """
    heads: list[Row] = []
    numbers = [np.empty(0)]
    for part in parts:
        for name in KERNEL_HEADS:
            head = part.deciding(name, zero_unknown=plan.zero_unknown)
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
    weights = np.concatenate(numbers)
    settings = {
        "n_weights": len(weights),
        "n_model_fingers": n_model_fingers,
        "hysteresis": debounce.hysteresis,
        "min_duration": debounce.min_duration,
        "hold": debounce.hold,
        "has_filter": debounce.switching_rate > 0,
        "switching": debounce.switching_rate,
    }
    by_finger = structs("holdfast_head", heads).reshape(len(parts), len(KERNEL_HEADS))
    rules = [
        _contact(part) | {"heads": of_finger}
        for part, of_finger in zip(parts, by_finger, strict=True)
    ]
    return ModelConfig(
        structs("holdfast_model", [settings]), structs("holdfast_rule", rules), weights
    )


def stable_thresholds(rules: Structs) -> list[float]:
    """Return the threshold of stability of each finger."""
    thresholds: list[float] = rules["heads"][:, KERNEL_HEADS.index("stable")]["threshold"].tolist()
    return thresholds


def with_thresholds(rules: Structs, thresholds: Mapping[int, float]) -> Structs:
    """Return the rules with other thresholds of stability, by the index of the finger."""
    changed = rules.copy()
    for finger, threshold in thresholds.items():
        changed["heads"][finger, KERNEL_HEADS.index("stable")]["threshold"] = threshold
    return changed


def _contact(part: FingerModel) -> Row:
    # In this order: a model of relative features has a limit by load; and a limit in the unit of
    # the readings, which was measured, is better than a multiple of the noise.
    for kind, limit in (
        (_extension.CONTACT_BY_LOAD, part.contact_load),
        (_extension.CONTACT_BY_FORCE, part.contact_threshold),
        (_extension.CONTACT_BY_NOISE, part.contact_noise),
    ):
        if limit is not None:
            return {"contact": kind, "contact_limit": limit}
    return {"contact": _extension.ALWAYS_CONTACT, "contact_limit": 0.0}


def _numbers(part: FingerModel, head: Head | None) -> tuple[Array, Array, list[int]]:
    """Return the weights (n_outputs, 1 + n) of the first n features, those of squares, and causes.

    A slip is no likely cause where a head decides about slips.
    """
    if head is None:
        return np.zeros((0, 1)), np.zeros((0, 0)), []
    columns = part.indices(head)
    # A head reads the features up to the last that it uses; slip heads read all.
    is_slip = head.name in ("slip", "slip_speed", "slip_changes")
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
