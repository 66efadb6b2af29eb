"""Heads of a finger: what is refused, and what a rule and its link make of the features."""

import math

import pytest
from msgspec.structs import replace

from detection.detector.build import (
    SLIP_OWN,
    TAXELS,
    cause_head,
    finger_model,
    linear,
    sensor,
    slip_head,
    speed_head,
    squared_head,
    stable_head,
)
from holdfast.contact import CAUSES, Cause
from holdfast.detection import ANY_FINGER, FeatureSpec, FingerModel, Linear, Model
from holdfast.detection.heads import HEAD_NAMES, Head
from holdfast.errors import ModelError

STABLE, SLIP = stable_head(SLIP_OWN), squared_head(SLIP_OWN)
SPEED, CAUSE = speed_head(SLIP), cause_head(SLIP_OWN)
SQUARES = ((0.0, 0.0, 0.0),)


@pytest.mark.parametrize(
    ("head", "changes", "message"),
    [
        (STABLE, {"name": "rolls"}, "a head of"),
        (STABLE, {"link": "probit"}, "stable: the link"),
        (STABLE, {"link": "square"}, "stable: the link"),
        (SLIP, {"link": "softmax"}, "slip: the link"),
        (SPEED, {"link": "logit"}, "slip_speed: the link"),
        (CAUSE, {"link": "logit"}, "cause: the link"),
        (STABLE, {"features": SLIP_OWN[:2]}, "stable: 2 features"),
        (SLIP, {"features": SLIP_OWN[:2]}, "slip: 2 features"),
        (SPEED, {"features": SLIP_OWN[:2]}, "slip_speed: 2 features"),
        (CAUSE, {"rule": linear(2)}, "cause: 3 features"),
        (SLIP, {"features": (SLIP_OWN[0],) * 3}, "slip: a feature"),
        (STABLE, {"features": (SLIP_OWN[0],) * 3}, "stable: a feature"),
        (STABLE, {"rule": replace(STABLE.rule, squares=SQUARES)}, "stable: a rule"),
        (CAUSE, {"rule": replace(CAUSE.rule, squares=SQUARES * 2)}, "cause: a rule"),
        (STABLE, {"rule": CAUSE.rule}, "stable: a rule"),
        (CAUSE, {"rule": linear(3)}, "cause: a rule"),
        (CAUSE, {"classes": (Cause.SLIP,) * 2}, "cause: two or"),
        (CAUSE, {"classes": (Cause.SLIP,)}, "cause: two or"),
        (CAUSE, {"classes": ()}, "cause: two or"),
        (STABLE, {"classes": (Cause.SLIP,)}, "stable: no classes"),
        (STABLE, {"threshold": 1.5}, "stable: a threshold"),
        (SLIP, {"threshold": math.nan}, "slip: a threshold"),
        (SPEED, {"highest": 0.0}, "slip_speed: a finite"),
        (SPEED, {"highest": math.nan}, "slip_speed: a finite"),
        (SPEED, {"highest": math.inf}, "slip_speed: a finite"),
        (SPEED, {"highest": None}, "slip_speed: a finite"),
        (SLIP, {"highest": 3.0}, "slip: no highest"),
        (SLIP, {"smoothing": -0.1}, "slip: a smoothing"),
        (SLIP, {"hold": 10.5}, "slip: a hold"),
        (SLIP, {"hold": math.nan}, "slip: a hold"),
        (STABLE, {"hold": 0.1}, "stable: a hold"),
        (CAUSE, {"smoothing": 0.1}, "cause: a smoothing"),
    ],
)
def test_fields_that_contradict_each_other_are_refused(head, changes, message):
    with pytest.raises(ModelError, match=message):
        replace(head, **changes)


@pytest.mark.parametrize(
    ("heads", "message"),
    [
        ((STABLE, SLIP, SLIP), "one head of"),
        ((), "a head stable"),
        ((SLIP, CAUSE), "a head stable"),
        ((STABLE, SPEED), "a head stable"),
        ((STABLE, slip_head((FeatureSpec("change", 1 << 17),))), "at most 65536"),
    ],
)
def test_heads_that_contradict_each_other_are_refused(heads, message):
    with pytest.raises(ModelError, match=message):
        FingerModel(heads=heads)


def test_the_features_of_a_finger_are_those_of_its_heads_once():
    part = finger_model()
    own = part.stable.features
    assert part.with_heads(slip_head(own), cause_head(own)).features == own
    # In the order of the heads of a finger, whatever the order in the file.
    part = FingerModel(heads=(SLIP, *part.heads))
    assert part.features == (*own, SLIP_OWN[0], SLIP_OWN[2])
    assert part.indices(part.slip).tolist() == [5, 1, 6]


def test_heads_are_replaced_added_and_removed():
    part = FingerModel(heads=(STABLE, SLIP, SPEED, CAUSE))
    assert [part.head(head.name) for head in part.heads] == [STABLE, SLIP, SPEED, CAUSE]
    other = SLIP.at(0.25)
    assert part.with_heads(other).heads == (STABLE, other, SPEED, CAUSE)
    assert FingerModel(heads=(STABLE,)).with_heads(CAUSE, SLIP).heads == (STABLE, CAUSE, SLIP)
    assert part.without_heads("slip", "slip_speed").heads == (STABLE, CAUSE)
    assert part.without_heads("slip", "slip_speed").slip is None


def test_relative_features_of_a_head_need_a_rate_for_which_they_are_made():
    part = finger_model().with_heads(squared_head(TAXELS))
    with pytest.raises(ModelError, match="10 Hz"):
        Model(fingers={ANY_FINGER: part}).plan({"thumb": sensor()}, 10.0)


def test_features_that_compare_taxels_need_two():
    part = finger_model()
    hand_model = Model(fingers={ANY_FINGER: part.with_heads(squared_head(TAXELS))})
    assert hand_model.blind_features("thumb", sensor(2)) == ()
    assert hand_model.blind_features("thumb", sensor(1)) == (
        "centre_shift", "divergence", "relative_divergence",
        "fast_own", "fast_own_30ms", "fast_own_100ms", "fast_own_400ms",
    )  # fmt: skip
    assert Model(fingers={ANY_FINGER: part}).blind_features("thumb", sensor(1)) == ()


@pytest.mark.parametrize("with_slip", [True, False])
def test_the_weights_of_causes_are_those_that_the_head_knows(with_slip):
    """Nor has a slip, where a head of its own decides about slips."""
    rule = Linear((0.0,), (2.0,), ((1.0,), (3.0,)), (0.25, -0.5))
    features = (FeatureSpec("F_x"),)
    classes = (Cause.SLIP, Cause.GLITCH)
    cause = Head(name="cause", link="softmax", features=features, rule=rule, classes=classes)
    part = finger_model(features, 0, cause)
    part = part.with_heads(slip_head(features)) if with_slip else part
    model = Model(fingers={ANY_FINGER: part})
    _, rules, weights = model.config(model.plan({"thumb": sensor()}, 100.0))
    head = rules[0]["heads"][HEAD_NAMES.index("cause")]
    rows = weights[head["first"] :].reshape(-1, 2)
    found = dict(zip(head["causes"], rows.tolist(), strict=False))
    codes = {cause: CAUSES.index(cause) + 1 for cause in classes}
    expected = {} if with_slip else {codes[Cause.SLIP]: [0.25, 0.5]}
    assert found == expected | {codes[Cause.GLITCH]: [-0.5, 1.5]}
