"""`builtin:any` on sensors that are incomplete, broken or unusual: never a confident STABLE."""

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.detection import Model, detect
from holdfast.errors import ModelError
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import flat_sensor

HELD = slice(250, 450)
PUSHED = slice(500, 560)


@pytest.fixture(scope="module")
def model():
    return Model.load("builtin:any")


def grasp(
    shape=(3, 3), rate=100.0, scale=400.0, unit="count", contact=True, seed=0, largest_push=0.25
):
    """A finger that is closed at 1.5 s, pushed from 5 to 5.6 s, and opened at 9 s."""
    times = np.arange(0, 12, 1 / rate)
    grip = contact * np.interp(times, [0, 1.5, 2.0, 9.0, 9.4, 12], [0, 0, 1, 1, 0, 0])
    pushed = (times >= 5) & (times < 5.6)
    push = contact * np.where(pushed, largest_push * np.sin(2 * np.pi * (times - 5) / 0.3), 0)
    force = np.stack([push, 0.1 * grip, grip + push / 2], axis=1)
    sensor = flat_sensor("mine", *shape, 0.005, rate, unit)
    share = 1 + 0.5 * np.cos(np.arange(sensor.n_taxels))
    noise = np.random.default_rng(seed).normal(0, 0.005, (len(times), sensor.n_taxels, 3))
    return Tactile(sensor, times, scale * (force[:, None] * share[:, None] + noise))


def with_readings(module, readings):
    return Tactile(module.sensor, module.times, readings)


def detected(model, **modules):
    return detect(model, Recording("made", modules))


def states(model, module):
    return detected(model, finger1=module).fingers["finger1"].state


def test_a_good_sensor_is_stable_and_its_push_is_not(model):
    found = states(model, grasp())
    assert (found[HELD] == STABLE).all()
    assert (found[PUSHED] == UNSTABLE).mean() > 0.8


def test_one_taxel_still_shows_a_push_as_large_as_its_grip(model):
    found = states(model, grasp((1, 1), largest_push=1.0))
    assert (found[PUSHED] == UNSTABLE).mean() > 0.7


@pytest.mark.parametrize("axes", [[0], [2], [0, 1]])
def test_axes_without_values_are_unknown(model, axes):
    module = grasp()
    readings = module.readings.copy()
    readings[:, :, axes] = np.nan
    assert (states(model, with_readings(module, readings)) == UNKNOWN).all()


@pytest.mark.parametrize("rate", [5, 20, 1100])
def test_rates_outside_the_limits_are_refused(model, rate):
    with pytest.raises(ModelError, match=f"{rate} Hz given, the model expects 30 to 1000 Hz"):
        states(model, grasp(rate=rate))


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e6])
def test_readings_in_another_unit_are_not_stable_while_pushed(model, scale):
    """Readings far below one count are taken for noise: no contact."""
    found = states(model, grasp(scale=scale))
    assert (found[PUSHED] != STABLE).mean() > 0.8


@pytest.mark.parametrize("value", [0.0, 7.0, np.nan])
def test_a_finger_without_any_signal_is_unknown(model, value):
    """The hand is that of the other finger, but where the readings are no numbers."""
    module = grasp()
    dead = with_readings(module, np.full_like(module.readings, value))
    found = detected(model, index=module, thumb=dead)
    assert not found.fingers["thumb"].state[50:].any()
    assert STABLE not in found.fingers["thumb"].state
    other = found.fingers["index"].state
    expected = np.where(np.isnan(value) & (other != UNSTABLE), UNKNOWN, other)
    np.testing.assert_array_equal(found.hand[50:], expected[50:])


@pytest.mark.parametrize("value", [None, 0.0, np.nan])
def test_a_finger_that_dies_in_the_grasp_is_soon_unknown(model, value):
    module = grasp()
    readings = module.readings.copy()
    readings[400:] = readings[400] if value is None else value
    dying = with_readings(module, readings)
    found = detected(model, index=module, thumb=dying)
    assert (found.fingers["thumb"].state[470:850] != STABLE).all()
    assert (found.hand[470:850] != STABLE).all()
