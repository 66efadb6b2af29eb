import numpy as np

from holdfast.study.methods import METHODS

from .build import pressed


def test_by_hand():
    hand = pressed([[0, 0, 0], [3, 4, 0], [3, 4, 12], [3, 4, 12]], rate=100.0)
    found = METHODS["difference"].features(hand)["index"]
    np.testing.assert_allclose(found[:, 0], [np.nan, 500, 1200, 0])
