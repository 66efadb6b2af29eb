import numpy as np
import pytest

from holdfast.twin.control import (
    COMPENSATION,
    GLITCH_ERROR,
    GLITCH_TICKS,
    PROPORTIONAL,
    draw_controller,
)
from holdfast.twin.steps import DERIVATIVE, ENCODER_STEP, TORQUE_LIMIT, TORQUE_STEP, control

PERIOD = 1 / 350
GLITCH_RATE = 0.12


def draw(seed=0, duration=60.0):
    return draw_controller(np.random.default_rng(seed), duration, PERIOD, GLITCH_RATE)


@pytest.fixture
def plain():
    """Without noise or glitches."""
    drawn = draw()
    return drawn._replace(noise=np.zeros_like(drawn.noise), errors=np.zeros_like(drawn.errors))


def torques(controller, joints, target, bias=0.0, tick=0):
    out = np.full(22, 7.0)
    wide = np.broadcast_to(np.asarray(joints, dtype=float), 16).copy()
    wanted = np.broadcast_to(np.asarray(target, dtype=float), 16).copy()
    control(controller, tick, wide, np.full(16, bias), wanted, PERIOD, out)
    assert (out[16:] == 7.0).all()  # the object's are not written
    return out[:16]


def test_a_set_point_off_by_a_little_gives_a_proportional_torque(plain):
    got = torques(plain, 0.0, 0.05)
    np.testing.assert_allclose(got, PROPORTIONAL * 0.05, atol=0.5 * TORQUE_STEP + 1e-12)


def test_speed_is_damped(plain):
    torques(plain, 0.0, 0.0)
    got = torques(plain, 0.005, 0.005, tick=1)
    speed = ENCODER_STEP * np.rint(0.005 / ENCODER_STEP) / PERIOD
    np.testing.assert_allclose(got, -DERIVATIVE * speed, atol=0.6 * TORQUE_STEP)


def test_gravity_is_compensated_by_the_share_drawn(plain):
    got = torques(plain, 0.0, 0.0, bias=0.4)
    np.testing.assert_allclose(got, 0.4 * plain.compensation, atol=0.5 * TORQUE_STEP + 1e-12)
    assert COMPENSATION[0] <= plain.compensation.min() < plain.compensation.max() <= COMPENSATION[1]


@pytest.mark.parametrize("target", [-3.0, 3.0])
def test_torques_never_pass_their_limit(target):
    controller = draw()
    for tick in range(500):
        assert np.abs(torques(controller, 0.0, target, tick=tick)).max() <= TORQUE_LIMIT


def test_torques_come_in_steps(plain):
    got = torques(plain, 0.1234567, 0.2)
    np.testing.assert_allclose(got / TORQUE_STEP, np.rint(got / TORQUE_STEP), atol=1e-9)


def test_angles_come_in_steps_of_the_encoder(plain):
    assert pytest.approx(np.radians(333.3 / 65536)) == ENCODER_STEP
    assert (torques(plain, 0.4 * ENCODER_STEP, 0.1) == torques(plain, 0.0, 0.1)).all()
    np.testing.assert_allclose(plain.last, 0.0)
    torques(plain, 0.6 * ENCODER_STEP, 0.1)
    np.testing.assert_allclose(plain.last, ENCODER_STEP)


class TestGlitches:
    @pytest.mark.slow
    def test_are_as_frequent_short_and_large_as_documented(self):
        errors = draw(0, 3000.0).errors
        struck = errors.any(axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], struck, [False]]).astype(int)))
        lengths = edges[1::2] - edges[::2]
        assert len(lengths) / 3000 == pytest.approx(GLITCH_RATE, rel=0.15)
        assert lengths.min() >= GLITCH_TICKS[0]
        assert np.median(lengths) < GLITCH_TICKS[1]
        sizes = errors[edges[::2]]
        assert sizes[sizes != 0].std() == pytest.approx(GLITCH_ERROR, rel=0.1)

    def test_move_the_set_point(self, plain):
        errors = plain.errors.copy()
        errors[2, 4:8] = 0.05
        struck = plain._replace(errors=errors)
        assert not torques(struck, 0.0, 0.0, tick=1).any()
        got = torques(struck, 0.0, 0.0, tick=2)
        np.testing.assert_allclose(got[4:8], PROPORTIONAL[4:8] * 0.05, atol=TORQUE_STEP)
        assert not got[:4].any()
        assert not got[8:].any()
