"""Ways of judging contacts that the study compares; one file each."""

from holdfast.methods.method import HAND, Method
from holdfast.methods.paper import LOGREG, SVM
from holdfast.methods.signals import FingerSignal, HandSignal, signal_of, stretchwise

METHODS: dict[str, Method] = {each.name: each for each in (LOGREG, SVM)}

__all__ = [
    "HAND",
    "METHODS",
    "FingerSignal",
    "HandSignal",
    "Method",
    "signal_of",
    "stretchwise",
]
