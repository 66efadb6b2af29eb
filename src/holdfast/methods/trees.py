"""Gradient-boosted trees: what the paper's six features hold at most, whatever the rule."""

from collections.abc import Mapping

from holdfast.classifiers.trees import GradientBoosting
from holdfast.features import FEATURE_NAMES
from holdfast.methods.method import Method
from holdfast.methods.paper import WINDOW, haar
from holdfast.methods.signals import HandSignal
from holdfast.sensors.values import Array

SOURCE = f"no paper: all six features of Kitouni et al. at N_w = {WINDOW}, without a linear rule"


def _six(hand: HandSignal) -> Mapping[str, Array]:
    return haar(hand, FEATURE_NAMES)


TREES = Method("trees", "Boosted trees, 6 features", "learning", SOURCE, _six, GradientBoosting())
