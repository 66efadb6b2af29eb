"""Adaptation of a model: what is kept, what the data change, and the warnings."""

from dataclasses import replace

import msgspec
import pytest

from holdfast.detection import ANY_FINGER, Debounce, Tare, parse_features
from holdfast.errors import ModelError
from holdfast.training import Setting, evaluate, train
from holdfast.training.evaluation import was_trained_on

from .build import TINY, tiny_recording

FEATURES = parse_features("F_a,F_x,F_y,F_z,m,sigma", 8)
FIRST = Setting(window=8, features=FEATURES, trials=0, shared=True, tare=Tare.parse("0.4"))


@pytest.fixture(scope="module")
def known():
    """A model for any finger out of twelve recordings, with habits of its own."""
    recordings = [tiny_recording(seed) for seed in range(30, 42)]
    model = train(recordings, FIRST).model
    return msgspec.structs.replace(model, debounce=Debounce(0.02, 0.05, 0.1), name="mine")


@pytest.fixture(scope="module")
def few():
    return [tiny_recording(seed) for seed in (50, 51)]


def by_finger(model):
    parts = dict.fromkeys(("thumb", "index"), model.fingers[ANY_FINGER])
    return msgspec.structs.replace(model, fingers=parts)


def with_rule(part, **fields):
    """Return a part whose rule of stability has other fields."""
    rule = msgspec.structs.replace(part.stable.rule, **fields)
    return part.with_heads(msgspec.structs.replace(part.stable, rule=rule))


def train_with_warnings(recordings, setting):
    warnings = []
    return train(recordings, setting, warn=warnings.append).model, warnings


def accuracy(model, recordings):
    return evaluate(model, recordings).pooled.accuracy


def test_the_features_window_and_tare_of_the_model_are_kept(known, few):
    adapted, warnings = train_with_warnings(few, Setting.adapting(known, trials=0))
    assert set(adapted.fingers) == {"thumb", "index"}
    assert {part.features for part in adapted.fingers.values()} == {FEATURES}
    assert (adapted.window, adapted.tare, adapted.debounce) == (8, "0.4", Debounce(0.02, 0.05, 0.1))
    scales = {part.stable.rule.scale for part in adapted.fingers.values()}
    assert scales == {known.fingers[ANY_FINGER].stable.rule.scale}
    assert adapted.training.parameters == {
        finger: {"change": "calibration", "C": 1e-3} for finger in ("thumb", "index")
    }
    assert (adapted.name, warnings) == ("", [])


def test_given_fields_replace_those_of_the_model(known, few):
    setting = Setting.adapting(known, trials=0, hold=0.3, tare=Tare.parse("first"), shared=True)
    adapted = train(few, setting).model
    assert set(adapted.fingers) == {ANY_FINGER}
    assert (adapted.tare, adapted.debounce) == ("first", Debounce(0.02, 0.05, 0.3))


def test_recordings_correct_a_wrong_model(known, few):
    part = known.fingers[ANY_FINGER]
    (intercept,) = part.stable.rule.intercepts
    moved = with_rule(part, intercepts=(intercept + 4.0,))
    wrong = msgspec.structs.replace(known, fingers={ANY_FINGER: moved}, debounce=Debounce())
    rest = [tiny_recording(seed) for seed in range(60, 64)]
    adapted = train(few, Setting.adapting(wrong)).model
    assert accuracy(adapted, rest) > accuracy(wrong, rest) + 5.0


def test_each_finger_is_adapted_from_its_own_classifier(known, few):
    own = by_finger(known)
    part = own.fingers["index"]
    fingers = own.fingers | {"index": with_rule(part, scale=(7.0,) * len(FEATURES))}
    adapted = train(
        few, Setting.adapting(msgspec.structs.replace(own, fingers=fingers), trials=0)
    ).model
    assert adapted.fingers["index"].stable.rule.scale == (7.0,) * len(FEATURES)
    assert adapted.fingers["thumb"].stable.rule.scale == part.stable.rule.scale


def test_one_recording_is_split_by_time(known, few):
    warnings = []
    setting = Setting.adapting(known, trials=0)
    trained = [train(own, setting, warn=warnings.append) for own in (few[:1], few)]
    assert [each.split for each in trained] == ["time", "recording"]
    assert [each.model.training.split for each in trained] == ["time", "recording"]
    assert len(warnings) == 1 and "--split time" in warnings[0]


def test_windows_are_meant_for_the_rate_of_the_model(known):
    fast = [tiny_recording(seed, n=1200, rate=300.0) for seed in (50, 51)]
    assert train(fast, Setting.adapting(known, trials=0)).model.rate == pytest.approx(100.0)
    for_any = msgspec.structs.replace(known, rate=None)
    assert train(fast, Setting.adapting(for_any, trials=0)).model.rate == pytest.approx(300.0)


# --- warnings ------------------------------------------------------------------------------------


def test_another_sensor_is_used_with_a_warning(known):
    other = replace(TINY, name="other", unit="N")
    own = [tiny_recording(seed, sensor=other) for seed in (50, 51)]
    adapted, warnings = train_with_warnings(own, Setting.adapting(known, trials=0))
    (warning,) = warnings  # of both fingers
    assert "thumb, index" in warning and "other (N)" in warning
    assert adapted.sensors == {"other": other}
    assert {part.sensor for part in adapted.fingers.values()} == {"other"}


def test_parts_of_the_recordings_of_both_trainings_are_known(known, few):
    adapted = train(few, replace(FIRST, init=known)).model
    new, first, second = (
        replace(recording, modules={k: x.slice(1, 399) for k, x in recording.modules.items()})
        for recording in (tiny_recording(60), tiny_recording(30), few[1])
    )
    assert not was_trained_on(adapted, new)
    assert was_trained_on(adapted, first)
    assert was_trained_on(adapted, second)


def test_warn_of_recordings_that_the_model_was_trained_on(known, few):
    seen = tiny_recording(30)
    adapted, warnings = train_with_warnings([seen, *few], Setting.adapting(known, trials=0))
    assert len(warnings) == 1 and "grasp-30" in warnings[0]
    assert set(known.training.recordings.values()) <= set(adapted.training.recordings.values())
    assert adapted.training.recordings["grasp-30"] == seen.readings_digest
    trained = train([seen, *few], Setting.adapting(known, trials=0))
    assert (trained.known, trained.verdict) == (("grasp-30",), None)
    assert train(few, Setting.adapting(known, trials=0)).verdict is not None
    assert adapted.training.recordings["grasp-41 (init)"] == tiny_recording(41).readings_digest


# --- what is refused -------------------------------------------------------------------------


def test_a_finger_that_the_model_lacks(known):
    own = [tiny_recording(seed, ("thumb", "ring")) for seed in (50, 51)]
    with pytest.raises(ModelError, match="'ring'"):
        train(own, Setting.adapting(by_finger(known)))
