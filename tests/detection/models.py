"""Models that together use every part of the kernel, and the hands that they are for."""

from msgspec.structs import replace

from detection.detector.build import RICH, SLIP_OWN, TAXELS, model
from holdfast.detection import DEPLOYED_FEATURES, FingerModel, Head, Linear, Model, parse_features
from holdfast.sensors import sensor

TIP, PATCH, NEWTON = sensor("uskin-curved"), sensor("uskin-4x4"), sensor("papillarray")
HAND = {"thumb": TIP, "index": TIP, "middle": TIP}


def paper(**options):
    """A model of the paper's features."""
    features = parse_features(DEPLOYED_FEATURES, 14)
    n = len(features)
    rule = Linear((5.0,) * n, (50.0,) * n, ((0.3, -0.1, 0.1, 0.2, -2.0),), (0.7,))
    stable = Head(name="stable", link="logit", features=features, rule=rule)
    finger = FingerModel(heads=(stable,), contact_threshold=20.0)
    return Model(fingers={"*": finger}, rate=150.0, **options)


def rich(**options):
    """A model of every feature, with heads of slips and their speed, for two fingers."""
    options = {"slips": ("thumb", "index"), "speeds": ("index",)} | options
    own = (*SLIP_OWN, *TAXELS)
    return model(features=RICH, which=PATCH, own=own, threshold=60.0, **options)


def built_in(name, **options):
    loaded = Model.load(f"builtin:{name}")
    return replace(loaded, **options)


MODELS = {
    "paper": (paper, HAND),
    "twin": (lambda: built_in("twin"), HAND),
    "any": (lambda: built_in("any"), HAND),
    "any-newton": (lambda: built_in("any"), {"left": NEWTON, "right": NEWTON}),
    "any-two-sensors": (lambda: built_in("any"), {"tip": TIP, "patch": PATCH}),
    "noise-floor": (lambda: built_in("noise-floor"), {"pad": PATCH}),
    "rich": (rich, {"thumb": PATCH, "index": PATCH}),
}
"""Function that makes each model, and the sensors of its hand."""


def made(name):
    """Return a model, its sensors and a rate at which it works."""
    make, sensors = MODELS[name]
    used = make()
    return used, sensors, used.rate or next(iter(sensors.values())).rate
