"""Gradient-boosted trees: what the paper's six features hold at most, whatever the rule."""

from collections.abc import Mapping

from holdfast.classifiers.trees import GradientBoosting
from holdfast.features import FEATURE_NAMES
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.paper import WINDOW, haar
from holdfast.study.methods.signals import HandSignal

SOURCE = f"no paper: all six features of Kitouni et al. at N_w = {WINDOW}, without a linear rule"


def _six(hand: HandSignal) -> Mapping[str, Array]:
    return haar(hand, FEATURE_NAMES)


TREES = Method("trees", "Boosted trees, 6 features", "learning", SOURCE, _six, GradientBoosting())
