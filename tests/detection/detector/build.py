"""Small hands, models and recordings for the tests of detectors and models."""

import itertools

import numpy as np
from msgspec.structs import replace

from holdfast.contact import Cause
from holdfast.detection import FeatureSpec, FingerModel, Head, Linear, Model, parse_features
from holdfast.detection.specs import kinds_of
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


def sensor(n_taxels=2, name="tiny", rate=RATE, limits=(0.0, 1000.0), unit="count", magnetic=False):
    turns, _ = np.linalg.qr(np.random.default_rng(n_taxels).normal(size=(n_taxels, 3, 3)))
    turns *= np.linalg.det(turns)[:, None, None]
    places = np.arange(3.0 * n_taxels).reshape(-1, 3)
    return Sensor(name, places, turns, np.array([0.0, 0.0, 1.0]), rate, unit, limits, magnetic)


def linear(n_features, seed=0, **options):
    """Return a linear rule of one output."""
    rng = np.random.default_rng(seed)
    fields = {
        "mean": rng.normal(size=n_features),
        "scale": rng.uniform(20, 80, size=n_features),
        "weights": rng.normal(size=n_features),
        "intercepts": 0.3,
    }
    return Linear.of(**(fields | options))


def z_of(rule, features):
    """Return z of each row of features by the first output of a rule, with its squares."""
    offset, *weights = rule.raw_weights()[0]
    mean, inverse, squares = rule.raw_squares()
    deviations = np.minimum(np.abs((features - mean) * inverse), 5.0)
    return offset + features @ weights + deviations**2 @ squares


def stable_head(features=None, seed=0, rule=None, threshold=0.5):
    features = parse_features("F_a,F_x,F_y,F_z,sigma", 6) if features is None else features
    rule = linear(len(features), seed) if rule is None else rule
    return Head(name="stable", link="logit", features=features, rule=rule, threshold=threshold)


def finger_model(features=None, seed=0, *heads, rule=None, threshold=0.5, **options):
    """Return a model of one finger: a head of stability, and others that are given."""
    stable = stable_head(features, seed, rule, threshold)
    return FingerModel(heads=(stable, *heads), **options)


SLIP_OWN = (
    FeatureSpec("change", 12, "log", "finger", 0.5),
    FeatureSpec("F_x"),
    FeatureSpec("sigma_xyz", 4, "log", "hand", 0.5),
)
"""Features of a head of slips; the second is one of the head of stability, too."""
TAXELS = tuple(
    FeatureSpec(kind, transform="relative", seconds=0.02) for kind in kinds_of("sliding")
)
"""Features of a head of slips that need the taxels."""


def slip_head(features, seed=0, **fields):
    fields = {"rule": linear(len(features), 90 + seed), "smoothing": 0.02, "hold": 0.05} | fields
    return Head(name="slip", link="logit", features=tuple(features), **fields)


def squared_head(features, seed=0, scale=20.0):
    """Return a head of slips with squares."""
    rng = np.random.default_rng([seed, 7])
    rule = linear(len(features), 90 + seed)
    scales = tuple(scale / value for value in rule.scale)
    squares = tuple((0.2 * rng.normal(size=len(features))).tolist())
    rule = replace(rule, scale=scales, slope=0.4, squares=(squares,))
    return slip_head(features, rule=rule)


def speed_head(slip, seed=0):
    """Return a head of the speed for the features of a slip; some samples reach its highest."""
    rng = np.random.default_rng([seed, 11])
    squares = tuple((0.1 * rng.normal(size=slip.rule.n_features)).tolist())
    rule = replace(slip.rule, squares=(squares,), intercepts=(1.5,), slope=1.0)
    return Head(name="slip_speed", link="square", features=slip.features, rule=rule, highest=3.0)


def cause_head(features, seed=3, classes=(Cause.CLOSING, Cause.GLITCH)):
    rng, n = np.random.default_rng(seed), len(features)
    rule = Linear.of(
        rng.normal(size=n),
        rng.uniform(1, 3, size=n),
        rng.normal(size=(len(classes), n)),
        np.linspace(0.1, -0.2, len(classes)),
    )
    return Head(name="cause", link="softmax", features=tuple(features), rule=rule, classes=classes)


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
    """Return a model; the fingers in `slips` have a head of slips, with own features if given.

    Those in `speeds` have one of the speed, too.
    """
    which = sensor() if which is None else which
    parts = {}
    for seed, name in enumerate(fingers):
        part = finger_model(features, seed, sensor=which.name, contact_threshold=threshold)
        if name in slips:
            slip = squared_head(own, seed) if own else slip_head(part.features, seed)
            part = part.with_heads(slip)
        if name in speeds:
            part = part.with_heads(speed_head(part.slip))
        parts[name] = part
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
