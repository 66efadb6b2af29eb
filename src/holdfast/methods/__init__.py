"""Ways of judging contacts that the study compares; one file each."""

from holdfast.methods.anyskin import ANYSKIN
from holdfast.methods.difference import DIFFERENCE
from holdfast.methods.friction import FRICTION
from holdfast.methods.grover import TCN
from holdfast.methods.holdfast import HOLDFAST
from holdfast.methods.james_lepora import JAMES_LEPORA
from holdfast.methods.method import HAND, Method
from holdfast.methods.paper import LOGREG, SVM
from holdfast.methods.signals import FingerSignal, HandSignal, signal_of, stretchwise
from holdfast.methods.slip_servo import SLIP_SERVO
from holdfast.methods.spectrum import SPECTRUM
from holdfast.methods.tangential import TANGENTIAL
from holdfast.methods.trees import TREES
from holdfast.methods.zhang import ZHANG

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

__all__ = [
    "HAND",
    "METHODS",
    "FingerSignal",
    "HandSignal",
    "Method",
    "signal_of",
    "stretchwise",
]
