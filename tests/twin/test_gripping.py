import msgspec
import numpy as np
import pytest

from holdfast.twin.grasp import Pressing, closing_path
from holdfast.twin.hand import JOINTS
from holdfast.twin.loads import Load, LoadKind
from holdfast.twin.objects import object_named
from holdfast.twin.profile import profile
from holdfast.twin.protocol import THUMB_SHARE, Plan
from holdfast.twin.simulation import Grasp, Simulation, simulate

pytestmark = pytest.mark.slow

CALM = msgspec.structs.replace(profile("reference"), hold=1.5, glitch_rate=0.0)
DEPTHS = np.array([-0.012, -0.01, -0.008, -0.009])


def plan(grip=2.5, unused=(), profile=CALM):
    grips = np.array([THUMB_SHARE * grip * 3, grip, grip, grip])
    grips[list(unused)] = 0.0
    return Plan(profile, grips, 0.03, 0.55, 0.1, ())


@pytest.fixture(scope="module")
def can_path():
    return closing_path(object_named("can"))


class TestPressing:
    def test_an_error_along_the_path_is_found_whole(self, can_path):
        pressing = Pressing(can_path, DEPTHS, can_path.targets(DEPTHS + 0.001))
        ahead = can_path.targets(DEPTHS) - can_path.targets(DEPTHS + 0.001)
        moved = pressing.displacement(np.full(4, 2.0)) / pressing.displacement(np.full(4, 1.5))
        np.testing.assert_allclose(moved, 2.0)
        moved = pressing.displacement(np.full(4, 2.0))
        assert ahead @ moved / np.linalg.norm(ahead) / np.linalg.norm(moved) > 0.999

    def test_each_finger_has_its_own_scale_and_1_is_nothing(self, can_path):
        pressing = Pressing(can_path, DEPTHS, can_path.targets(DEPTHS + 0.002))
        moved = pressing.displacement(np.array([1.0, 2.0, 1.0, 0.5]))
        assert not moved[JOINTS["thumb"] : JOINTS["thumb"] + 4].any()
        assert not moved[JOINTS["middle"] : JOINTS["middle"] + 4].any()
        assert moved[JOINTS["index"] : JOINTS["index"] + 4].any()


def test_a_fixed_command_changes_no_byte():
    """Steps with a scale of 1, read one by one, are the recording of a grasp."""
    grasp = Grasp("box", 2, 1, profile="finger-vigorous", seed=3)
    whole = simulate(grasp)
    stepped, samples = Simulation(grasp), []
    while not stepped.is_over:
        stepped.step(np.ones(4))
        samples.append(stepped.read())
    again = stepped.recording()
    assert again.digest == whole.digest
    for finger, module in whole.modules.items():
        np.testing.assert_array_equal(again.modules[finger].readings, module.readings)
        np.testing.assert_array_equal([one[finger] for one in samples], module.readings)
        assert again.modules[finger].labels == module.labels
    for name, values in whole.truth.hand.items():
        np.testing.assert_array_equal(again.truth.hand[name], values)


def held(scales=None, loads=(), until=1.4, **given):
    """Loads of the fingertips at the end of a hold, and whether the object was lost."""
    simulation = Simulation(Grasp("can", 1, 1), plan=plan(**given), loads=loads)
    while simulation.held_for < until and not simulation.is_over:
        simulation.step(scales if simulation.held_for > 0.5 else None)
    return simulation


def test_a_scale_of_2_doubles_the_force_within_10_percent():
    before, after = held(grip=1.0), held(np.full(4, 2.0), grip=1.0)
    ratio = after.world.loads.sum() / before.world.loads.sum()
    assert ratio == pytest.approx(2.0, rel=0.1)


def test_more_force_holds_a_weight_that_is_lost_without_it():
    weight = [Load(LoadKind.WEIGHT, 0.8, 0.0, 0.35)]
    assert held(loads=weight, grip=1.2).protocol.lost_at is not None
    assert held(np.full(4, 2.2), loads=weight, grip=1.2).protocol.lost_at is None


def test_friction_that_drops_and_an_acceleration_make_it_slip():
    slippery = [Load(LoadKind.FRICTION, 0.6, 0.0, 0.4)]
    moved = [Load(LoadKind.TRANSPORT, 0.6, 0.6, 25.0, (0.0, 0.0, 1.0))]
    for loads in (slippery, moved):
        assert held(loads=loads, grip=1.2).protocol.lost_at is not None


def test_a_finger_may_stay_open_and_the_hand_can_release_early():
    simulation = held(unused=(3,))
    assert simulation.protocol.locked_at is not None
    assert simulation.world.loads[3] == 0.0
    simulation.protocol.release(simulation.time)
    for _ in range(150):
        simulation.step(np.ones(4))
    assert not simulation.world.loads.any()
