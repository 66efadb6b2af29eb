from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from holdfast.sensors.types import Array
from holdfast.twin.objects import load_objects, object_named
from holdfast.twin.skin import Skin
from holdfast.twin.steps import probe, touch
from holdfast.twin.surface import Surface, curved_fingertip

from .grip import GRAVITY, Grip, coupled_grip
from .naive_contact import NaiveFinger

pytestmark = pytest.mark.slow

NAMES = sorted(load_objects())
SAMPLE = 1 / 150  # [s]
BOX = object_named("box")
SMOOTH = replace(BOX, texture_amplitude=0.0)

seeds = st.integers(0, 2**32 - 1)


def flat_patch(n: int = 6) -> Surface:
    """A pad whose nodes are all alike on the face of a box."""
    y, z = np.meshgrid(np.linspace(-0.006, 0.006, n), np.linspace(0.006, 0.018, n))
    nodes = np.stack([np.full(n * n, 0.02), y.ravel(), z.ravel()], axis=1)
    return Surface(nodes, np.tile([1.0, 0.0, 0.0], (n * n, 1)), np.full(n * n, 5e-6))


def shaken(grip: Grip, seed: int, n_steps: int, each: Callable[[], None]) -> None:
    """Fingertips and object that move and turn about where they were, without any physics."""
    rng = np.random.default_rng(seed)
    home, phase = grip.bodies.copy(), rng.uniform(0, 6, (len(grip.bodies), 6))
    rate = rng.uniform(10, 80, phase.shape)
    size = np.array([1.5e-3, 1.5e-3, 1.5e-3, 0.04, 0.04, 0.04])
    for k in range(n_steps):
        angle = rate * k * grip.dt + phase
        shift, speed = size * (np.sin(angle) - np.sin(phase)), size * rate * np.cos(angle)
        for body, start, move, fast in zip(grip.bodies, home, shift, speed, strict=True):
            turn = Rotation.from_rotvec(move[3:]).as_matrix()
            body[:3] = start[:3] + move[:3]
            body[3:12] = (turn @ start[3:12].reshape(3, 3)).ravel()
            body[12:15], body[15:18] = fast[:3], fast[3:]
        touch(grip.state, grip.constants, grip.bodies, grip.dt)
        each()


def world_forces(grip: Grip, tip: int) -> Array:
    return grip.state.node_forces[tip] @ grip.bodies[tip, 3:12].reshape(3, 3).T


@pytest.mark.parametrize("name", NAMES)
def test_same_as_the_naive_twin(name: str) -> None:
    grip = Grip(object_named(name), angles=(0.3, 3.0))
    twins = [NaiveFinger(curved_fingertip(), object_named(name)) for _ in range(2)]

    def compare() -> None:
        for tip, twin in enumerate(twins):
            twin.touch(grip.bodies[tip], grip.object_body, grip.dt)
            np.testing.assert_allclose(world_forces(grip, tip), twin.forces, atol=2e-6)
            load = twin.loads.sum()
            assert grip.state.load[tip] == pytest.approx(load, abs=2e-6)
            slip = twin.loads @ twin.sliding / max(load, 1e-300)
            assert grip.state.slip_speed[tip] == pytest.approx(slip, abs=1e-6)
            share = twin.loads[twin.sliding > Skin().slipping].sum() / max(load, 1e-300)
            assert grip.state.slipping_share[tip] == pytest.approx(share, abs=1e-6)

    shaken(grip, NAMES.index(name), 60, compare)
    assert grip.state.load.max() > 0.1


@settings(max_examples=15)
@given(seed=seeds, name=st.sampled_from(NAMES))
def test_nodes_add_up_and_momentum_is_kept(seed: int, name: str) -> None:
    grip = Grip(object_named(name), angles=(0.0, 2.5, 3.7))

    def check() -> None:
        state, bodies = grip.state, grip.bodies
        for tip in range(3):
            forces = world_forces(grip, tip)
            np.testing.assert_allclose(forces.sum(axis=0), state.tip_force[tip], atol=1e-9)
            arms = curved_fingertip().nodes @ bodies[tip, 3:12].reshape(3, 3).T
            torque = np.cross(arms, forces).sum(axis=0)
            np.testing.assert_allclose(torque, state.tips[:, 3:6][tip], atol=1e-9)
        np.testing.assert_allclose(state.contact_force.sum(axis=0), state.wrench[:3], atol=1e-9)
        about = np.array([0.3, -0.2, 0.5])
        total = np.cross(bodies[-1, :3] - about, state.wrench[:3]) + state.wrench[3:]
        total += np.cross(bodies[:-1, :3] - about, state.tip_force).sum(axis=0)
        total += state.tips[:, 3:6].sum(axis=0)
        np.testing.assert_allclose(total, 0, atol=1e-9)

    shaken(grip, seed, 20, check)


