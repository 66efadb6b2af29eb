import numpy as np
import pytest

from holdfast.twin.loads import RISE_TIME, Load, LoadKind, load_state

UP = (0.0, 0.0, 1.0)


def test_nothing_acts_before_its_start():
    loads = [Load(kind, 1.0, 0.5, 0.5, UP, 3.0) for kind in LoadKind]
    state = load_state(loads, 0.999)
    assert not state.force.any()
    assert not state.acceleration.any()
    assert state.friction == 1.0


def test_weight_and_friction_stay():
    loads = [Load(LoadKind.WEIGHT, 0.0, 0.0, 0.2), Load(LoadKind.FRICTION, 0.0, 0.0, 0.5)]
    half, late = load_state(loads, RISE_TIME / 2), load_state(loads, 50.0)
    np.testing.assert_allclose(late.force, [0, 0, -0.2 * 9.81])
    np.testing.assert_allclose(half.force, late.force / 2)
    assert (half.friction, late.friction) == (pytest.approx(0.75), 0.5)


def test_a_pull_swells_and_fades():
    pull = [Load(LoadKind.PULL, 1.0, 2.0, 3.0, (1.0, 0.0, 0.0))]
    forces = [load_state(pull, time).force[0] for time in (1.0, 2.0, 2.999, 3.5)]
    assert forces == pytest.approx([0.0, 3.0, 0.0, 0.0], abs=1e-4)


def test_a_turn_turns_gravity_and_brings_it_back():
    turn = [Load(LoadKind.TURN, 0.0, 2.0, np.pi / 2, (1.0, 0.0, 0.0))]
    down = np.array([[0, 0, -9.81] - load_state(turn, time).acceleration for time in (0, 1, 2)])
    np.testing.assert_allclose(np.linalg.norm(down, axis=1), 9.81)
    np.testing.assert_allclose(down[1], [0, -9.81, 0], atol=1e-9)  # half way: on its side
    np.testing.assert_allclose(down[[0, 2]], [[0, 0, -9.81]] * 2, atol=1e-9)


@pytest.mark.parametrize(("kind", "rate"), [(LoadKind.TRANSPORT, 0.0), (LoadKind.SHAKE, 4.0)])
def test_the_hand_rests_again_after_a_motion(kind, rate):
    """The integral of the acceleration, its speed, is 0 at the end."""
    motion = [Load(kind, 0.0, 1.0, 6.0, UP, rate)]
    times = np.linspace(0.0, 1.2, 24001)
    acceleration = np.array([load_state(motion, time).acceleration[2] for time in times])
    assert np.abs(acceleration).max() == pytest.approx(6.0, rel=0.01)
    assert abs(acceleration.mean() * 1.2) < 1e-3
    assert not acceleration[times > 1.0].any()
