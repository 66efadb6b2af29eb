"""Methods on the details of the Haar window."""

import numpy as np
import pytest

from holdfast.detection import FEATURE_NAMES, Tare, haar_features
from holdfast_lab.study.methods import METHODS, hand_signal
from holdfast_lab.study.methods.wavelets import detail_energy, normal_energy
from training.build import tiny_recording

from .patch_signals import along_normal, pressed

NAN = np.nan


def test_energy_by_hand():
    # Windows of 4: pairs (1, 3) (3, 2), (3, 3) (2, 6), (3, 2) (6, 6).
    # E: (4 + 1) / 2, (0 + 16) / 2, (1 + 0) / 2.
    hand = pressed(along_normal([1, 3, 3, 2, 6, 6]))
    found = normal_energy(hand, window=4)["index"]
    np.testing.assert_allclose(found[:, 0], [NAN, NAN, NAN, 2.5, 8.0, 0.5])


def test_energy_is_spread_and_mean_of_the_details():
    """Of the same details, E = N_w sigma^2 + (sum d)^2 / (N_w / 2): sigma leaves the mean out."""
    values = np.random.default_rng(0).normal(size=200).cumsum() + 100
    sigma = haar_features(along_normal(values), 14)[:, 5]
    steps = [(values[k - 13 : k + 1 : 2] - values[k - 12 : k + 1 : 2]) for k in range(13, 200)]
    means = np.sum(steps, axis=1) / np.sqrt(2) / 7
    np.testing.assert_allclose(detail_energy(values)[13:], 14 * sigma[13:] ** 2 + 7 * means**2)


def test_two_features_on_logarithmic_scales():
    hand = hand_signal(tiny_recording(0), Tare.parse("0.5"))
    for name, rows in METHODS["log_two"].features(hand).items():
        force = hand.fingers[name].force
        six = haar_features(force[np.isfinite(force).all(axis=1)], 14)[13:]
        expected = np.log10(six[:, [FEATURE_NAMES.index("F_a"), FEATURE_NAMES.index("sigma")]])
        assert rows[-len(six) :] == pytest.approx(expected)


def test_the_largest_sigma_of_all_fingers_as_each_finger_knows_it():
    hand = hand_signal(tiny_recording(0), Tare.parse("0.5"))
    two, three = (METHODS[name].features(hand) for name in ("log_two", "log_hand"))
    times = {name: finger.times for name, finger in hand.fingers.items()}
    assert len(times) > 1
    for name, rows in three.items():
        assert rows[:, :2] == pytest.approx(two[name], nan_ok=True)
        for k in range(0, len(rows), 7):
            latest = [
                two[other][np.searchsorted(own, times[name][k], side="right") - 1, 1]
                for other, own in times.items()
            ]
            known = [value for value in latest if np.isfinite(value)]
            assert rows[k, 2] == pytest.approx(max(known, default=np.nan), nan_ok=True)
