"""Own handling in a model: location, scale and thresholds of a sensor."""

import math

import msgspec
import numpy as np
import pytest

from detection.detector.build import (
    RICH,
    SLIP_OWN,
    cause_head,
    finger_model,
    lively,
    recording,
    sensor,
    squared_head,
    tactile,
)
from holdfast.detection import ANY_FINGER, Detector, Handling, Model, detect
from holdfast.errors import ModelError
from holdfast.live.stream_detector import StreamDetector
from live import build

replace = msgspec.structs.replace
RNG = np.random.default_rng(3)
PART = finger_model(RICH, 0, squared_head(SLIP_OWN), cause_head(RICH), normalised=True)
N = len(RICH)
HANDLING = Handling(
    location=tuple(RNG.normal(scale=30, size=N).tolist()),
    scale=tuple(RNG.uniform(0.3, 60, size=N).tolist()),
    seconds=12.5,
    thresholds={"stable": 0.31, "slip": 0.83},
    recordings={"one": "0a1b"},
)
CALIBRATED = replace(PART, handling={"tiny": HANDLING})
OWN = CALIBRATED.for_sensor("tiny")
ROWS = RNG.normal(scale=40, size=(50, len(PART.features)))


def places(features):
    return [PART.features.index(spec) for spec in features]


def own_units(rows, features):
    """Return the features in scales of the own handling from its location."""
    columns = places(features)
    location, scale = np.array(HANDLING.location), np.array(HANDLING.scale)
    return (rows[:, columns] - location[columns]) / scale[columns]


def model(part=CALIBRATED, **options):
    return Model(fingers={ANY_FINGER: part}, rate=100.0, window=6, tare="0.2", **options)


def test_the_classifier_sees_features_in_own_units():
    rule = PART.stable.rule
    z = own_units(ROWS, RICH) @ rule.weights[0] + rule.intercepts[0]
    columns = places(RICH)
    assert OWN.stable.rule.decision(ROWS[:, columns]) == pytest.approx(z, abs=1e-12, rel=1e-12)
    expected = 1 / (1 + np.exp(-z))
    assert OWN.stable.rule.probability(ROWS[:, columns]) == pytest.approx(expected, abs=1e-12)
    assert OWN.stable.threshold == 0.31


def test_the_slip_rule_sees_features_as_they_are_with_another_threshold():
    assert OWN.slip.rule == PART.slip.rule
    assert (OWN.slip.threshold, PART.slip.threshold) == (0.83, 0.5)


def test_causes_move_as_the_default_handling_does():
    columns = places(RICH)
    location, scale = PART.default_handling
    default = location[columns] + scale[columns] * own_units(ROWS, RICH)
    own, other = (part.head("cause").rule.raw_weights() for part in (OWN, PART))
    scores = own[:, :1] + own[:, 1:] @ ROWS[:, columns].T
    assert scores == pytest.approx(other[:, :1] + other[:, 1:] @ default.T, rel=1e-9)


def test_default_handling_is_mean_and_scale_of_stability():
    location, scale = PART.default_handling
    assert location.tolist() == list(PART.stable.rule.mean)
    assert scale.tolist() == list(PART.stable.rule.scale)


def test_another_sensor_has_default_handling():
    assert CALIBRATED.for_sensor("other") is CALIBRATED
    assert OWN.for_sensor("tiny") is OWN  # it holds no own handling any more
    hand = {"thumb": sensor(), "index": sensor(name="other")}
    assert model().without_handling(hand) == ["other"]
    assert "on tiny, not on other" in model().handling_advice(hand)
    assert model(PART).without_handling({"thumb": sensor()}) == []
    assert model().handling_advice({"thumb": sensor()}) == ""


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
    usual = PART.stable.threshold
    stream = StreamDetector(model(), build.Script(sensors))
    assert stream.thresholds == {"thumb": 0.31, "index": usual}


def test_a_model_without_it_says_so():
    (part,) = msgspec.json.decode(model(finger_model(RICH)).encoded())["fingers"].values()
    assert (part["handling"], part["normalised"]) == ({}, False)


def test_the_handling_of_some_sensors_can_be_folded_in():
    folded = model().with_handling_of({"thumb": sensor()})
    assert folded.fingers[ANY_FINGER] == OWN
    both = {"thumb": sensor(), "index": sensor(name="other")}
    assert model().with_handling_of(both).fingers[ANY_FINGER] == PART


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"location": (1.0,)}, "1 locations"),
        ({"location": (math.nan,) * N}, "not finite"),
        ({"scale": (0.0,) * N}, "scales"),
        ({"seconds": 0.0}, "scales"),
        ({"thresholds": {"stable": 1.5}}, "threshold"),
        ({"thresholds": {"slip": -0.5}}, "threshold"),
    ],
)
def test_refused_handling(fields, message):
    with pytest.raises(ModelError, match=message):
        replace(HANDLING, **fields)


SHORT = replace(HANDLING, location=(1.0,), scale=(1.0,), thresholds={})


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"normalised": False}, "own handling given"),
        ({"handling": {"x": SHORT}}, "own handling of"),
        ({"handling": {f"s{k}": HANDLING for k in range(257)}}, "at most 256"),
    ],
)
def test_refused_parts(fields, message):
    with pytest.raises(ModelError, match=message):
        replace(CALIBRATED, **fields)


def test_a_threshold_needs_its_head():
    handling = {"x": replace(HANDLING, location=(0.0,) * N, scale=(1.0,) * N)}
    with pytest.raises(ModelError, match=r"slip .*'x'"):
        finger_model(RICH, normalised=True, handling=handling)
