"""The plants: their names, and each mechanism on a signal."""

import numpy as np
import pytest

from holdfast.twin.control import GLITCH_ERROR, draw_controller
from holdfast.twin.hand import N_JOINTS, RATE
from holdfast.twin.plant import PLANTS
from holdfast.twin.simulation import Grasp, Simulation
from holdfast.twin.steps import control

PERIOD = 1 / 350
HARD = PLANTS["hard"]


def drawn(**changes):
    controller = draw_controller(np.random.default_rng(0), 60.0, PERIOD, 0.5, **changes)
    return controller._replace(noise=np.zeros_like(controller.noise))


def encoders(controller, angles):
    """Angles of the encoders while all joints follow a signal."""
    torques, seen = np.zeros(N_JOINTS), []
    for tick, angle in enumerate(angles):
        joints = np.full(N_JOINTS, angle)
        control(controller, tick, joints, np.zeros(N_JOINTS), joints, PERIOD, torques)
        seen.append(controller.geared[0])
    return np.array(seen)


def test_an_unknown_plant_names_those_that_exist():
    with pytest.raises(ValueError, match="'soft'"):
        Simulation(Grasp("can", 1, 1, plant="soft"))


class TestBacklash:
    signal = 0.5 + 0.05 * np.sin(np.linspace(0, 4 * np.pi, 400))

    def test_without_it_the_encoder_is_the_joint(self):
        np.testing.assert_array_equal(encoders(drawn(), self.signal), self.signal)

    def test_the_encoder_rests_in_the_play(self):
        width = HARD.backlash
        seen = encoders(drawn(backlash=width), self.signal)
        assert np.abs(seen - self.signal).max() == pytest.approx(width / 2)
        turn = int(np.argmax(self.signal))
        resting = np.flatnonzero(seen == seen[turn])
        moved = self.signal[turn] - self.signal[resting].min()
        assert 0.8 * width < moved <= width

    def test_a_motion_smaller_than_the_play_is_not_seen(self):
        signal = 0.5 + 0.4 * HARD.backlash * np.sin(np.linspace(0, 20, 300))
        assert np.ptp(encoders(drawn(backlash=HARD.backlash), signal)) == 0.0


def test_jerks_have_the_size_of_the_plant():
    mild, hard = drawn(), drawn(glitch_error=HARD.jerk_size)
    assert (mild.errors != 0).sum() == (hard.errors != 0).sum() > 0
    np.testing.assert_allclose(hard.errors, HARD.jerk_size / GLITCH_ERROR * mild.errors)


def test_the_published_angles_follow_as_the_filter_of_the_driver():
    controller = drawn()
    signal = np.r_[np.full(100, 1.0), np.full(100, 1.1)]
    published = []
    for tick, angle in enumerate(signal):
        joints = np.full(N_JOINTS, angle)
        control(controller, tick, joints, np.zeros(16), joints, PERIOD, np.zeros(16))
        published.append(controller.published[0])
    expected = [published[0]]
    for k in range(1, 200):
        old, new = (np.rint(signal[i] / STEP) * STEP for i in (k - 1, k))
        expected.append(0.6 * expected[-1] + 0.198 * (old + new))
    np.testing.assert_allclose(published, expected, atol=1e-12)


STEP = 333.3 / 65536 * np.pi / 180


class TestMotor:
    def followed(self, plant, n=40):
        simulation = Simulation(Grasp("can", 1, 1, plant=plant))
        return [float(simulation.followed(np.full(4, 2.0))[0]) for _ in range(n)]

    def test_a_mild_force_follows_at_once(self):
        assert self.followed("mild", 3) == [2.0] * 3

    def test_a_hard_force_follows_with_a_lag_of_the_first_order(self):
        times = np.arange(1, 41) / RATE
        expected = 2.0 - np.exp(-times / HARD.motor_time)
        np.testing.assert_allclose(self.followed("hard"), expected)
