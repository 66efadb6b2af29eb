import numpy as np
import pytest

from benchmark_script import load
from holdfast.detection import DEFAULT_WINDOW, haar_features

pytestmark = pytest.mark.slow

speed = load("speed")


@pytest.fixture(scope="module")
def force():
    walk = np.random.default_rng(0).normal(size=(400, 3)).cumsum(axis=0)
    return walk + np.array([300.0, 0.0, 0.0])


@pytest.mark.parametrize(("peer", "name"), [("pywt", "pywt_loop"), ("scipy", "scipy_features")])
def test_a_peer_computes_the_same(force, peer, name):
    pytest.importorskip(peer)
    full = slice(DEFAULT_WINDOW - 1, None)
    expected = haar_features(force, DEFAULT_WINDOW)[full]
    found = getattr(speed, name)(force)[full]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * 300)


def test_tsflex_computes_the_same(force):
    pytest.importorskip("tsflex")
    (frame,) = speed.tsflex_task(force)()
    table = {name.split("__")[1]: column for name, column in frame.items()}
    expected = haar_features(force, DEFAULT_WINDOW)[DEFAULT_WINDOW - 1 :]
    for name, column in (("m", 4), ("sigma", 5)):
        values = table[name].to_numpy()
        # Its windows end before the instant that they are stamped with: the last one is missing.
        np.testing.assert_allclose(values, expected[: len(values), column], rtol=0, atol=1e-9 * 300)
        assert len(expected) - len(values) <= 1
