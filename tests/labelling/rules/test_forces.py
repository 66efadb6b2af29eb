import numpy as np
import pytest

from holdfast.labelling.rules import forces
from holdfast.labelling.rules.forces import centre_of_pressure, final_drop, grip_force, hand_force
from holdfast.recordings import Recording, Tactile

from .build import CLOSING, FREE, GRIP, NOISE, PATCH, RELEASE, clock, grasp, module, profile


def test_the_tare_is_subtracted_from_the_first_sample_on():
    hand = hand_force(grasp())
    finger = hand.fingers["thumb"]
    assert finger.known.all()
    assert finger.amplitude[:10].max() < GRIP / 50
    assert grip_force(finger, finger.contact) == pytest.approx(GRIP, rel=0.02)


def test_noise_is_that_of_the_tare_stretch():
    noise = hand_force(grasp()).fingers["thumb"].noise
    alone = NOISE * np.sqrt(PATCH.n_taxels / 5)  # the sum of the taxels, the mean of 5 samples
    assert noise == pytest.approx(alone, rel=0.5)


def test_a_short_knock_is_not_the_grip_force():
    times = clock()
    force = GRIP * profile(times)
    force[500:505] *= 30
    finger = hand_force(Recording("knock", {"thumb": module(times, force)})).fingers["thumb"]
    touching = times[finger.contact]
    assert touching[0] == pytest.approx(CLOSING, abs=0.06)
    assert touching[-1] == pytest.approx(FREE, abs=0.06)


def test_modules_of_other_times_and_rates_share_a_grid():
    fast, slow = clock(), clock(rate=50.0) + 0.003
    modules = {
        "thumb": module(fast, GRIP * profile(fast)),
        "index": module(slow, GRIP * profile(slow)),
    }
    hand = hand_force(Recording("two", modules))
    assert all(len(each.force) == len(hand.times) for each in hand.fingers.values())
    one, two = (each.amplitude for each in hand.fingers.values())
    assert np.median(np.abs(one - two)) < GRIP / 100


def test_the_final_drop_of_the_force():
    times = clock()
    held = np.where(times < RELEASE, GRIP, 0.0)[:, None] * [0, 0, 1.0]
    held[:, 0] += GRIP / 10 * np.sin(3 * times)
    hand = hand_force(Recording("held", {"thumb": module(times, held)}), "first")
    assert times[final_drop(hand)] == pytest.approx(RELEASE, abs=0.05)


def test_the_centre_of_pressure_is_where_it_is_pressed():
    times = clock()
    load = GRIP * profile(times, 0.0)[:, 2]
    readings = np.zeros((len(times), PATCH.n_taxels, 3))
    readings[:, 5, 2] = load * (times < 6)
    readings[:, 10, 2] = load * (times >= 6)
    recording = Recording("one", {"thumb": Tactile(PATCH, times, readings)})
    centre = centre_of_pressure(recording.modules["thumb"], 0.5, hand_force(recording))
    assert centre[400] == pytest.approx(PATCH.positions[5])
    assert centre[800] == pytest.approx(PATCH.positions[10])
    assert np.isfinite(centre).all()


@pytest.mark.parametrize("n", [1, 2, 7, 38, 300])
def test_the_moving_mean_equals_that_of_scipy(n):
    from scipy.ndimage import uniform_filter1d

    for seed in range(20):
        values = np.random.default_rng(seed).normal(size=(1 + 9 * seed, 3)) * 1e3
        expected = uniform_filter1d(values, n, axis=0, mode="nearest")
        np.testing.assert_array_equal(forces.moving_mean(values, n), expected)