@settings(max_examples=15)
@given(seed=seeds, name=st.sampled_from(NAMES))
def test_coulomb_is_never_passed_and_nothing_pulls(seed: int, name: str) -> None:
    grip = Grip(object_named(name), depth=2e-3)
    mu = object_named(name).mu_static

    def check() -> None:
        back = grip.object_body[3:12].reshape(3, 3)
        for tip in range(2):
            forces = world_forces(grip, tip)
            arms = curved_fingertip().nodes @ grip.bodies[tip, 3:12].reshape(3, 3).T
            points = (arms + grip.bodies[tip, :3] - grip.object_body[:3]) @ back
            normals = np.array([probe(grip.constants.solid, *p)[1:] for p in points]) @ back.T
            pressed = (forces * normals).sum(axis=1)
            friction = np.linalg.norm(forces - pressed[:, None] * normals, axis=1)
            assert pressed.min() >= -1e-12
            assert (friction <= mu * pressed * (1 + 1e-9) + 1e-12).all()

    shaken(grip, seed, 30, check)


@pytest.mark.parametrize("name", NAMES)
def test_shaking_slides_so_that_the_limit_is_tried(name: str) -> None:
    slipped = []
    for seed in range(8):
        grip = Grip(object_named(name), depth=2e-3)
        shaken(grip, seed, 30, lambda grip=grip: slipped.append(grip.state.slip_speed.max()))
    assert max(slipped) > 1e-5


@settings(max_examples=20)
@given(seed=seeds, name=st.sampled_from(NAMES))
def test_the_world_may_be_turned_shifted_and_moved(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed % 2**31).as_matrix()
    shift, drift, spin = rng.normal(size=(3, 3))
    here, there = Grip(object_named(name)), Grip(object_named(name))

    def check() -> None:
        there.bodies[:] = here.bodies
        for body in there.bodies:
            body[:3] = turn @ body[:3] + shift
            body[3:12] = (turn @ body[3:12].reshape(3, 3)).ravel()
            body[12:15] = turn @ body[12:15] + drift + np.cross(spin, body[:3])
            body[15:18] = turn @ body[15:18] + spin
        touch(there.state, there.constants, there.bodies, there.dt)
        np.testing.assert_allclose(there.state.node_forces, here.state.node_forces, atol=1e-9)
        for one, other in (
            (there.state.tip_force, here.state.tip_force),
            (there.state.tips[:, 3:6], here.state.tips[:, 3:6]),
            (there.state.wrench[:3], here.state.wrench[:3]),
            (there.state.wrench[3:], here.state.wrench[3:]),
        ):
            np.testing.assert_allclose(one, other @ turn.T, atol=1e-9)
        np.testing.assert_allclose(there.state.slip_speed, here.state.slip_speed, atol=1e-9)

    shaken(here, seed, 15, check)


@pytest.mark.parametrize("name", [*NAMES, "coupled can"])
def test_held_at_rest_without_creep(name: str) -> None:
    if name == "coupled can":
        grip = coupled_grip("can", 2.5e-3)
    else:
        grip = Grip(object_named(name), depth=2.2e-3)
    grip.settle(2.0)
    before, slip = grip.object_body[:3].copy(), []
    for _ in range(2000):
        grip.step()
        slip.append(grip.state.slip_speed.max())
    assert max(slip) < 1e-6
    assert np.linalg.norm(grip.object_body[:3] - before) / (2000 * grip.dt) < 1e-6
    weight = [0.0, 0.0, GRAVITY * grip.mass]
    np.testing.assert_allclose(grip.state.wrench[:3], weight, atol=1e-3)


@pytest.mark.parametrize("rate", [1.0, 5.0, 20.0])
@pytest.mark.parametrize("depth", [1e-3, 2e-3])
def test_a_flat_pad_slips_within_a_sample_of_what_theory_says(rate: float, depth: float) -> None:
    """Nodes that are all alike are one block on a spring: it slips when F = mu_s N."""
    grip = Grip(SMOOTH, depth, surface=flat_patch())
    for _ in range(1000):
        grip.step(spin=False)
    limit = SMOOTH.mu_static * grip.state.load.sum() - grip.mass * GRAVITY
    start = grip.time
    expected = start + limit / rate
    while grip.state.slip_speed.max() < 1e-3:
        grip.step((0.0, 0.0, -rate * (grip.time - start)), spin=False)
    assert 0 <= grip.time - expected < SAMPLE


@pytest.mark.parametrize("name", NAMES)
def test_a_fingertip_slips_from_its_edge_and_lets_go_between_the_frictions(name: str) -> None:
    grip = Grip(object_named(name), depth=2.2e-3)
    for _ in range(1000):
        grip.step(spin=False)
    start, shares, pull = grip.time, [0.0], 0.0
    while shares[-1] < 0.999 and grip.time < start + 4:
        pull = 20.0 * (grip.time - start)
        grip.step((0.0, 0.0, -pull), spin=False)
        shares.append(float(grip.state.slipping_share.min()))
    total = (pull + grip.mass * GRAVITY) / grip.state.load.sum()
    assert object_named(name).mu_kinetic < total < 1.15 * object_named(name).mu_static
    assert 0.05 < shares[len(shares) * 4 // 5] < 0.95
