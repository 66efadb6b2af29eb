import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE
from holdfast.detection import Model, detect
from holdfast.sensors import sensor
from holdfast.twin.force_skin import FORCE_SENSORS, STEP_NOISE, ForceSkin
from holdfast.twin.simulation import Grasp, simulate
from holdfast.twin.surface import curved_fingertip

STEP = 0.1
MAX_ERROR = STEP * (0.5 + 7 * STEP_NOISE)


def skin(name="orca-finger"):
    return ForceSkin(sensor(name), curved_fingertip().nodes)


@pytest.mark.parametrize("name", FORCE_SENSORS)
def test_no_force_is_lost_between_nodes_and_taxels(name):
    """Pressed along x of the twin's fingertip, the readings are along z of the module."""
    forces = np.zeros((1, 158, 3))
    forces[0, 70:80] = [-1.0, 0.2, 0.3]
    on_taxels = skin(name).taxel_forces(forces)
    np.testing.assert_allclose(on_taxels.sum(axis=(0, 1)), [-2.0, -3.0, 10.0], atol=1e-12)


@pytest.mark.parametrize("name", FORCE_SENSORS)
def test_the_taxels_that_read_most_are_those_at_the_force(name):
    """A taxel that is towards the tip or aside in its module is so on the twin's fingertip."""
    tip, nodes = sensor(name), curved_fingertip().nodes
    forces = np.zeros((len(nodes), len(nodes), 3))
    forces[range(len(nodes)), range(len(nodes)), 0] = -1.0
    pressed = skin(name).taxel_forces(forces)[:, :, 2] @ tip.positions
    for axis_of_module, axis_of_tip in ((0, 1), (1, 2), (2, 0)):
        related = np.corrcoef(pressed[:, axis_of_module], nodes[:, axis_of_tip])[0, 1]
        assert related > 0.8


@given(st.floats(-14.0, 30.0), st.integers(0, 2**32 - 1))
def test_a_reading_is_the_nearest_step_within_the_range(force, seed):
    forces = np.full((3, 87, 3), force)
    readings = skin().readout(np.random.default_rng(seed)).read(forces, np.arange(3) / 100)
    np.testing.assert_allclose(readings, STEP * np.rint(readings / STEP), atol=1e-9)
    assert np.abs(readings - np.clip(force, -12.8, 25.5)).max() < MAX_ERROR


def test_zero_is_exact_and_noise_shows_between_two_steps():
    run = skin().readout(np.random.default_rng(0))
    times = np.arange(9000) / 100
    still = run.read(np.zeros((9000, 87, 3)), times)
    assert not still.any()
    assert not np.signbit(still).any()
    assert set(run.read(np.full((100, 87, 3), 1.05), times[:100]).round(9).ravel()) == {1.0, 1.1}
    assert set(run.read(np.full((100, 87, 3), 1.0), times[:100]).round(9).ravel()) == {1.0}


@pytest.fixture(scope="module")
def pushed():
    return simulate(Grasp("can", 2, 1, sensor="orca-finger"))


@pytest.mark.slow
class TestRecording:
    def test_readings_are_steps_and_exact_zeros_without_contact(self, pushed):
        for finger, module in pushed.modules.items():
            assert module.sensor == sensor("orca-finger")
            assert module.unit == "N"
            readings, truth = module.readings, pushed.truth.fingers[finger]
            np.testing.assert_allclose(readings, STEP * np.rint(readings / STEP), atol=1e-9)
            touching = np.flatnonzero(truth["contact_force"].any(axis=1))
            assert 0 < touching[0] < touching[-1] < module.n_samples - 1
            assert not readings[: touching[0]].any()
            assert not readings[touching[-1] + 1 :].any()
            assert readings.any()

    def test_the_sum_is_the_contact_force_but_for_steps(self, pushed):
        """Each taxel that reads something is half a step off, as are those beside it."""
        for finger, module in pushed.modules.items():
            truth = pushed.truth.fingers[finger]
            turned = Rotation.from_quat(truth["tip_pose"][:, [4, 5, 6, 3]]).inv()
            force = turned.apply(truth["contact_force"].copy())[:, [1, 2, 0]]  # module axes
            n_reading = module.readings.any(axis=2).sum(axis=1)
            held = n_reading > 0
            errors = np.abs(module.readings.sum(axis=1) - force)[held]
            assert (errors <= MAX_ERROR * (n_reading[held, None] + 5)).all()
            mean = module.readings.sum(axis=1)[held, 2].mean()
            assert mean == pytest.approx(force[held, 2].mean(), rel=0.2)

    def test_truth_and_labels_are_those_of_any_sensor(self, pushed):
        other = simulate(Grasp("can", 2, 1))
        assert pushed.metadata == other.metadata | {"sensor": "orca-finger"}
        for name, values in other.truth.hand.items():
            np.testing.assert_array_equal(pushed.truth.hand[name], values)
        assert {f: m.labels for f, m in pushed.modules.items()} == {
            f: m.labels for f, m in other.modules.items()
        }

    def test_the_detector_finds_contact_and_no_fault(self, pushed):
        for trace in detect(Model.load("builtin:any"), pushed).fingers.values():
            assert {STABLE, UNSTABLE, NO_CONTACT} <= set(trace.state)
            assert not trace.faults.any()
