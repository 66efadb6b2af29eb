"""Replay of the decision rule: the states of the detector, for any threshold."""

import msgspec
import numpy as np
import pytest

from holdfast.contact import STABLE
from holdfast.detection import Debounce, parse_features
from holdfast.metrics import match_decisions
from holdfast.training import Setting, compute_decisions, train
from holdfast.training.replay import ThresholdReplay

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
    expected = compute_decisions(own.with_threshold("stable", threshold), recording).hand
    found = ThresholdReplay.of(own, recording).hand(threshold)
    np.testing.assert_array_equal(found.times, expected.times)
    np.testing.assert_array_equal(found.labels, expected.labels)
    np.testing.assert_array_equal(found.states, expected.states)
    assert len(set(found.states.tolist())) > 1
    assert match_decisions(found) == match_decisions(expected)


def test_a_lower_threshold_is_stable_more_often(model):
    replay = ThresholdReplay.of(model, tiny_recording(21))
    stable = [(replay.hand(p).states == STABLE).sum() for p in (0.999, 0.5, 0.001)]
    assert stable == sorted(stable)
    assert stable[0] < stable[-1]


def test_the_threshold_is_that_of_all_fingers(model):
    changed = model.with_threshold("stable", 0.25)
    assert {part.stable.threshold for part in changed.fingers.values()} == {0.25}
    assert changed.with_threshold("stable", 0.5).fingers.keys() == model.fingers.keys()
