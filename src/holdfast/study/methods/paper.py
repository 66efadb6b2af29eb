"""The paper's own method: force, and the standard deviation of its Haar details."""

from collections.abc import Mapping, Sequence

import numpy as np

from holdfast.classifiers import recipe
from holdfast.features import DEPLOYED_FEATURES, FEATURE_NAMES, haar_features
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise

WINDOW = 14
SOURCE = "Kitouni, Khoramshahi and Perdereau: the deployed features, without m, at N_w = 14"


def haar(
    hand: HandSignal, names: Sequence[str] = DEPLOYED_FEATURES, window: int = WINDOW
) -> dict[str, Array]:
    """The paper's features of every finger."""
    columns = [FEATURE_NAMES.index(name) for name in names]

    def of(finger: FingerSignal) -> Array:
        return np.ascontiguousarray(haar_features(finger.force, window)[:, columns])

    return stretchwise(hand, of)


def _deployed(hand: HandSignal) -> Mapping[str, Array]:
    return haar(hand)


LOGREG = Method("logreg", "LogReg (the paper)", "paper", SOURCE, _deployed, recipe("logreg"))
SVM = Method("svm", "Linear SVM (the paper)", "paper", SOURCE, _deployed, recipe("svm"))
