"""Trees over the paper's six features."""

import numpy as np

from holdfast.features import FEATURE_NAMES, Tare, haar_features
from holdfast.study.methods import METHODS, hand_signal
from training.build import tiny_recording


def test_the_papers_six_features():
    hand = hand_signal(tiny_recording(0), Tare.parse("0.5"))
    found = METHODS["trees"].features(hand)
    assert list(found) == ["thumb", "index"]
    for name, rows in found.items():
        force = hand.fingers[name].force
        known = np.isfinite(force).all(axis=1)
        assert rows.shape == (len(force), len(FEATURE_NAMES))
        assert np.array_equal(rows[known], haar_features(force[known], 14), equal_nan=True)
        assert np.isnan(rows[~known]).all()


def test_what_it_is():
    method = METHODS["trees"]
    assert (method.name, method.category, method.recipe.name) == ("trees", "learning", "trees")
    assert not method.whole_hand
