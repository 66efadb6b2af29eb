"""Own handling in a model: location, scale and thresholds of a sensor."""

import math

import msgspec
import numpy as np
import pytest
from holdfast.classifiers.cause import CauseClassifier, add_scores
from holdfast.classifiers.slip import add_squares

from detector.build import (
    RICH,
    SLIP_OWN,
    TAXELS,
    classifier,
    finger_model,
    lively,
    recording,
    sensor,
    squared_rule,
    tactile,
)
from holdfast.classifiers import OnnxClassifier
from holdfast.contact import Cause
from holdfast.detector import Detector, detect
from holdfast.errors import ModelError
from holdfast.live.arrival_detector import ArrivalDetector
from holdfast.model import ANY_FINGER, FingerModel, Handling, Model
from holdfast.model.files import encode

replace = msgspec.structs.replace
RNG = np.random.default_rng(3)
CAUSES = CauseClassifier(
    causes=(Cause.CLOSING, Cause.GLITCH),
    mean=tuple(RNG.normal(size=len(RICH)).tolist()),
    scale=tuple(RNG.uniform(1, 3, size=len(RICH)).tolist()),
    coefficients=tuple(tuple(row) for row in RNG.normal(size=(2, len(RICH))).tolist()),
    intercepts=(0.1, -0.2),
)
PART = finger_model(RICH, slip=squared_rule(SLIP_OWN), causes=CAUSES, normalised=True)
N = len(PART.all_features)
HANDLING = Handling(
    location=tuple(RNG.normal(scale=30, size=N).tolist()),
    scale=tuple(RNG.uniform(0.3, 60, size=N).tolist()),
    seconds=12.5,
    threshold=0.31,
    slip_threshold=0.83,
    recordings={"one": "0a1b"},
)
CALIBRATED = replace(PART, handling={"tiny": HANDLING})
OWN = CALIBRATED.for_sensor("tiny")
ROWS = RNG.normal(scale=40, size=(50, N))


def places(features):
    return [PART.all_features.index(spec) for spec in features]


def own_units(rows, features):
    """Return the features in scales of the own handling from its location."""
    columns = places(features)
    location, scale = np.array(HANDLING.location), np.array(HANDLING.scale)
    return (rows[:, columns] - location[columns]) / scale[columns]


def model(part=CALIBRATED, **options):
    return Model(fingers={ANY_FINGER: part}, rate=100.0, window=6, tare="0.2", **options)


def test_the_classifier_sees_features_in_own_units():
    rule = PART.classifier
    z = own_units(ROWS, RICH) @ rule.coefficients + rule.intercept
    columns = places(RICH)
    assert OWN.classifier.decision(ROWS[:, columns]) == pytest.approx(z, abs=1e-12, rel=1e-12)
    expected = 1 / (1 + np.exp(-z))
    assert OWN.classifier.probability(ROWS[:, columns]) == pytest.approx(expected, abs=1e-12)
    assert OWN.classifier.threshold == 0.31


def test_the_slip_rule_sees_them_in_own_units_and_so_do_its_squares():
    rule = PART.slip.classifier
    u = own_units(ROWS, SLIP_OWN)
    linear = rule.slope * (u @ rule.coefficients + rule.intercept) + rule.offset
    squares = rule.slope * (np.minimum(np.abs(u), 5.0) ** 2 @ PART.slip.squares)
    weights, table = OWN.slip.classifier.weights(), OWN.slip.square_weights()
    rows = ROWS[:, places(SLIP_OWN)]
    found = [add_squares(weights[0] + row @ weights[1:], row, table) for row in rows]
    assert found == pytest.approx(linear + squares, abs=1e-12, rel=1e-12)
    assert OWN.slip.classifier.threshold == 0.83


def test_causes_move_as_the_default_handling_does():
    columns = places(RICH)
    location, scale = PART.default_handling
    default = location[columns] + scale[columns] * own_units(ROWS, RICH)
    scores = [np.zeros(6), np.zeros(6)]
    for own_row, default_row in zip(ROWS[:, columns], default, strict=True):
        add_scores(own_row, OWN.causes.weights(), scores[0])
        add_scores(default_row, PART.causes.weights(), scores[1])
        assert scores[0] == pytest.approx(scores[1], rel=1e-9)


def test_default_handling_is_mean_and_scale_of_the_classifiers():
    location, scale = PART.default_handling
    only_slips = [spec for spec in PART.all_features if spec not in RICH]
    assert only_slips
    assert location[: len(RICH)].tolist() == list(PART.classifier.mean)
    assert scale[: len(RICH)].tolist() == list(PART.classifier.scale)
    for spec in only_slips:
        at = SLIP_OWN.index(spec)
        assert location[places([spec])] == PART.slip.classifier.mean[at]
        assert scale[places([spec])] == PART.slip.classifier.scale[at]


def test_another_sensor_has_default_handling():
    assert CALIBRATED.for_sensor("other") is CALIBRATED
    assert OWN.for_sensor("tiny") is OWN  # it holds no own handling any more
    hand = {"thumb": sensor(), "index": sensor(name="other")}
    assert model().without_handling(hand) == ["other"]
    assert model().handling_advice(hand) == (
        "the model was calibrated on tiny, not on other: default handling is used "
        "(holdfast calibrate)"
    )
    assert model(PART).without_handling({"thumb": sensor()}) == []
    assert model().handling_advice({"thumb": sensor()}) == ""


