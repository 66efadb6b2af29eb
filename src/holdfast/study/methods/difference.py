"""How fast the force changes."""

from collections.abc import Mapping

import numpy as np

from holdfast.classifiers import Threshold
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise

SOURCE = (
    "the derivative of the force against a threshold, as in Osborn 2013, Lee 2018 and Feng 2019 "
    "(from memory, not checked): |F_k - F_(k-1)| x rate, of the vector F_tip"
)


def force_rate(hand: HandSignal) -> Mapping[str, Array]:
    """|F_k - F_(k-1)| x rate [count/s or N/s]: (n, 1); the first of a stretch has none."""
    return stretchwise(hand, _of)


def _of(finger: FingerSignal) -> Array:
    steps = np.diff(finger.force, axis=0, prepend=np.full((1, 3), np.nan))[: len(finger.force)]
    return np.asarray(np.linalg.norm(steps, axis=1, keepdims=True) * finger.rate)


DIFFERENCE = Method(
    "difference", "Force difference", "differentiation", SOURCE, force_rate, Threshold("below")
)
