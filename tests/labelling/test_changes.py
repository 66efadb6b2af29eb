import numpy as np
import pytest

from holdfast.labelling.changes import change_points

PERIOD = 1 / 150


def force_of(amplitude, noise=0.0, seed=0):
    generator = np.random.default_rng(seed)
    force = np.outer(amplitude, [0.9, 0.3, -0.3])
    return force + generator.normal(0.0, noise, force.shape) if noise else force


def grasp():
    """Closing from 2 to 3 s, a push from 5 to 5.3 s, let go from 8 to 8.4 s."""
    times = np.arange(1500) * PERIOD
    corners = ([0, 2, 3, 5, 5.15, 5.3, 8, 8.4, 10], [0, 0, 100, 100, 140, 100, 100, 0, 0])
    return times, np.interp(times, *corners)


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_changes_are_found_where_they_are(noise):
    times, amplitude = grasp()
    found = change_points(times, force_of(amplitude, noise), PERIOD)
    for corner in (2, 3, 5, 5.3, 8, 8.4):
        assert np.abs(found - corner).min() <= 0.04, corner
    assert len(found) <= 8


def test_a_steady_force_has_none():
    times = np.arange(9000) * PERIOD
    assert len(change_points(times, force_of(np.full(9000, 50.0), 1.0), PERIOD)) <= 3
    assert len(change_points(times, force_of(np.full(9000, 50.0)), PERIOD)) == 0
    assert len(change_points(times, force_of(np.zeros(9000)), PERIOD)) == 0


def test_a_change_of_scale_changes_nothing():
    times, amplitude = grasp()
    force = force_of(amplitude, 0.5)
    one, other = (change_points(times, k * force, PERIOD) for k in (1.0, 1e-3))
    np.testing.assert_array_equal(one, other)


def test_unknown_forces_are_left_out():
    times, amplitude = grasp()
    force = force_of(amplitude)
    force[:75] = np.nan
    found = change_points(times, force, PERIOD)
    assert np.abs(found - 2).min() <= 0.04
    assert len(change_points(times, np.full_like(force, np.nan), PERIOD)) == 0
    assert len(change_points(times[:3], force[-3:], PERIOD)) == 0
