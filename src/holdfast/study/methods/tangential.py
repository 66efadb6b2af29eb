"""The relative change of the tangential force (Wong and Zhu 2026)."""

from collections.abc import Mapping

import numpy as np

from holdfast.classifiers import Threshold
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise

EPSILON = 0.011
"""The least force that a change is taken relative to [N]. Three times the noise of a component
of F_tip: 30 taxels of 0.9 counts each make 5 counts, and 15 counts are 0.011 N."""

SOURCE = (
    "Wong and Zhu, Frontiers in Robotics and AI, 10.3389/frobt.2026.1735467, 2026 (abstract only): "
    "|T_k - T_(k-1)| / max(T_(k-1), eps) above a threshold, per finger, T the tangential part of "
    "F_tip less the tare. Own choice: eps = 0.011 N (15 counts), three times the noise"
)


def relative_change(hand: HandSignal) -> Mapping[str, Array]:
    """|T_k - T_(k-1)| / max(T_(k-1), eps): (n, 1); the first sample of a stretch has none."""
    return stretchwise(hand, _of)


def _of(finger: FingerSignal) -> Array:
    now = finger.tangential
    before = np.concatenate([[np.nan], now])[: len(now)]
    least = EPSILON * finger.newton
    return np.asarray((np.abs(now - before) / np.maximum(before, least))[:, None])


TANGENTIAL = Method(
    "tangential",
    "Relative tangential change (Wong and Zhu 2026)",
    "differentiation",
    SOURCE,
    relative_change,
    Threshold("below"),
)
