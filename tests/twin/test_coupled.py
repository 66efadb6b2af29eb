"""A skin whose nodes are coupled, against its own equations."""

import numpy as np
import pytest

from holdfast.twin.contact import nearness_of
from holdfast.twin.objects import object_named
from holdfast.twin.steps import MAX_COUPLED, probe, relief, touch
from holdfast.twin.world import fingertip_of

from .grip import SURFACE, coupled_grip

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", ["can", "box"])
def test_forces_solve_the_equations(name: str) -> None:
    """With a dense matrix: what presses is at the surface, what does not is beyond it."""
    grip = coupled_grip(name)
    for _ in range(300):
        touch(grip.state, grip.constants, grip.bodies, grip.dt)
    apart = SURFACE.nodes[:, None] - SURFACE.nodes
    distance = np.linalg.norm(apart, axis=2)
    np.fill_diagonal(distance, 1.0)
    unit = apart / distance[..., None]
    near = np.where(np.eye(len(SURFACE.nodes)) > 0, 0.0, 1 / distance)
    force = grip.state.node_forces[0]
    along = np.einsum("ijk,jk->ij", unit, force)
    others = near @ force + np.einsum("ij,ij,ijk->ik", near, along, unit)
    rotation = grip.bodies[0, 3:12].reshape(3, 3)
    points = SURFACE.nodes @ rotation.T + grip.bodies[0, :3]
    found = np.array([probe(grip.constants.solid, *point) for point in points])
    depth = -found[:, 0] - [relief(grip.constants.solid, *point) for point in points]
    normal = found[:, 1:] @ rotation
    pressed = (force * normal).sum(axis=1)
    own = np.diag(nearness_of(SURFACE))
    pushed = ((others * normal).sum(axis=1) + own * pressed) / (4 * np.pi * 50e3)
    touching = pressed > 0
    assert 20 < touching.sum() < (depth > 0).sum() < 200
    np.testing.assert_allclose(pushed[touching], depth[touching], atol=1e-7)
    assert (pushed[~touching] >= depth[~touching] - 1e-7).all()


def test_momentum_is_kept_and_coulomb_is_never_passed() -> None:
    grip, rng = coupled_grip("can"), np.random.default_rng(4)
    mu = object_named("can").mu_static
    for _ in range(200):
        for tip in range(2):
            grip.bodies[tip, 12:15] = rng.normal(0, 0.05, 3)
            grip.bodies[tip, :3] += grip.bodies[tip, 12:15] * grip.dt
        touch(grip.state, grip.constants, grip.bodies, grip.dt)
        state = grip.state
        np.testing.assert_allclose(state.contact_force.sum(axis=0), state.wrench[:3], atol=1e-9)
        for tip in range(2):
            forces = state.node_forces[tip] @ grip.bodies[tip, 3:12].reshape(3, 3).T
            np.testing.assert_allclose(forces.sum(axis=0), state.tip_force[tip], atol=1e-9)
            points = SURFACE.nodes @ grip.bodies[tip, 3:12].reshape(3, 3).T + grip.bodies[tip, :3]
            normals = np.array([probe(grip.constants.solid, *point)[1:] for point in points])
            pressed = (forces * normals).sum(axis=1)
            friction = np.linalg.norm(forces - pressed[:, None] * normals, axis=1)
            assert pressed.min() >= -1e-12
            assert (friction <= mu * pressed * (1 + 1e-9) + 1e-12).all()
    assert grip.state.slip_speed.max() > 1e-5


def test_a_fingertip_that_leaves_has_no_state_and_comes_back() -> None:
    grip = coupled_grip("can")
    touch(grip.state, grip.constants, grip.bodies, grip.dt)
    home, first = grip.bodies[0, :3].copy(), grip.state.load[0]
    for away in (0.003, 0.2):
        grip.bodies[0, 0] += away
        grip.bodies[0, 12] = away / grip.dt
        touch(grip.state, grip.constants, grip.bodies, grip.dt)
        assert not grip.state.node_forces[0].any()
        assert not grip.state.bristles[0, :, :9].any()
        grip.bodies[0, :3], grip.bodies[0, 12] = home, 0.0
    touch(grip.state, grip.constants, grip.bodies, grip.dt)
    assert grip.state.load[0] == pytest.approx(first, rel=0.3)


def test_a_matrix_of_other_nodes_is_refused() -> None:
    grip = coupled_grip("can")
    fine = fingertip_of(coupled=True).nodes[: MAX_COUPLED // 2]
    for nearness in (np.zeros((1, 1)), np.ones((len(fine), len(fine)))):
        with pytest.raises(ValueError, match="nearness"):
            touch(grip.state, grip.constants._replace(nearness=nearness), grip.bodies, grip.dt)
