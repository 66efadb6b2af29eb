import numpy as np

from holdfast.study.methods import METHODS
from holdfast.study.methods.anyskin import three

from .build import pressed


def test_by_hand():
    # Two taxels, windows of 2; the normal has no say.
    # Samples: (1, 2) (0, -1); (3, 2) (0, 1); (3, -6) (0, 1). The deviation of two values is
    # half their difference.
    shear = np.array([[[1, 2], [0, -1]], [[3, 2], [0, 1]], [[3, -6], [0, 1]]], dtype=float)
    found = three(shear, window=2)
    first = [3 - -1, 1 + 2 + 0 - 1 + 3 + 2 + 0 + 1, 1 + 0 + 0 + 1]
    second = [3 - -6, abs(3 + 2 + 0 + 1 + 3 - 6 + 0 + 1), 0 + 4 + 0 + 0]
    np.testing.assert_allclose(found, [[np.nan] * 3, first, second])


def test_ten_samples_of_the_tared_shear():
    readings = np.random.default_rng(0).normal(size=(40, 3, 3)) * 20
    found = METHODS["anyskin"].features(pressed(readings))["index"]
    assert np.isnan(found[:9]).all()
    for k in range(9, 40):
        window = readings[k - 9 : k + 1, :, :2]
        wanted = [window.max() - window.min(), abs(window.sum()), window.std(axis=0).sum()]
        np.testing.assert_allclose(found[k], wanted)
