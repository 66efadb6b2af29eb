"""Models: heads, rule of contact and debouncing of a hand, as plain validated data."""

from holdfast.model.heads import Choice, Head, HeadName, ThresholdPoint
from holdfast.model.model import ANY_FINGER, EXACT_RATE, RELATIVE_RATES, Model
from holdfast.model.parts import Debounce, FingerModel, Handling, Training

__all__ = [
    "ANY_FINGER",
    "EXACT_RATE",
    "RELATIVE_RATES",
    "Choice",
    "Debounce",
    "FingerModel",
    "Handling",
    "Head",
    "HeadName",
    "Model",
    "ThresholdPoint",
    "Training",
]
