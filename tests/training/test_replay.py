"""Replay of the decision rule: the states of the detector, for any threshold."""

import msgspec
import numpy as np
import pytest

from holdfast.features import parse_features
from holdfast.model import Debounce
from holdfast.training import Setting, compute_decisions, train
from holdfast.training.threshold import ThresholdReplay, alarms, stable_counts, with_threshold

from .build import tiny_recording

DEBOUNCES = (Debounce(), Debounce(hold=0.1), Debounce(hysteresis=0.2), Debounce(0.05, 0.1, 0.1))


@pytest.fixture(scope="module")
def model(grasps):
    setting = Setting(window=6, features=parse_features("F_a,F_x,sigma", 6), trials=0)
    return train(grasps, setting).model


@pytest.mark.parametrize("debounce", DEBOUNCES)
@pytest.mark.parametrize("threshold", [0.02, 0.5, 0.9])
def test_it_gives_the_states_of_the_detector(model, debounce, threshold):
    own = msgspec.structs.replace(model, debounce=debounce)
    recording = tiny_recording(20)
    expected = compute_decisions(with_threshold(own, threshold), recording).hand
    found = ThresholdReplay.of(own, recording).hand(threshold)
    np.testing.assert_array_equal(found.times, expected.times)
    np.testing.assert_array_equal(found.labels, expected.labels)
    np.testing.assert_array_equal(found.states, expected.states)
    assert len(set(found.states.tolist())) > 1
    assert alarms(found) == alarms(expected)


def test_a_lower_threshold_is_stable_more_often(model):
    replay = ThresholdReplay.of(model, tiny_recording(21))
    counts = [stable_counts(replay.hand(p)) for p in (0.999, 0.5, 0.001)]
    decided = [each["decided"] for each in counts]
    assert decided == sorted(decided)
    assert decided[0] < decided[-1] <= counts[0]["labelled"]


def test_the_threshold_is_that_of_all_fingers(model):
    changed = with_threshold(model, 0.25)
    assert {part.stable.threshold for part in changed.fingers.values()} == {0.25}
    assert with_threshold(changed, 0.5).fingers.keys() == model.fingers.keys()
