"""Coulomb friction: how far the tangential force is from what the normal force can hold."""

from collections.abc import Mapping

import numpy as np

from holdfast.classifiers import recipe
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise

SOURCE = (
    "Coulomb's law, as in Melchiorri 2000 without his torsion (his elliptic limit surface from "
    "memory, not checked): stable where mu F_n - F_t > m_0. Logistic regression on (F_n, F_t) is "
    "this line, with mu and m_0 by fit; the margin, not the ratio F_t / F_n, since the ratio is "
    "noise where nothing is touched"
)


def normal_and_tangential(hand: HandSignal) -> Mapping[str, Array]:
    """|F_n| and |F_t| of every finger: (n, 2).

    A linear classifier of them, w_0 + w_n F_n + w_t F_t >= 0, is the Coulomb margin
    mu F_n - F_t >= m_0 with mu = -w_n / w_t and m_0 = w_0 / w_t.
    """
    return stretchwise(hand, _of)


def _of(finger: FingerSignal) -> Array:
    return np.column_stack([finger.normal, finger.tangential])


FRICTION = Method(
    "friction",
    "Coulomb friction margin",
    "friction",
    SOURCE,
    normal_and_tangential,
    recipe("logreg"),
)
