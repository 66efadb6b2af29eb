import math

import numpy as np
import pytest

from holdfast.twin.loads import Load, LoadKind
from holdfast.twin.simulation import Grasp
from holdfast_lab.trial.needed_force import (
    NEED_RATE,
    NeededForce,
    Patch,
    least_normal_force,
    needed_force,
)
from holdfast_lab.trial.run import least_force_at
from holdfast_lab.trial.trials import Trial

LIFT = np.array([0.0, 0.0, 2.0])


def patch(x, z=0.0, size=0.004):
    """A patch at a position on the x axis that pushes towards the middle."""
    corners = size * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    return Patch(corners + np.array([x, 0.0, z]), np.array([-np.sign(x), 0.0, 0.0]))


class TestLeastNormalForce:
    def test_two_opposite_fingers_carry_a_weight_by_friction(self):
        least = least_normal_force([patch(0.03), patch(-0.03)], LIFT, 0.5)
        assert least == pytest.approx(2.0 / 0.5, rel=0.02)
        assert least >= 2.0 / 0.5 - 1e-9

    def test_a_moment_needs_more_force_than_the_weight_alone(self):
        """Beside the centre of mass by more than their size, fingers must push it level."""
        level = least_normal_force([patch(0.03), patch(-0.03)], LIFT, 0.5)
        beside = [
            Patch(side.points + np.array([0.0, 0.006, 0.0]), side.normal)
            for side in (patch(0.03), patch(-0.03))
        ]
        assert 1.1 * level < least_normal_force(beside, LIFT, 0.5) < math.inf


def test_a_trial_is_infeasible_where_no_force_holds_for_long():
    holds = np.ones(60)
    gap = round(0.1 * NEED_RATE)
    short, long = holds.copy(), holds.copy()
    short[10 : 10 + gap] = math.inf
    long[10 : 11 + gap] = math.inf
    assert NeededForce(holds, short).feasible
    assert not NeededForce(holds, long).feasible


@pytest.mark.slow
def test_of_a_can_it_is_that_of_coulomb_and_kinetic_friction_needs_more():
    can = Trial(0, Grasp("can", 1, 1, seed=0), 4, Load(LoadKind.WEIGHT, 1.5, 0.0, 0.4), 0.03)
    item, needed = can.grasp.item, needed_force(can)
    for held_for in (1.0, 3.0):
        to_hold, to_stop = needed.at(held_for)
        assert to_hold == pytest.approx(least_force_at(can, held_for), rel=0.06)
        assert to_stop == pytest.approx(to_hold * item.mu_static / item.mu_kinetic, rel=0.1)
