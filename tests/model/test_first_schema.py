"""Model files of the schema before: each part of them is found in the heads of the model."""

import json

import pytest
from msgspec.structs import replace

from holdfast.classifiers import Linear, Onnx
from holdfast.contact import Cause
from holdfast.errors import ModelError
from holdfast.features import FeatureSpec
from holdfast.model import (
    ANY_FINGER,
    Choice,
    Debounce,
    FingerModel,
    Handling,
    Head,
    Model,
    ThresholdPoint,
    Training,
)

NETWORK = Onnx.of(b"not read", 1)
SIGMA, FORCE = FeatureSpec("sigma", 14, "noise"), FeatureSpec("F_a", 0, "log", "hand", 1.0)
CHANGE = FeatureSpec("change", 8, "log", "finger", 0.5)

FEATURES = [
    {"kind": "sigma", "window": 14, "transform": "noise"},
    {"kind": "F_a", "window": 0, "transform": "log", "scope": "hand", "floor": 1.0},
]
LINEAR = {
    "type": "linear", "mean": [1.0, 2.0], "scale": [3.0, 4.0], "coefficients": [0.5, -0.25],
    "intercept": 0.125, "slope": 2.0, "offset": -0.5, "threshold": 0.375,
}  # fmt: skip
SLIP = {
    "classifier": {
        "type": "linear", "mean": [5.0, 6.0], "scale": [7.0, 8.0], "coefficients": [1.5, -1.25],
        "intercept": 0.75, "slope": 1.0, "offset": 0.25, "threshold": 0.875,
    },
    "smoothing": 0.02,
    "hold": 0.05,
    "thresholds": {
        "requested": 1.0, "false_alarms_per_minute": 0.75, "found": 62.5, "n_slips": 40,
        "held_minutes": 12.5, "recordings": {"three": "3c"},
    },
    "features": [
        {"kind": "change", "window": 8, "transform": "log", "scope": "finger", "floor": 0.5},
        FEATURES[1],
    ],
    "squares": [0.0625, -0.03125],
    "speed": {
        "mean": [9.0, 10.0], "scale": [11.0, 12.0], "coefficients": [2.5, 3.5],
        "squares": [0.1, 0.2], "intercept": 4.5, "highest": 80.0,
    },
}  # fmt: skip
CAUSES = {
    "causes": ["closing", "glitch"], "mean": [13.0, 14.0], "scale": [15.0, 16.0],
    "coefficients": [[1.0, 2.0], [3.0, 4.0]], "intercepts": [0.5, -0.5],
}  # fmt: skip
HANDLING = {
    "location": [0.5, 1.5, 2.5], "scale": [0.25, 0.75, 1.25], "seconds": 30.0, "threshold": 0.31,
    "slip_threshold": 0.83, "recordings": {"four": "4d"},
}  # fmt: skip
OLD = {
    "fingers": {
        "*": {
            "features": FEATURES, "classifier": LINEAR, "sensor": None,
            "contact_threshold": None, "contact_noise": 5.0, "contact_load": None,
            "causes": CAUSES, "slip": SLIP, "normalised": True, "handling": {"pad": HANDLING},
        }
    },
    "rate": 150.0, "sensors": {}, "window": 14, "tare": "first",
    "debounce": {"min_duration": 0.0, "hysteresis": 0.0, "hold": 0.1, "switching": 15.3},
    "training": {
        "recordings": {"one": "1a"}, "split": "object", "parameters": {"*": {"C": 0.5}},
        "figures": {"auc": 0.75}, "seed": 3, "versions": {"numpy": "2.0"},
        "samples": {"*": [10, 20]}, "sliding_samples": {"*": 7},
    },
    "tuning": {
        "recordings": {"two": "2b"}, "requested": 4.0, "threshold": 0.375,
        "false_alarms_per_minute": 2.5, "missed": {"0.05": 50.0, "0.1": 30.0, "0.2": 10.0},
        "delay_median": 0.0125, "n_events": 31, "stable_minutes": 0.75,
        "points": [
            {"threshold": 0.25, "false_alarms_per_minute": 1.5, "missed": 20.0},
            {"threshold": 0.375, "false_alarms_per_minute": 2.5, "missed": None},
        ],
    },
    "schema": "holdfast.model/1", "name": "mine",
}  # fmt: skip