def test_another_finger_has_default_handling():
    fingers = {"thumb": CALIBRATED, "index": PART}
    named = replace(model(), fingers=fingers, sensors={})
    hand = {"thumb": sensor(), "index": sensor()}
    assert named.handled_sensors == ("thumb (tiny)",)
    assert named.without_handling(hand) == ["index (tiny)"]


def test_thresholds_may_be_those_of_the_model():
    handling = replace(HANDLING, threshold=None, slip_threshold=None)
    own = PART.with_handling(handling)
    assert own.classifier.threshold == PART.classifier.threshold
    assert own.slip.classifier.threshold == PART.slip.classifier.threshold
    assert own.classifier.mean == OWN.classifier.mean


def states(estimates):
    return [(e.fingers["thumb"].stable_probability, e.fingers["thumb"].state) for e in estimates]


def test_every_way_to_detect_uses_it():
    hand = recording(thumb=tactile(300))
    explicit = model(OWN)
    expected = detect(explicit, hand).fingers["thumb"]
    for_default = detect(model(PART), hand).fingers["thumb"]
    found = detect(model(), hand).fingers["thumb"]
    for field in ("state", "stable_probability", "slip_probability", "cause"):
        np.testing.assert_array_equal(getattr(found, field), getattr(expected, field))
    assert not np.array_equal(
        found.stable_probability, for_default.stable_probability, equal_nan=True
    )
    np.testing.assert_array_equal(
        model().predict_proba(hand)["thumb"], explicit.predict_proba(hand)["thumb"]
    )
    live = [Detector(m, {"thumb": sensor()}) for m in (model(), explicit)]
    rows = list(enumerate(lively(60)))
    one, two = ([d.update({"thumb": row}, k / 100) for k, row in rows] for d in live)
    assert str(states(one)) == str(states(two))


def test_the_live_threshold_is_that_of_the_sensor():
    sensors = {"thumb": sensor(), "index": sensor(name="other")}
    usual = PART.classifier.threshold
    assert ArrivalDetector(model(), sensors).thresholds == {"thumb": 0.31, "index": usual}


def test_two_sensors_of_one_hand():
    other = sensor(name="other")
    hand = recording(thumb=tactile(200), index=tactile(200, which=other))
    part = replace(CALIBRATED, features=TAXELS, **relative_parts())
    found = detect(model(part), hand).fingers
    alone = {"thumb": part.for_sensor("tiny"), "index": replace(part, handling=msgspec.UNSET)}
    for name, own in alone.items():
        expected = detect(model(own), recording(**{name: hand.modules[name]})).fingers[name]
        np.testing.assert_array_equal(found[name].stable_probability, expected.stable_probability)


def relative_parts():
    n = len(TAXELS)
    handling = replace(HANDLING, location=(0.2,) * n, scale=(0.5,) * n, slip_threshold=None)
    return {
        "classifier": classifier(n), "slip": None, "causes": None, "handling": {"tiny": handling}
    }  # fmt: skip


def test_it_is_saved_with_the_model(tmp_path):
    model(name="mine").save(tmp_path / "mine.json")
    assert Model.load(tmp_path / "mine.json") == model(name="mine")


def test_a_model_without_it_is_written_as_before():
    text = encode(model(finger_model(RICH)))
    assert b"handling" not in text
    assert b"normalised" not in text


def test_the_handling_of_some_sensors_can_be_folded_in():
    folded = model().with_handling_of({"thumb": sensor()})
    assert folded.fingers[ANY_FINGER] == OWN
    both = {"thumb": sensor(), "index": sensor(name="other")}
    assert model().with_handling_of(both).fingers[ANY_FINGER] == replace(
        PART, handling=msgspec.UNSET
    )


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"location": (1.0,)}, f"1 locations and {N} scales of own handling given"),
        ({"location": (math.nan,) * N}, "a number of the own handling is not finite"),
        ({"scale": (0.0,) * N}, "scales and held time above 0 expected for own handling"),
        ({"seconds": 0.0}, "scales and held time above 0 expected for own handling"),
        ({"threshold": 1.5}, "a threshold from 0 to 1 expected, 1.5 given"),
        ({"slip_threshold": -0.5}, "a threshold from 0 to 1 expected, -0.5 given"),
    ],
)
def test_refused_handling(fields, message):
    with pytest.raises(ModelError, match=message):
        replace(HANDLING, **fields)


SHORT = replace(HANDLING, location=(1.0,), scale=(1.0,), slip_threshold=None)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"normalised": False}, "own handling given; it needs a model with normalised features"),
        ({"handling": {"x": SHORT}}, f"own handling of 1 features given for 'x', {N} expected"),
        (
            {"handling": {f"s{k}": HANDLING for k in range(257)}},
            "at most 256 sensors with own handling expected, 257 given",
        ),
    ],
)
def test_refused_parts(fields, message):
    with pytest.raises(ModelError, match=message):
        replace(CALIBRATED, **fields)


def test_a_slip_threshold_needs_a_slip_rule():
    handling = {"x": replace(HANDLING, location=(0.0,) * 15, scale=(1.0,) * 15)}
    with pytest.raises(ModelError, match="a slip threshold given for 'x'; there is no slip rule"):
        finger_model(RICH, normalised=True, handling=handling)


def test_other_classifiers_are_not_normalised():
    network = OnnxClassifier.of(b"onnx", len(RICH), 0.5)
    with pytest.raises(ModelError, match="a linear classifier expected where features are"):
        FingerModel(features=RICH, classifier=network, normalised=True)
