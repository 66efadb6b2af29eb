import numpy as np
import pytest

from holdfast.study.methods import METHODS
from holdfast.study.methods.signals import NEWTONS_PER_COUNT
from holdfast.study.methods.slip_servo import band_pass, high_pass
from holdfast.twin.uskin_parameters import UskinParameters

from .build import along_normal, pressed

SERVO = METHODS["slip_servo"]
RATE = 10 * np.pi
"""At which a = 1 / (1 + 2 pi 5 / rate) = 1 / 2."""


def test_high_pass_by_hand():
    # y_0 = 0, then y_k = (y_(k-1) + x_k - x_(k-1)) / 2.
    found = high_pass(np.array([10.0, 14.0, 14.0, 6.0, 7.0]), RATE)
    np.testing.assert_allclose(found, [0, 2, 1, -3.5, -1.25])


def test_high_pass_of_a_sum_is_the_sum_of_high_passes():
    pads = np.random.default_rng(0).normal(size=(15, 80))
    np.testing.assert_allclose(
        high_pass(pads.sum(axis=0), 150.0), sum(high_pass(pad, 150.0) for pad in pads), atol=1e-12
    )


@pytest.mark.parametrize(("frequency", "gain"), [(0.8, 0.5), (2.0, 1.0), (5.0, 0.5), (40.0, 0.0)])
def test_band_pass_lets_its_band_through(frequency, gain):
    """Half the power at the ends of the band, all of it at their geometric mean."""
    times = np.arange(6000) / 150.0
    found = band_pass(np.sin(2 * np.pi * frequency * times), 150.0)[3000:]
    assert 2 * (found**2).mean() == pytest.approx(gain, abs=0.02)


def test_the_ratio_by_hand():
    # Newtons, the rate at which a = 1 / 2. |F_hp| after the step of 0.02 N is 0.01 N, and
    # 0.007 |F| is under 0.048 N; the grip does not change yet: |F_bp| < 0.18 N.
    hand = pressed(along_normal([1.0, 1.02, 1.02]), RATE, "N")
    found = SERVO.features(hand)["index"][:, 0]
    np.testing.assert_allclose(found, [0, 0.01 / 0.048, 0.005 / 0.048])


@pytest.mark.parametrize(("held", "least"), [(2.0, 0.048), (10.0, 0.07), (50.0, 0.2)])
def test_the_threshold_grows_with_the_force_between_its_limits(held, least):
    hand = pressed(along_normal([held, held + 0.1]), RATE, "N")
    threshold = np.clip(0.007 * (held + 0.1), 0.048, 0.2)
    assert threshold == pytest.approx(least, rel=0.02)
    assert SERVO.features(hand)["index"][1, 0] == pytest.approx(0.05 / threshold)


def test_nothing_is_slip_while_the_grip_changes():
    closing = np.concatenate([np.zeros(50), np.linspace(0, 20, 100)])
    found = SERVO.features(pressed(along_normal(closing), 150.0, "N"))["index"][:, 0]
    slow = np.abs(band_pass(closing, 150.0))
    fast = np.abs(high_pass(closing, 150.0))
    assert (slow[80:] > 0.18).all()
    assert (fast[80:] > 0.2).all()
    assert (found[80:] == 0).all()


def test_counts_are_nominal_newtons():
    newtons = along_normal(np.random.default_rng(0).normal(size=100) * 0.05 + 3)
    counts = newtons / 0.000729
    one, two = (pressed(newtons, 150.0, "N"), pressed(counts, 150.0, "count"))
    np.testing.assert_allclose(SERVO.features(one)["index"], SERVO.features(two)["index"])


def test_a_nominal_newton_is_the_twins():
    assert UskinParameters().counts_per_newton[2] == pytest.approx(1 / NEWTONS_PER_COUNT)
