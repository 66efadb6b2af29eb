"""Methods on the fingertip force itself: friction margin, tangential change, force difference."""

from collections.abc import Mapping

import numpy as np

from holdfast.classifiers import recipe
from holdfast.sensors.types import Array
from holdfast_lab.classifiers.threshold import Threshold
from holdfast_lab.study.methods.method import FingerSignal, HandSignal, Method, stretchwise

FRICTION_SOURCE = (
    "Coulomb's law, as in Melchiorri 2000 without his torsion (his elliptic limit surface from "
    "memory, not checked): stable where mu F_n - F_t > m_0. Logistic regression on (F_n, F_t) is "
    "this line, with mu and m_0 by fit; the margin, not the ratio F_t / F_n, since the ratio is "
    "noise without contact"
)
TANGENTIAL_SOURCE = (
    "Wong and Zhu, Frontiers in Robotics and AI, 10.3389/frobt.2026.1735467, 2026 (abstract only): "
    "|T_k - T_(k-1)| / max(T_(k-1), eps) above a threshold, per finger, T the tangential part of "
    "F_tip less the tare. Own choice: eps = 0.011 N (15 counts), three times the noise; the "
    "threshold is found on the training set; a finger is engaged by the contact threshold on F_a "
    "that all methods share (there by a threshold on the normal force)"
)
DIFFERENCE_SOURCE = (
    "the derivative of the force against a threshold, as in Osborn 2013, Lee 2018 and Feng 2019 "
    "(from memory, not checked): |F_k - F_(k-1)| x rate, of the vector F_tip"
)

MIN_TANGENTIAL_FORCE = 0.011
"""eps, the smallest force that a change is divided by [N].

Three times the noise of a component of F_tip: 30 taxels of 0.9 counts each make 5 counts, and
15 counts are 0.011 N.
"""


def normal_and_tangential(hand: HandSignal) -> Mapping[str, Array]:
    """Return |F_n| and |F_t| of every finger, (n, 2).

    A linear classifier of them, w_0 + w_n F_n + w_t F_t >= 0, is the Coulomb margin
    mu F_n - F_t >= m_0 with mu = -w_n / w_t and m_0 = w_0 / w_t.
    """
    return stretchwise(
        hand, lambda f: np.column_stack([f.normal_magnitude, f.tangential_magnitude])
    )


def tangential_change(hand: HandSignal) -> Mapping[str, Array]:
    """Return |T_k - T_(k-1)| / max(T_(k-1), eps), (n, 1); NaN at the start of a stretch."""

    def of_stretch(finger: FingerSignal) -> Array:
        now = finger.tangential_magnitude
        # Cut, so that an empty stretch stays empty.
        before = np.concatenate([[np.nan], now])[: len(now)]
        smallest = MIN_TANGENTIAL_FORCE * finger.units_per_newton
        return np.asarray((np.abs(now - before) / np.maximum(before, smallest))[:, None])

    return stretchwise(hand, of_stretch)


def force_rate(hand: HandSignal) -> Mapping[str, Array]:
    """Return |F_k - F_(k-1)| x rate [count/s or N/s], (n, 1); NaN at the start of a stretch."""

    def of_stretch(finger: FingerSignal) -> Array:
        steps = np.diff(finger.force, axis=0, prepend=np.full((1, 3), np.nan))
        return np.asarray(np.linalg.norm(steps, axis=1, keepdims=True) * finger.rate)

    return stretchwise(hand, of_stretch)


FRICTION_METHOD = Method(
    "friction",
    "Coulomb friction margin",
    "friction",
    FRICTION_SOURCE,
    normal_and_tangential,
    recipe("logreg"),
)
TANGENTIAL = Method(
    "tangential",
    "Relative tangential change (Wong and Zhu 2026)",
    "differentiation",
    TANGENTIAL_SOURCE,
    tangential_change,
    Threshold("below"),
)
DIFFERENCE = Method(
    "difference",
    "Force difference",
    "differentiation",
    DIFFERENCE_SOURCE,
    force_rate,
    Threshold("below"),
)
