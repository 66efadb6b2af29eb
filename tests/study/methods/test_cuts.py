import numpy as np
import pytest

from holdfast.features import FEATURE_NAMES, Tare, haar_features
from holdfast.study.methods import hand_signal
from holdfast.study.methods.cuts import CUTS, detail_sigma
from holdfast.study.methods.wavelets import detail_energy
from holdfast.synthetic import synthetic_recording


def test_sigma_is_the_papers():
    force = np.random.default_rng(0).normal(size=(60, 3))
    sigma = haar_features(force, 14)[:, FEATURE_NAMES.index("sigma")]
    assert detail_sigma(np.linalg.norm(force, axis=1)) == pytest.approx(sigma, nan_ok=True)


def test_sigma_and_energy_differ_by_the_mean_of_the_details():
    """A steady slope has energy and no sigma; else E = N_w sigma^2 + n (mean d)^2."""
    slope = 3.0 * np.arange(20)
    assert detail_sigma(slope)[13:] == pytest.approx(np.zeros(7))
    assert detail_energy(slope)[13:] == pytest.approx(np.full(7, 7 * 9 / 2))
    values = np.random.default_rng(1).normal(size=14)
    details = (values[0::2] - values[1::2]) / np.sqrt(2)
    expected = 14 * detail_sigma(values)[-1] ** 2 + 7 * details.mean() ** 2
    assert detail_energy(values)[-1] == pytest.approx(expected)


def test_each_has_one_feature_of_every_finger():
    hand = hand_signal(synthetic_recording("one", 0, ("thumb", "index")), Tare.parse("0.5"))
    thumb = hand.fingers["thumb"]
    for name, signal, measure in (
        ("sigma_cut", thumb.amplitude, detail_sigma),
        ("energy_cut", thumb.amplitude, detail_energy),
        ("energy_x_cut", thumb.pressing, detail_energy),
    ):
        features = CUTS[name].features(hand)
        assert set(features) == {"thumb", "index"}
        assert features["thumb"].shape == (len(thumb.times), 1)
        last = features["thumb"][-200:, 0]
        assert last == pytest.approx(np.log10(measure(signal)[-200:]))
