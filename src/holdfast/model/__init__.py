"""Models: features, classifiers and decision rule of a hand, as plain validated data."""

from holdfast.model.model import ANY_FINGER, EXACT_RATE, RATE_TOLERANCE, RELATIVE_RATES, Model
from holdfast.model.parts import Debounce, FingerModel, Handling, ThresholdPoint, Training, Tuning

__all__ = [
    "ANY_FINGER",
    "EXACT_RATE",
    "RATE_TOLERANCE",
    "RELATIVE_RATES",
    "Debounce",
    "FingerModel",
    "Handling",
    "Model",
    "ThresholdPoint",
    "Training",
    "Tuning",
]
