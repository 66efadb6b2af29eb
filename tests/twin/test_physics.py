"""Seven steps against the same ones by other functions of the binding, bit by bit."""

import numpy as np
import pytest

from holdfast.twin.control import STEPS_PER_CONTROL, draw_controller
from holdfast.twin.grasp import closing_path
from holdfast.twin.hand import GRAVITY, SUBSTEPS, TIMESTEP, HandModel
from holdfast.twin.mujoco_import import mujoco
from holdfast.twin.objects import object_named
from holdfast.twin.operator import NO_GUIDE, draw_tremor
from holdfast.twin.physics import Action
from holdfast.twin.steps import (
    GUIDE_STIFFNESS,
    JERK,
    MOVE,
    PUSH,
    advance_sample,
    apply_forces,
    control,
    disturb_wrench,
    fill_bodies,
    guide_wrench,
    hold_wrench,
    touch,
)
from holdfast.twin.world import World

ITEM = object_named("can")
PATH = closing_path(ITEM)
GUIDE = np.concatenate([np.zeros(12), [0.01, 0, 0.02, 0, 0.1, 0], [800, 9, 0.7, 0.006, 1e-5]])
PUSHED = np.array([0.0, 0, -1, 0.01, 0, 0.02, 0.006, 700, 4])


def made_world():
    random = np.random.default_rng(4)
    controller = draw_controller(random, 5.0, STEPS_PER_CONTROL * TIMESTEP, 20.0)
    tremors = np.stack([draw_tremor(random), draw_tremor(random)])
    return World(HandModel.build(ITEM), ITEM, PATH, controller, tremors, np.zeros(4))


def action(made, style=-1, hold=1.0, elapsed=0.0, pull=(0.0,) * 6, guide=NO_GUIDE):
    anchor = made.bodies[-1, :12].copy()
    return Action(
        anchor, hold, GRAVITY * ITEM.mass, made.tremors, 1e-4, made.hand.data.time, PUSHED,
        anchor, style, 0.6, elapsed, np.array(pull), guided(guide, anchor),
    )  # fmt: skip


def guided(guide, anchor):
    """The guide, from the pose of the object on."""
    return np.concatenate([anchor, guide[12:]])


def step_from_python(made, tick, target, given):
    """Advance by one step, as the equations say; return the error of the set-points."""
    data, error = made.hand.data, 0.0
    mujoco.mj_step1(made.hand.model, data)
    fill_bodies(made.hand.arrays, made.bodies)
    touch(made.contact, made.constants, made.bodies, TIMESTEP)
    body, rms = made.bodies[-1], given.rms
    elapsed = given.elapsed + tick % SUBSTEPS * TIMESTEP
    outside = np.zeros(6)
    if given.hold > 0:
        weight, tremor = given.weight, given.tremors[0]
        outside += hold_wrench(body, given.anchor, given.hold, weight, tremor, rms, data.time)
    if given.style >= 0:
        outside += disturb_wrench(
            body, given.origin, given.parameters, given.style, given.duration, given.tremors[1],
            rms, elapsed,
        )  # fmt: skip
    if given.guide[GUIDE_STIFFNESS] > 0:
        ahead = data.time - given.time
        outside += guide_wrench(body, given.guide, ahead, given.tremors[1], data.time)
    total = outside + made.contact.wrench
    made.outside[:] = outside + given.pull
    apply_forces(made.hand.arrays, made.contact.tips, total + given.pull, made.bodies)
    if tick % STEPS_PER_CONTROL == 0:
        number, period = tick // STEPS_PER_CONTROL, STEPS_PER_CONTROL * TIMESTEP
        error = np.abs(made.controller.errors[number]).max()
        torques = data.qfrc_applied
        control(made.controller, number, data.qpos, data.qfrc_bias, target, period, torques)
    mujoco.mj_step2(made.hand.model, data)
    return error


ACTIONS = {
    "held": {},
    "pushed": {"style": PUSH, "hold": 0.0, "elapsed": 0.2},
    "struck while held": {"style": JERK, "hold": 0.5, "elapsed": 0.3},
    "moved": {"style": MOVE, "hold": 0.0, "elapsed": 0.1},
    "pulled": {"hold": 0.0, "pull": (0.1, -0.2, 0.3, 0.001, 0.0, -0.002)},
    "guided": {"hold": 0.0, "guide": GUIDE},
}


@pytest.mark.parametrize("words", ACTIONS.values(), ids=ACTIONS)
def test_a_sample_is_its_steps_called_from_python(words):
    compiled, plain = made_world(), made_world()
    worst, loads = [], 0.0
    for sample in range(60):
        target = PATH.targets(np.full(4, 0.003 - 6e-4 * sample))  # closes until it presses
        given = [action(one, **words) for one in (compiled, plain)]
        tick = sample * SUBSTEPS
        error = advance_sample(*compiled._half_steps, compiled._physics, tick, target, given[0])
        ticks = range(tick, tick + SUBSTEPS)
        worst.append(max(step_from_python(plain, tick, target, given[1]) for tick in ticks))
        assert error == worst[-1]
        assert compiled.hand.data.time == plain.hand.data.time
        for name in ("qpos", "qvel"):
            ours, theirs = (getattr(one.hand.data, name) for one in (compiled, plain))
            np.testing.assert_array_equal(ours, theirs)
        np.testing.assert_array_equal(compiled.outside, plain.outside)
        loads += compiled.loads.sum()
    for ours, theirs in zip(compiled.contact, plain.contact, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert loads > 0
    assert 0 < np.count_nonzero(worst) < len(worst)


@pytest.mark.parametrize(
    ("tick", "change"), [(-1, {}), (0, {"n_steps": -1}), (0, {"per_control": 0})]
)
def test_numbers_that_no_step_could_use_are_refused(tick, change):
    world = made_world()
    given = world._physics._replace(**change)
    with pytest.raises(ValueError, match="out of range"):
        advance_sample(*world._half_steps, given, tick, np.zeros(16), action(world))


@pytest.mark.parametrize("n_calls", [1, 2, 3, 4])
def test_an_exception_of_a_half_step_is_raised(n_calls):
    world, calls = made_world(), []

    def half_step():
        calls.append(1)
        if len(calls) == n_calls:
            raise KeyError("stopped")

    with pytest.raises(KeyError, match="stopped"):
        advance_sample(half_step, half_step, world._physics, 0, np.zeros(16), action(world))
    assert len(calls) == n_calls
