from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.errors import TrainingError
from holdfast.features import parse_features
from holdfast.labelling.review.out_of_fold import out_of_fold
from holdfast.recordings import Label, Recording, Tactile
from holdfast.resampling import resample
from holdfast.training import Setting
from labelling.tiny import STATES, TINY, tiny_recording

NONE, UNSTABLE, STABLE = (
    ContactState.NO_CONTACT,
    ContactState.UNSTABLE,
    ContactState.STABLE,
)
SETTING = Setting(trials=0, features=parse_features("holdfast"))


@pytest.fixture(scope="module")
def grasps():
    return [tiny_recording(seed) for seed in range(4)]


@pytest.fixture(scope="module")
def judged(grasps):
    return [found for _, found in out_of_fold(grasps, SETTING)]


def refusal(error, recordings, setting=SETTING, **more):
    with pytest.raises(error) as caught:
        list(out_of_fold(recordings, setting, **more))
    return str(caught.value)


def test_three_probabilities_for_every_sample(grasps, judged):
    for grasp, found in zip(grasps, judged, strict=True):
        assert list(found) == ["thumb", "index"]
        for finger, probabilities in found.items():
            assert probabilities.shape == (grasp.modules[finger].n_samples, 3)
            known = np.isfinite(probabilities).all(axis=1)
            np.testing.assert_allclose(probabilities[known].sum(axis=1), 1.0)
            assert known[150:].all()
            assert not known[:40].any()  # tare


def test_probabilities_separate_the_states(grasps, judged):
    for grasp, found in zip(grasps, judged, strict=True):
        codes = grasp.modules["thumb"].label_states
        probabilities = found["thumb"]
        known = np.isfinite(probabilities).all(axis=1)
        right = probabilities[known].argmax(axis=1) + 1 == codes[known]
        assert right.mean() > 0.85


def test_no_recording_is_predicted_from_its_own_labels(grasps):
    """Wrong labels of one recording do not change its own probabilities."""
    swap = {STABLE: UNSTABLE, UNSTABLE: STABLE, NONE: NONE}
    turned = grasps[1].with_labels(
        {
            name: [replace(label, state=swap[label.state]) for label in module.labels]
            for name, module in grasps[1].modules.items()
        }
    )
    changed = [grasps[0], turned, *grasps[2:]]
    before = [found for _, found in out_of_fold(grasps, SETTING)]
    after = [found for _, found in out_of_fold(changed, SETTING)]
    np.testing.assert_array_equal(before[1]["thumb"], after[1]["thumb"])
    assert not np.array_equal(before[0]["thumb"], after[0]["thumb"], equal_nan=True)


def test_fewer_folds_leave_more_out(grasps):
    by_two = [found for _, found in out_of_fold(grasps, SETTING, n_folds=2)]
    by_four = [found for _, found in out_of_fold(grasps, SETTING, n_folds=4)]
    by_many = [found for _, found in out_of_fold(grasps, SETTING, n_folds=99)]
    assert not np.array_equal(by_two[0]["thumb"], by_four[0]["thumb"], equal_nan=True)
    np.testing.assert_array_equal(by_four[0]["thumb"], by_many[0]["thumb"])


def test_objects_may_be_held_out(grasps):
    """Recordings 0 and 3 are of one object: labels of 3 then do not affect 0."""
    setting = replace(SETTING, split="object")
    bare = [*grasps[:3], grasps[3].with_labels({})]
    one = next(out_of_fold(grasps, setting))[1]
    other = next(out_of_fold(bare, setting))[1]
    np.testing.assert_array_equal(one["thumb"], other["thumb"])


def test_without_labels_of_no_contact_contact_is_certain():
    states = (None, *STATES[1:])
    ((_, found), *_) = out_of_fold([tiny_recording(k, states=states) for k in range(3)], SETTING)
    known = found["thumb"][np.isfinite(found["thumb"]).all(axis=1)]
    assert (known[:, 0] == 0).all()
    assert known[:, 2].std() > 0.1


@pytest.mark.parametrize(("held", "never"), [(STABLE, 1), (UNSTABLE, 2)])
def test_a_state_that_is_never_labelled_has_no_probability(held, never):
    states = (NONE, held, held, held)
    ((_, found), *_) = out_of_fold([tiny_recording(k, states=states) for k in range(3)], SETTING)
    known = found["index"][np.isfinite(found["index"]).all(axis=1)]
    assert (known[:, never] == 0).all()
    assert known[:, 0].std() > 0.1