STABLE_HEAD = Head(
    name="stable", link="logit", features=(SIGMA, FORCE),
    rule=Linear((1.0, 2.0), (3.0, 4.0), ((0.5, -0.25),), (0.125,), slope=2.0, offset=-0.5),
    threshold=0.375,
    choice=Choice(
        requested=4.0, false_alarms_per_minute=2.5, found=90.0, n=31, minutes=0.75,
        recordings={"two": "2b"},
        points=(ThresholdPoint(0.25, 1.5, 20.0), ThresholdPoint(0.375, 2.5, None)),
    ),
)  # fmt: skip
SLIP_HEAD = Head(
    name="slip", link="logit", features=(CHANGE, FORCE),
    rule=Linear(
        (5.0, 6.0), (7.0, 8.0), ((1.5, -1.25),), (0.75,), ((0.0625, -0.03125),), offset=0.25
    ),
    threshold=0.875, smoothing=0.02, hold=0.05,
    choice=Choice(
        requested=1.0, false_alarms_per_minute=0.75, found=62.5, n=40, minutes=12.5,
        recordings={"three": "3c"},
    ),
)  # fmt: skip
SPEED_HEAD = Head(
    name="slip_speed", link="square", features=(CHANGE, FORCE),
    rule=Linear((9.0, 10.0), (11.0, 12.0), ((2.5, 3.5),), (4.5,), ((0.1, 0.2),)),
    highest=80.0,
)  # fmt: skip
CAUSE_HEAD = Head(
    name="cause", link="softmax", features=(SIGMA, FORCE),
    rule=Linear((13.0, 14.0), (15.0, 16.0), ((1.0, 2.0), (3.0, 4.0)), (0.5, -0.5)),
    classes=(Cause.CLOSING, Cause.GLITCH),
)  # fmt: skip
PART = FingerModel(
    heads=(STABLE_HEAD, SLIP_HEAD, SPEED_HEAD, CAUSE_HEAD),
    contact_noise=5.0,
    normalised=True,
    handling={
        "pad": Handling(
            location=(0.5, 1.5, 2.5), scale=(0.25, 0.75, 1.25), seconds=30.0,
            thresholds={"stable": 0.31, "slip": 0.83}, recordings={"four": "4d"},
        )
    },
)  # fmt: skip
NEW = Model(
    fingers={ANY_FINGER: PART},
    rate=150.0,
    tare="first",
    debounce=Debounce(hold=0.1, switching=15.3),
    training=Training(
        {"one": "1a"}, "object", {"*": {"C": 0.5}}, {"auc": 0.75}, 3, {"numpy": "2.0"},
        {"*": (10, 20)}, {"*": 7},
    ),
    name="mine",
)  # fmt: skip


def loaded(folder, document):
    path = folder / "old.json"
    path.write_text(json.dumps(document))
    return Model.load(path)


def part_of(*left_out, **fields):
    """The old document of a finger, with other fields or without some."""
    part = OLD["fingers"]["*"] | fields
    return {key: value for key, value in part.items() if key not in left_out}


def old(part, **fields):
    return OLD | fields | {"fingers": {"*": part}}


def test_every_part_is_found_again(tmp_path):
    assert loaded(tmp_path, OLD) == NEW


def test_what_is_saved_again_is_of_the_present_schema(tmp_path):
    loaded(tmp_path, OLD).save(tmp_path / "new.json")
    assert json.loads((tmp_path / "new.json").read_text())["schema"] == "holdfast.model/2"
    assert Model.load(tmp_path / "new.json") == NEW


