"""Ways of judging contacts that the study compares; one file each."""

from holdfast.study.methods.anyskin import ANYSKIN
from holdfast.study.methods.difference import DIFFERENCE
from holdfast.study.methods.friction import FRICTION
from holdfast.study.methods.grover import TCN
from holdfast.study.methods.holdfast import HOLDFAST
from holdfast.study.methods.james_lepora import JAMES_LEPORA
from holdfast.study.methods.method import HAND, Method
from holdfast.study.methods.paper import LOGREG, SVM
from holdfast.study.methods.signals import FingerSignal, HandSignal, hand_signal, stretchwise
from holdfast.study.methods.slip_servo import SLIP_SERVO
from holdfast.study.methods.spectrum import SPECTRUM
from holdfast.study.methods.tangential import TANGENTIAL
from holdfast.study.methods.trees import TREES
from holdfast.study.methods.wavelets import ZHANG

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
    "hand_signal",
    "stretchwise",
]
