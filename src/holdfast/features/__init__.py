"""From readings to features: tare, fingertip force, Haar window, feature stream."""

from holdfast.features.force import fingertip_force
from holdfast.features.frame import features_frame
from holdfast.features.haar import DEFAULT_WINDOW, FEATURE_NAMES, haar_features
from holdfast.features.specs import DEPLOYED_FEATURES, FeatureSpec, parse_features
from holdfast.features.tare import Tare

__all__ = [
    "DEFAULT_WINDOW",
    "DEPLOYED_FEATURES",
    "FEATURE_NAMES",
    "FeatureSpec",
    "Tare",
    "features_frame",
    "fingertip_force",
    "haar_features",
    "parse_features",
]
