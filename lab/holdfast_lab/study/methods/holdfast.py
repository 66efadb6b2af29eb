"""Our own method: logarithms of the details over several windows, of the finger and the hand.

The paper's features have three weaknesses, which the study shows. Sigma spans four decades, so a
rule that is linear in sigma serves only one of them. A threshold on the force does not carry over
from one grip to another. A slow push has no details in any single window.

Here the size of the details is on a logarithmic scale, over windows from 27 ms to 0.4 s, of the
three components and not of the amplitude alone. The change of the force over 20 ms to 0.4 s shows
slow pushes. Each finger also gets the largest of both among all fingers, because what moves the
object moves all fingers. The rule stays linear.

The paper's classifiers see one finger each. So the same rule stands without the features of the
hand too, by both classifiers of the paper.
"""

from collections.abc import Mapping, Sequence
from functools import partial

from holdfast.detection import DEFAULT_WINDOW
from holdfast.detection.features import extract
from holdfast.detection.plan import StreamPlan
from holdfast.detection.specs import HOLDFAST_FEATURES, FeatureSpec
from holdfast.sensors.types import Array
from holdfast.training.classifiers import recipe
from holdfast_lab.study.methods.method import HandSignal, Method

FINGER_FEATURES = tuple(spec for spec in HOLDFAST_FEATURES if spec.scope == "finger")
"""Features of a finger that do not depend on the others."""


def holdfast_features(
    hand: HandSignal, features: Sequence[FeatureSpec] = HOLDFAST_FEATURES
) -> Mapping[str, Array]:
    """Return features of every finger, as the detector computes them live."""
    # By the code of the detector itself, so the study evaluates what runs on a hand.
    sensors = {name: finger.sensor for name, finger in hand.fingers.items()}
    specs = dict.fromkeys(sensors, tuple(features))
    plan = StreamPlan(sensors, specs, DEFAULT_WINDOW, hand.tare, hand.rate)
    return {name: rows.features for name, rows in extract(plan, hand.recording).items()}


HOLDFAST = Method(
    "holdfast",
    "holdfast",
    "holdfast",
    "ours: logarithms of sigma over three axes and of force changes, over several windows, of "
    "the finger and of the hand; logistic regression",
    holdfast_features,
    recipe("logreg"),
)
ONE_FINGER = tuple(
    Method(
        f"finger_{name}",
        f"holdfast, one finger alone, {title}",
        "holdfast",
        "ours without the features of the hand: a finger is judged by its own readings, as by the "
        "classifiers of Kitouni et al.",
        partial(holdfast_features, features=FINGER_FEATURES),
        recipe(name),
    )
    for name, title in (("logreg", "LogReg"), ("svm", "linear SVM"))
)
"""Ours for a finger that sees no other finger."""
