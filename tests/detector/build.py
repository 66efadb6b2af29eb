"""Small hands, models and recordings for the tests of detectors and models."""

import itertools

import numpy as np
from holdfast.classifiers.slip import SlipRule, SpeedRule
from msgspec.structs import replace

from holdfast.classifiers import LinearClassifier
from holdfast.features import FeatureSpec, parse_features
from holdfast.features.specs import MEAN_SECOND_KINDS, RATIO_KINDS, SECOND_KINDS
from holdfast.model import FingerModel, Model
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor

RATE = 100.0
RICH = (
    *parse_features("F_a,F_x,F_y,F_z,m,sigma", 6),
    FeatureSpec("sigma", 10, "noise"),
    FeatureSpec("sigma", 4, "log", "finger", 0.5),
    FeatureSpec("F_a", 0, "log", "hand", 1.0),
    FeatureSpec("sigma", 8, "none", "hand"),
    FeatureSpec("sigma_xyz", 4, "log", "finger", 0.5),
    FeatureSpec("sigma_xyz", 12, "none", "hand"),
    FeatureSpec("change", 8, "log", "hand", 0.5),
    FeatureSpec("change", 4),
    FeatureSpec("change", 8, "log", "finger", 0.5),
)
"""Every kind, transform and scope, over several windows."""


def sensor(n_taxels=2, name="tiny", rate=RATE, limits=(0.0, 1000.0), unit="count"):
    turns, _ = np.linalg.qr(np.random.default_rng(n_taxels).normal(size=(n_taxels, 3, 3)))
    turns *= np.linalg.det(turns)[:, None, None]
    places = np.arange(3.0 * n_taxels).reshape(-1, 3)
    return Sensor(name, places, turns, np.array([0.0, 0.0, 1.0]), rate, unit, limits)


def classifier(n_features, seed=0, **options):
    rng = np.random.default_rng(seed)
    options.setdefault("intercept", 0.3)
    return LinearClassifier(
        mean=tuple(rng.normal(size=n_features).tolist()),
        scale=tuple(rng.uniform(20, 80, size=n_features).tolist()),
        coefficients=tuple(rng.normal(size=n_features).tolist()),
        **options,
    )


def finger_model(features=None, seed=0, **options):
    features = parse_features("F_a,F_x,F_y,F_z,sigma", 6) if features is None else features
    options.setdefault("classifier", classifier(len(features), seed))
    return FingerModel(features=features, **options)


SLIP_OWN = (
    FeatureSpec("change", 12, "log", "finger", 0.5),
    FeatureSpec("F_x"),
    FeatureSpec("sigma_xyz", 4, "log", "hand", 0.5),
)
"""Features of a slip rule; the second is one of the classifier of stability, too."""
TAXELS = tuple(
    FeatureSpec(kind, transform="relative", seconds=0.02)
    for kind in (*SECOND_KINDS, *MEAN_SECOND_KINDS, *RATIO_KINDS)
)
"""Features of a slip rule that need the taxels."""


def slip_rule(n_features, seed=0, smoothing=0.02, hold=0.05):
    return SlipRule(classifier(n_features, 90 + seed), smoothing, hold)


def squared_rule(features, seed=0, scale=20.0):
    """Return a slip rule with features of its own and squares."""
    rng = np.random.default_rng([seed, 7])
    linear = classifier(len(features), 90 + seed)
    linear = replace(linear, scale=tuple(scale / value for value in linear.scale), slope=0.4)
    squares = tuple((0.2 * rng.normal(size=len(features))).tolist())
    return SlipRule(linear, 0.02, 0.05, features=tuple(features), squares=squares)


def speed_rule(linear, seed=0):
    """Return a speed rule for the features of a classifier; some samples reach its highest."""
    rng = np.random.default_rng([seed, 11])
    squares = tuple((0.1 * rng.normal(size=len(linear.mean))).tolist())
    return SpeedRule(linear.mean, linear.scale, linear.coefficients, squares, 1.5, 3.0)


def with_speed(rule):
    """Return a slip rule that estimates the speed, too."""
    return replace(rule, speed=speed_rule(rule.classifier))


def model(
    fingers=("thumb", "index"),
    features=None,
    which=None,
    threshold=None,
    slips=(),
    own=(),
    speeds=(),
    **options,
):
    """Return a model; the fingers in `slips` have a slip rule, with own features if given.

    Those in `speeds` have a speed rule, too.
    """
    which = sensor() if which is None else which
    n_features = 5 if features is None else len(features)
    rule = (lambda _, seed: squared_rule(own, seed)) if own else slip_rule
    parts = {
        name: finger_model(
            features, seed, sensor=which.name, contact_threshold=threshold,
            slip=rule(n_features, seed) if name in slips else None,
        )
        for seed, name in enumerate(fingers)
    }  # fmt: skip
    for name in speeds:
        parts[name] = replace(parts[name], slip=with_speed(parts[name].slip))
    options = {"rate": which.rate, "window": 6, "tare": "0.2"} | options
    return Model(fingers=parts, sensors={which.name: which}, **options)


def tactile(n=200, seed=0, which=None, start=0.0, rate=None, times=None):
    """Readings in the middle of the range that wander, in whole counts."""
    which = sensor() if which is None else which
    rng = np.random.default_rng(seed)
    steps = rng.normal(scale=4, size=(n, which.n_taxels, 3)).cumsum(axis=0)
    values = np.rint(np.clip(500 + steps + rng.normal(scale=3, size=steps.shape), 100, 900))
    times = start + np.arange(n) / (rate or which.rate) if times is None else times
    return Tactile(which, times, values)


def broken(module):
    """Return the module with a NaN, a gap and a frozen stretch."""
    values = np.array(module.readings)
    values[90, 0, 0] = np.nan
    values[120:180] = values[120]
    kept = np.ones(len(values), dtype=bool)
    kept[70:80] = False
    return type(module)(module.sensor, module.times[kept], values[kept])


def recording(**modules):
    return Recording("made", modules)


def feed(detector, values, finger="thumb", start=0.0):
    return [
        detector.update({finger: sample}, start + k / RATE).fingers[finger]
        for k, sample in enumerate(values)
    ]


def lively(n=200, seed=0):
    return np.array(tactile(n, seed).readings)


def runs(estimates, key):
    return [(value, len(list(group))) for value, group in itertools.groupby(map(key, estimates))]
