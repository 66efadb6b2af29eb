"""The tables of a feature stream, by the names of the C structs in `kernel/kernel.h`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from holdfast.contact import MAX_TAXELS
from holdfast.errors import ModelError
from holdfast.features.haar import n_levels
from holdfast.features.specs import (
    KINDS,
    SCOPES,
    TRANSFORMS,
    FeatureSpec,
)
from holdfast.features.start import OPEN_HAND, Start
from holdfast.features.tare import Tare
from holdfast.kernel import _extension
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Flags

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


@dataclass(frozen=True)
class StreamPlan:
    """Fingers, features, tare and rate of a feature stream.

    Attributes:
        sensors: sensor of each finger, in the order of the arrays.
        features: features of each finger.
        window: N_w of the sigma that is reported [samples].
        tare: how the baseline is found.
        rate: samples per second [Hz].
        ignore: indices by finger, from 0, of taxels that contribute nothing and cause no fault.
        start: with an open hand, or in contact.

    Raises:
        ModelError: a sensor has more than `MAX_TAXELS`.
    """

    sensors: Mapping[str, Sensor]
    features: Mapping[str, Sequence[FeatureSpec]]
    window: int
    tare: Tare
    rate: float
    ignore: Mapping[str, Sequence[int]] = field(default_factory=dict)
    start: Start = OPEN_HAND

    def __post_init__(self) -> None:
        for name, sensor in self.sensors.items():
            if sensor.n_taxels > MAX_TAXELS:
                raise ModelError(
                    f"{name}: a sensor of {sensor.n_taxels} taxels given ({sensor.name}); "
                    f"at most {MAX_TAXELS} expected"
                )

    @property
    def used_tare(self) -> Tare:
        """The tare, or what takes its place in a stream that begins in contact."""
        return self.start.used_tare(self.tare, self.sensors)

    @property
    def fingers(self) -> tuple[str, ...]:
        """Names of the fingers, in the order of the arrays."""
        return tuple(self.sensors)

    @property
    def zero_unknown(self) -> bool:
        """Whether the stream begins in contact, and no readings without contact are known."""
        return self.start.loaded and self.used_tare.kind == "first"

    @property
    def width(self) -> int:
        """Number of features of the finger that has most; at least 1."""
        return max(1, *(len(specs) for specs in self.features.values()))

    def used(self, finger: str) -> Flags:
        """Return (n_taxels,) True for each taxel that is not ignored."""
        flags = np.ones(self.sensors[finger].n_taxels, dtype=np.bool_)
        flags[list(self.ignore.get(finger, ()))] = False
        return flags


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
