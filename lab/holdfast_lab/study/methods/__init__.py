"""The methods that the study compares, in one file for each family."""

from holdfast_lab.study.methods.force_rules import (
    DIFFERENCE,
    FRICTION_METHOD,
    SLIP_SERVO,
    SPECTRUM,
    TANGENTIAL,
)
from holdfast_lab.study.methods.holdfast import HOLDFAST, ONE_FINGER
from holdfast_lab.study.methods.learning import ANYSKIN, JAMES_LEPORA
from holdfast_lab.study.methods.method import (
    HAND,
    FingerSignal,
    HandSignal,
    Method,
    hand_signal,
    stretchwise,
)
from holdfast_lab.study.methods.untrained import ALWAYS_STABLE, NOISE_FLOOR
from holdfast_lab.study.methods.wavelets import (
    ENERGY,
    LOG_HAND,
    LOG_TWO,
    LOGREG,
    LOGREG_UNWEIGHTED,
    SVM,
    SVM_UNWEIGHTED,
    TREES,
    ZHANG,
)

METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        LOGREG,
        LOGREG_UNWEIGHTED,
        SVM,
        SVM_UNWEIGHTED,
        LOG_TWO,
        LOG_HAND,
        ENERGY,
        HOLDFAST,
        *ONE_FINGER,
        ZHANG,
        FRICTION_METHOD,
        SLIP_SERVO,
        SPECTRUM,
        DIFFERENCE,
        TANGENTIAL,
        ANYSKIN,
        *JAMES_LEPORA,
        TREES,
        NOISE_FLOOR,
        ALWAYS_STABLE,
    )
}
"""All methods by name, in the order of the tables."""

RIVALS = tuple(name for name, method in METHODS.items() if method.category != "holdfast")
"""Names of the methods that are not ours."""
PAPER_FAMILY = tuple(name for name, method in METHODS.items() if method.category == "paper")
"""Names of the paper's method and of its variants. Ours is compared with the best of them."""

__all__ = [
    "HAND",
    "METHODS",
    "PAPER_FAMILY",
    "RIVALS",
    "FingerSignal",
    "HandSignal",
    "Method",
    "hand_signal",
    "stretchwise",
]
