"""The methods that the study compares, in one file for each family."""

from holdfast.study.methods.force_rules import DIFFERENCE, FRICTION, TANGENTIAL
from holdfast.study.methods.holdfast import HOLDFAST
from holdfast.study.methods.learning import ANYSKIN, JAMES_LEPORA, TCN
from holdfast.study.methods.method import (
    HAND,
    FingerSignal,
    HandSignal,
    Method,
    hand_signal,
    stretchwise,
)
from holdfast.study.methods.vibration import SLIP_SERVO, SPECTRUM
from holdfast.study.methods.wavelets import LOGREG, SVM, TREES, ZHANG

METHODS: dict[str, Method] = {
    each.name: each
    for each in (
        LOGREG,
        SVM,
        HOLDFAST,
        ZHANG,
        FRICTION,
        SLIP_SERVO,
        SPECTRUM,
        DIFFERENCE,
        TANGENTIAL,
        ANYSKIN,
        *JAMES_LEPORA,
        TCN,
        TREES,
    )
}
"""All methods by name, in the order of the tables."""

__all__ = [
    "HAND",
    "METHODS",
    "FingerSignal",
    "HandSignal",
    "Method",
    "hand_signal",
    "stretchwise",
]