def test_a_state_that_is_labelled_before_the_first_features_only_is_not_learnt():
    """Without contact for one second: tare and first window take longer."""
    given = [tiny_recording(k, n=400) for k in range(3)]
    for _, found in out_of_fold(given, SETTING):
        known = np.isfinite(found["thumb"]).all(axis=1)
        assert known[150:].all()
        assert not known[:100].any()
        assert (found["thumb"][known, 0] == 0).all()


def test_a_finger_of_one_state_is_left_out(grasps):
    only = [Label(0.0, 6.0, STABLE)]
    given = [
        each.with_labels({"thumb": each.modules["thumb"].labels, "index": only}) for each in grasps
    ]
    assert [list(found) for _, found in out_of_fold(given, SETTING)] == 4 * [["thumb"]]


def test_labels_between_two_samples_are_ignored(grasps):
    slivers = [Label(1.001, 1.002, NONE), Label(1.003, 1.004, STABLE)]
    given = [
        each.with_labels({"thumb": each.modules["thumb"].labels, "index": slivers})
        for each in grasps
    ]
    for _, found in out_of_fold(given, SETTING):
        assert np.isfinite(found["thumb"][150:]).all()
        assert np.isnan(found["index"]).any(axis=1).all()


def test_recordings_without_labels_or_fingers_get_probabilities(grasps):
    bare = tiny_recording(7).with_labels({})
    thumb = Recording("thumb only", {"thumb": tiny_recording(8).modules["thumb"]})
    given = [*grasps, bare, thumb]
    found = [probabilities for _, probabilities in out_of_fold(given, SETTING)]
    assert np.isfinite(found[4]["index"][150:]).all()
    assert list(found[5]) == ["thumb"]


def test_a_recording_with_the_only_labels_of_a_class_has_no_probabilities(grasps):
    """Only the first has unstable labels: the others cannot train a model for it."""
    calm = [
        each.with_labels(
            {"thumb": [x for x in each.modules["thumb"].labels if x.state != UNSTABLE]}
        )
        for each in grasps[1:]
    ]
    first, *others = out_of_fold([grasps[0], *calm], SETTING)
    assert np.isnan(first[1]["thumb"][:, 1:]).all()
    assert np.isfinite(others[0][1]["thumb"][150:]).all()


def test_another_rate_has_probabilities_at_its_own_times(grasps):
    fast = resample(tiny_recording(9), 250.0)
    *_, (_, found) = out_of_fold([*grasps, fast], SETTING)
    module = fast.modules["thumb"]
    assert len(found["thumb"]) == module.n_samples
    states = found["thumb"].argmax(axis=1) + 1
    right = states == module.label_states
    assert right[module.times > 1.3].mean() > 0.8


def test_one_classifier_for_all_fingers(grasps):
    found = list(out_of_fold(grasps, replace(SETTING, shared=True)))
    assert [list(each) for _, each in found] == 4 * [["thumb", "index"]]
    assert np.isfinite(found[0][1]["index"][150:]).all()


def test_one_recording_only(grasps):
    assert refusal(TrainingError, grasps[:1]) == (
        "an audit compares the labels of a recording with those of others: at least 2 "
        "recordings expected, 1 given"
    )


def test_no_labels(grasps):
    assert refusal(TrainingError, [each.with_labels({}) for each in grasps]) == (
        "none of the 4 recordings has labels to audit"
    )


def test_one_state_only():
    calm = [tiny_recording(k, states=4 * [STABLE]) for k in range(2)]
    assert refusal(TrainingError, calm) == (
        "a finger with at least two labelled states expected, thumb STABLE, index STABLE given"
    )


def test_one_object_only(grasps):
    same = [replace(each, metadata={"object": "can"}) for each in grasps]
    assert refusal(TrainingError, same, replace(SETTING, split="object")) == (
        "the split by object needs at least two, 1 given (can); the split by time needs one "
        "recording"
    )


def test_invalid_settings(grasps):
    assert refusal(ValueError, grasps, Setting(split="random")) == (
        "split recording or object expected for an audit, random given: it trains on "
        "neighbours of the samples that are audited"
    )
    assert refusal(ValueError, grasps, n_folds=1) == "at least 2 folds expected, 1 given"


def test_a_finger_without_samples(grasps):
    empty = Tactile(TINY, np.empty(0), np.empty((0, 1, 3)))
    given = Recording("half", {"thumb": tiny_recording(8).modules["thumb"], "index": empty})
    *_, (_, found) = out_of_fold([*grasps, given], SETTING)
    assert found["index"].shape == (0, 3)
