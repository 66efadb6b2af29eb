"""Our own method: log scales, several windows, all axes, and what the whole hand feels.

The paper's features have three weaknesses that the study shows. Sigma spans four decades, so
that a rule linear in it serves only one of them; a threshold on the force does not carry over
from one grip to another; and a slow push has no details at any one window. So here the size of
the details is on a log scale, over windows from 27 ms to 0.4 s, of the three components and not
of the amplitude alone; the change of the force over 20 ms to 0.4 s sees what is slow; and each
finger also sees the largest of both among all fingers, for what moves the object moves them all.
The rule stays linear.
"""

from collections.abc import Mapping

from holdfast.classifiers import recipe
from holdfast.features.specs import HOLDFAST_FEATURES
from holdfast.features.stream import StreamPlan, extract
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.paper import WINDOW
from holdfast.study.methods.signals import HandSignal


def _features(hand: HandSignal) -> Mapping[str, Array]:
    sensors = {name: finger.sensor for name, finger in hand.fingers.items()}
    plan = StreamPlan(
        sensors, dict.fromkeys(sensors, HOLDFAST_FEATURES), WINDOW, hand.tare, hand.rate
    )
    return {name: rows.features for name, rows in extract(plan, hand.recording).items()}


HOLDFAST = Method(
    "holdfast",
    "holdfast",
    "holdfast",
    "ours: logarithms of sigma over three axes and of force changes, over several windows, of "
    "the finger and of the hand; logistic regression",
    _features,
    recipe("logreg"),
)
