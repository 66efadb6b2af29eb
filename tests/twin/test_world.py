import numpy as np
import pytest

from holdfast.contact import Phase
from holdfast.twin.control import STEPS_PER_CONTROL, draw_controller
from holdfast.twin.grasp import closing_path, object_pose
from holdfast.twin.hand import RATE, TIMESTEP, HandModel
from holdfast.twin.objects import object_named
from holdfast.twin.operator import Disturbance, draw_tremor
from holdfast.twin.profile import profile
from holdfast.twin.protocol import OPEN_GAP, Command, Plan
from holdfast.twin.world import GRAVITY, MIN_HEIGHT, World

PATH = closing_path(object_named("can"))
DOWN = Disturbance(0.0, 1.0, "down", 0, np.array([0.0, 0, -1, 0, 0, 0, 0.006, 700, 4]))


def world(seed=0, start=(0.0, 0.0, 0.0, 0.0)):
    random = np.random.default_rng(seed)
    item = object_named("can")
    controller = draw_controller(random, 5.0, STEPS_PER_CONTROL * TIMESTEP, 0.12)
    calm = controller._replace(errors=np.zeros_like(controller.errors))
    tremors = np.stack([draw_tremor(random), draw_tremor(random)])
    return World(HandModel.build(item), item, PATH, calm, tremors, np.array(start))


def plan(disturbances=()):
    return Plan(profile("reference"), np.full(4, 2.0), 0.02, 1.0, 1.0, disturbances)


def command(hold=1.0, depth=OPEN_GAP, disturbance=-1, elapsed=0.0):
    return Command(np.full(4, depth), hold, disturbance, elapsed, Phase.FREE)


def run(made, seconds, **words):
    anchor = words.pop("anchor", made.bodies[-1, :12].copy())
    given = plan([DOWN])
    for k in range(round(seconds * RATE)):
        elapsed = k / RATE if words.get("disturbance", -1) >= 0 else 0.0
        made.advance(command(**words, elapsed=elapsed), given, anchor)
    return made


def test_begins_as_the_object_is_put_there():
    made = world(start=(0.001, -0.002, 0.003, 0.1))
    position, turn = object_pose(object_named("can"))
    np.testing.assert_allclose(made.bodies[-1, :3], position + np.array([0.001, -0.002, 0.003]))
    assert np.arctan2(made.bodies[-1, 6], made.bodies[-1, 3]) == pytest.approx(turn + 0.1)
    assert not made.loads.any()
    assert made.slip == 0.0


def test_a_fallen_object_stays_below_the_picture():
    made = run(world(), 1.0, hold=0.0)
    low = made.bodies[-1, 2]
    assert MIN_HEIGHT - 0.2 < low < MIN_HEIGHT
    run(made, 1.0, hold=0.0)
    assert made.bodies[-1, 2] == pytest.approx(low, abs=0.01)
    assert np.linalg.norm(made.bodies[-1, 12:]) < 0.1
    assert np.isfinite(made.hand.data.qpos).all()


def test_closed_fingers_press_and_hold_it_alone():
    made = world()
    anchor = made.bodies[-1, :12].copy()
    given = plan()
    for depth in np.linspace(OPEN_GAP, -0.02, round(2.0 * RATE)):
        made.advance(command(depth=depth), given, anchor)
    assert (made.loads > 0.3).all()
    height = made.bodies[-1, 2]
    run(made, 1.5, hold=0.0, depth=-0.02)
    assert height - made.bodies[-1, 2] < 0.01
    force = made.contact.wrench[:3]
    np.testing.assert_allclose(force, [0, 0, GRAVITY * 0.24], atol=0.1)
    assert not made.outside.any()
    pressed = made.loads.copy()
    run(made, 0.5, hold=0.0, depth=-0.02, disturbance=0)
    assert made.outside[2] < -0.5
    assert not made.outside[:2].any()
    assert (made.loads != pressed).any()
