"""The hand: geometry and masses of the vendor's tables, motion, forces, gravity."""

import numpy as np
import pytest

from holdfast.twin.hand import (
    FINGERS,
    MOUNTS,
    N_JOINTS,
    TIMESTEP,
    TIP_MASS,
    HandModel,
    hand_xml,
)
from holdfast.twin.mujoco_import import mujoco
from holdfast.twin.objects import load_objects, object_named
from holdfast.twin.steps import N_TIP, apply_forces, fill_bodies

VENDOR_TIPS = {
    "index": (0.0, 0.05531, 0.13344),
    "middle": (0.0, 0.0, 0.1362),
    "ring": (0.0, -0.05531, 0.13344),
    "thumb": (-0.0132, 0.1677, -0.08607),
}
"""Of the vendor's URDF in the palm at the zero pose [m]."""
REACH = {"thumb": 0.0423, "index": 0.0267, "middle": 0.0267, "ring": 0.0267}
RUBBER_TIP = 0.0168


@pytest.fixture
def hand():
    return HandModel.build(object_named("can"))


def moving(hand, seed=0):
    """Any pose within the limits, any velocities; the five bodies."""
    draw = np.random.default_rng(seed)
    low, high = hand.limits().T
    hand.data.qpos[:N_JOINTS] = draw.uniform(low, high)
    hand.data.qpos[N_JOINTS:] = [0.1, -0.05, 0.2, *rotation(draw)]
    hand.data.qvel[:] = draw.normal(size=hand.model.nv)
    mujoco.mj_forward(hand.model, hand.data)
    bodies = np.full((5, 18), np.nan)
    fill_bodies(hand.arrays, bodies)
    return bodies


def rotation(draw):
    quaternion = draw.normal(size=4)
    return quaternion / np.linalg.norm(quaternion)


def in_palm(hand, point):
    return hand.data.body("palm").xmat.reshape(3, 3).T @ point


def test_fingertips_at_the_zero_pose_are_where_the_vendor_says(hand):
    mujoco.mj_kinematics(hand.model, hand.data)
    for body, finger in zip(hand.tips, FINGERS, strict=True):
        turn = hand.data.xmat[body].reshape(3, 3)
        tip = hand.data.xpos[body] + turn @ [0, 0, REACH[finger]]
        expected = VENDOR_TIPS[finger]
        np.testing.assert_allclose(in_palm(hand, tip), expected, atol=1e-4)


def test_total_mass_is_the_vendors_with_skins_for_rubber_tips(hand):
    mass = hand.model.body_mass.sum() - object_named("can").mass
    assert mass == pytest.approx(0.955 + 4 * (TIP_MASS - RUBBER_TIP), abs=2e-4)


def test_joints_are_numbered_as_the_driver_does_and_keep_the_vendors_limits(hand):
    for number in range(N_JOINTS):
        assert hand.model.joint(f"joint_{number}").qposadr[0] == number
    np.testing.assert_allclose(hand.limits()[[0, 1, 12, 15]], [
        [-0.47, 0.47], [-0.196, 1.61], [0.263, 1.396], [-0.162, 1.719],
    ])  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_velocities_are_those_that_mujoco_gives(hand, seed):
    bodies = moving(hand, seed)
    velocities = np.zeros(6)
    kind = mujoco.mjtObj.mjOBJ_XBODY
    for row, body in zip(bodies, [*hand.tips, hand.object_body], strict=True):
        mujoco.mj_objectVelocity(hand.model, hand.data, kind, body, velocities, 0)
        spin, velocity = velocities[:3], velocities[3:]
        expected = velocity + np.cross(spin, row[:3] - hand.data.xpos[body])
        np.testing.assert_allclose(row[12:15], expected, atol=1e-12)
        np.testing.assert_allclose(row[15:], spin, atol=1e-12)


def test_fingertip_frames_are_the_mounts_on_the_last_links(hand):
    bodies = moving(hand)
    for row, body, mount in zip(bodies, hand.tips, MOUNTS, strict=False):
        turn = hand.data.xmat[body].reshape(3, 3)
        np.testing.assert_allclose(row[:3], hand.data.xpos[body] + turn @ mount, atol=1e-15)
        np.testing.assert_allclose(row[3:12].reshape(3, 3), turn, atol=1e-15)
    np.testing.assert_allclose(bodies[-1, :3], hand.data.xipos[hand.object_body], atol=1e-15)


def test_applied_forces_do_what_mujoco_computes(hand):
    bodies = moving(hand)
    draw = np.random.default_rng(2)
    tips, item = draw.normal(size=(4, N_TIP)), draw.normal(size=6)
    apply_forces(hand.arrays, tips, item, bodies)
    expected = np.zeros(hand.model.nv)
    for body, wrench, row in zip(
        [*hand.tips, hand.object_body], [*tips, item], bodies, strict=True
    ):
        force, torque, point = wrench[:3], wrench[3:6], row[:3].copy()
        mujoco.mj_applyFT(hand.model, hand.data, force, torque, point, body, expected)
    without = hand.data.qfrc_smooth.copy()
    mujoco.mj_fwdAcceleration(hand.model, hand.data)
    np.testing.assert_allclose(hand.data.qfrc_smooth - without, expected, atol=1e-12)


@pytest.mark.parametrize("name", list(load_objects()))
def test_the_object_weighs_what_the_table_says_and_falls_freely(name):
    item = object_named(name)
    hand = HandModel.build(item)
    assert hand.model.body("object").mass[0] == pytest.approx(item.mass)
    np.testing.assert_allclose(hand.model.body("object").inertia, item.inertia)
    np.testing.assert_allclose(hand.model.body("object").iquat, [1, 0, 0, 0])
    for _ in range(105):
        mujoco.mj_step(hand.model, hand.data)
    assert hand.data.qvel[N_JOINTS + 2] == pytest.approx(-9.81 * 105 * TIMESTEP)
    assert hand.data.qvel[N_JOINTS + 3 :] == pytest.approx(np.zeros(3), abs=1e-9)


def test_energy_is_conserved_without_friction():
    model = mujoco.MjModel.from_xml_string(hand_xml())
    model.dof_damping[:] = model.dof_frictionloss[:] = 0.0
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, 1e-4
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0
    mujoco.mj_forward(model, data)
    before = data.energy.copy()
    for _ in range(2000):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    assert abs(data.energy[0] - before[0]) > 1e-3  # it went up and down
    assert data.energy.sum() == pytest.approx(before.sum(), abs=1e-6)
