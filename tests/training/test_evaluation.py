from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, Phase
from holdfast.detection import Model, detect
from holdfast.errors import ModelError
from holdfast.metrics import hand_decisions
from holdfast.recordings import Recording, Truth
from holdfast.training import Setting, compute_decisions, evaluate, train
from holdfast.training.evaluation import combine_decisions, evaluate_recordings

from .build import sliding_recording, tiny_recording


@pytest.fixture(scope="module")
def model(grasps):
    return train(grasps, Setting(trials=0, window=6)).model


def test_decisions_are_those_of_the_detector_with_the_labels(model, grasps):
    decisions = compute_decisions(model, grasps[0])
    detection = detect(model, grasps[0])
    assert decisions.name == "grasp-0"
    for finger, trace in detection.fingers.items():
        found = decisions.fingers[finger]
        np.testing.assert_array_equal(found.states, trace.state)
        np.testing.assert_array_equal(found.stable_probability, trace.stable_probability)
        np.testing.assert_array_equal(found.labels, grasps[0].modules[finger].label_states)
    np.testing.assert_array_equal(decisions.hand.states, detection.hand)
    np.testing.assert_array_equal(decisions.hand.times, detection.times)
    expected = hand_decisions(decisions.fingers, 2)
    np.testing.assert_array_equal(decisions.hand.labels, expected.labels)


def test_exact_labels_come_from_the_truth(model, grasps):
    times = grasps[0].modules["thumb"].times
    n = len(times)
    pushed = (times > 1.0) & (times < 1.5)
    thumb = {"contact_force": np.ones((n, 3)), "slip_speed": np.zeros(n)}
    hand = {
        "phase": np.where(pushed, Phase.DISTURBED, Phase.LOCKED).astype(str),
        "outside_force": np.zeros((n, 3)),
    }
    recording = replace(grasps[0], truth=Truth(times, hand, {"thumb": thumb}))
    found = compute_decisions(model, recording)
    exact = found.fingers["thumb"].exact_labels
    np.testing.assert_array_equal(exact == UNSTABLE, pushed)
    np.testing.assert_array_equal(exact == STABLE, ~pushed)
    labels = grasps[0].modules["thumb"].label_states
    np.testing.assert_array_equal(found.fingers["thumb"].labels, labels)
    assert found.fingers["index"].exact_labels is None
    assert found.hand.exact_labels is None
    assert compute_decisions(model, grasps[0]).fingers["thumb"].exact_labels is None


def test_labels_of_a_recording_at_another_rate(model):
    fast = tiny_recording(31, n=1200, rate=300.0)
    finger = compute_decisions(model, fast).fingers["thumb"]
    assert len(finger.times) == pytest.approx(400, abs=1)
    assert (finger.labels == STABLE).mean() == pytest.approx(0.5, abs=0.01)


def test_without_labels_nothing_is_counted(model):
    bare = tiny_recording(32, states=[None] * 4)
    metrics = evaluate(model, [bare])
    assert (metrics.pooled.n, metrics.pooled.accuracy) == (0, None)


def test_a_model_for_other_fingers(model):
    with pytest.raises(ModelError, match="ring"):
        evaluate(model, [tiny_recording(0, fingers=("ring",))])


def test_each_decision_is_that_of_the_model_of_the_unit(grasps):
    settings = [Setting(trials=0, window=window) for window in (4, 10)]
    decisions_of_models = [
        compute_decisions(train(grasps[:2], each).model, grasps[3]) for each in settings
    ]
    units = np.random.default_rng(0).integers(2, size=400)
    found = combine_decisions(decisions_of_models, lambda n: units[:n], 2)
    for name, finger in found.fingers.items():
        for k in (0, 1):
            rows = units == k
            expected = decisions_of_models[k].fingers[name]
            np.testing.assert_array_equal(finger.states[rows], expected.states[rows])
            np.testing.assert_array_equal(
                finger.stable_probability[rows], expected.stable_probability[rows]
            )
    np.testing.assert_array_equal(found.hand.states, hand_decisions(found.fingers, 2).states)
    assert (found.hand.states[:50] == UNKNOWN).all()


def parts_of(recording):
    """Parts of a recording, by what was done to it."""
    thumb, index = recording.modules.values()
    cuts = {
        "first half": (0, 200), "last half": (200, 400), "middle": (90, 290),
        "without the first": (1, 400), "without the last": (0, 399),
    }  # fmt: skip
    return {
        **{
            what: {name: each.slice(*cut) for name, each in recording.modules.items()}
            for what, cut in cuts.items()
        },
        "one finger": {"index": index},
        "renamed": {"thumb": index, "index": thumb},
        "half of one, renamed": {"thumb": index.slice(0, 200)},
        "other times": {"index": replace(index, times=index.times + 5, labels=())},
    }


@pytest.mark.parametrize("what", parts_of(tiny_recording(0)))
def test_a_part_of_the_training_is_no_new_recording(model, grasps, what):
    part = Recording("part", parts_of(grasps[3])[what])
    other = Recording("other", parts_of(tiny_recording(40))[what])
    assert evaluate_recordings(model, [part, other]).trained_on == ["part"]


def test_models_of_before_know_whole_recordings(model, grasps):
    training = msgspec.structs.replace(model.training, blocks=msgspec.UNSET)
    old = msgspec.structs.replace(model, training=training)
    half = Recording("half", parts_of(grasps[0])["first half"])
    assert evaluate_recordings(old, [grasps[0], half]).trained_on == ["grasp-0"]


def test_a_model_that_reports_no_slip_is_scored_by_its_ranking():
    silent = Model.load("builtin:any").with_threshold("slip", 1.0)
    verdict = evaluate_recordings(silent, [sliding_recording(0)]).verdict
    assert (
        "Slips: none is reported until the model is calibrated (holdfast calibrate); P(slip) has"
        in verdict
    )
