"""Detection: from samples to estimates. Features, model, detector, and the C header of a model."""

from holdfast.detection.detector import HAND, Detector, detect
from holdfast.detection.features import (
    FEATURE_NAMES,
    features_frame,
    fingertip_force,
    haar_features,
)
from holdfast.detection.heads import (
    Choice,
    Debounce,
    FingerModel,
    Handling,
    Head,
    HeadName,
    Linear,
    ThresholdPoint,
)
from holdfast.detection.model import (
    ANY_FINGER,
    EXACT_RATE,
    RELATIVE_RATES,
    Model,
    Training,
)
from holdfast.detection.plan import Tare
from holdfast.detection.specs import DEFAULT_WINDOW, DEPLOYED_FEATURES, FeatureSpec, parse_features
from holdfast.detection.traces import Detection, FingerTrace

__all__ = [
    "ANY_FINGER",
    "DEFAULT_WINDOW",
    "DEPLOYED_FEATURES",
    "EXACT_RATE",
    "FEATURE_NAMES",
    "HAND",
    "RELATIVE_RATES",
    "Choice",
    "Debounce",
    "Detection",
    "Detector",
    "FeatureSpec",
    "FingerModel",
    "FingerTrace",
    "Handling",
    "Head",
    "HeadName",
    "Linear",
    "Model",
    "Tare",
    "ThresholdPoint",
    "Training",
    "detect",
    "features_frame",
    "fingertip_force",
    "haar_features",
    "parse_features",
]