PLAIN_SLIP = {"classifier": LINEAR, "smoothing": 0.0, "hold": 0.0, "thresholds": None}
OWN = PART.handling["pad"]
EARLIER = {
    "nothing but stability": (
        part_of("causes", "slip", "normalised", "handling"),
        replace(PART, heads=(STABLE_HEAD,), normalised=False, handling={}),
    ),
    "heads that are null": (
        part_of("normalised", "handling", causes=None, slip=None),
        replace(PART, heads=(STABLE_HEAD,), normalised=False, handling={}),
    ),
    "a slip by the features of stability": (
        part_of("causes", "handling", slip=PLAIN_SLIP),
        replace(
            PART,
            heads=(STABLE_HEAD, replace(STABLE_HEAD, name="slip", choice=None)),
            handling={},
        ),
    ),
    "handling with the thresholds of the model": (
        part_of(handling={"pad": HANDLING | {"threshold": None, "slip_threshold": None}}),
        replace(PART, handling={"pad": replace(OWN, thresholds={})}),
    ),
    "handling with a threshold of stability alone": (
        part_of(handling={"pad": HANDLING | {"slip_threshold": None}}),
        replace(PART, handling={"pad": replace(OWN, thresholds={"stable": 0.31})}),
    ),
}


@pytest.mark.parametrize(("part", "expected"), EARLIER.values(), ids=EARLIER)
def test_parts_that_a_file_may_lack(part, expected, tmp_path):
    assert loaded(tmp_path, old(part)).fingers[ANY_FINGER] == expected


def test_a_model_that_was_not_tuned_or_without_events(tmp_path):
    plain = loaded(tmp_path, OLD | {"tuning": None}).fingers[ANY_FINGER].stable
    assert plain == replace(STABLE_HEAD, choice=None)
    missed = {"0.05": None, "0.1": None, "0.2": None}
    tuning = OLD["tuning"] | {"missed": missed, "delay_median": None, "n_events": 0}
    choice = loaded(tmp_path, OLD | {"tuning": tuning}).fingers[ANY_FINGER].stable.choice
    assert (choice.found, choice.n) == (None, 0)


def test_an_onnx_file_beside_it(tmp_path):
    (tmp_path / NETWORK.file).write_bytes(NETWORK.content)
    network = {
        "type": "onnx", "file": NETWORK.file, "sha256": NETWORK.sha256, "n_features": 1,
        "threshold": 0.25,
    }  # fmt: skip
    part = {"features": FEATURES[:1], "classifier": network}
    (head,) = loaded(tmp_path, old(part, tuning=None)).fingers[ANY_FINGER].heads
    assert head == Head(
        name="stable", link="logit", features=(SIGMA,), rule=NETWORK, threshold=0.25
    )


REFUSED = {
    "no classifier": (old(part_of("classifier")), "KeyError('classifier')"),
    "no features": (old(part_of("features")), "KeyError('features')"),
    "a finger that is a list": (old([]), "KeyError('features')"),
    "no highest speed": (
        old(part_of(slip=SLIP | {"speed": {"mean": [1.0]}})), "KeyError('highest')"
    ),
    "a field that no slip rule has": (
        old(part_of(slip=SLIP | {"colour": 1})), "Object contains unknown field `colour`"
    ),
    "a field that no classifier has": (
        old(part_of(classifier=LINEAR | {"colour": 1})), "Object contains unknown field `colour`"
    ),
    "a field that no model has": (OLD | {"colour": 1}, "Object contains unknown field `colour`"),
    "tuning without its misses": (OLD | {"tuning": {}}, "KeyError('missed')"),
    "widths that differ": (
        old(part_of(slip=SLIP | {"squares": [1.0]})), "squares of 2, 2, 2, 1 features given"
    ),
    "a threshold out of range": (
        old(part_of(classifier=LINEAR | {"threshold": 1.5})),
        "stable: a threshold from 0 to 1 expected, 1.5 given",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("document", "message"), REFUSED.values(), ids=REFUSED)
def test_what_is_refused_is_one_line(document, message, tmp_path):
    with pytest.raises(ModelError) as raised:
        loaded(tmp_path, document)
    text = str(raised.value)
    assert text.startswith(f"{tmp_path / 'old.json'} is not a model of holdfast.model/2: ")
    assert message in text
    assert "\n" not in text
