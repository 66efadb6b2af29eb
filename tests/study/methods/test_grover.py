"""The window of the last second."""

import numpy as np
import pytest

from holdfast.features import Tare
from holdfast.recordings import Recording
from holdfast.study.methods import METHODS, hand_signal
from holdfast.study.methods.grover import N_STEPS, last_second
from training.build import tiny_module, tiny_recording


def windows(recording):
    hand = hand_signal(recording, Tare.parse("none"))
    name = next(iter(hand.fingers))
    rows = last_second(hand)[name]
    return rows.reshape(len(rows), N_STEPS, 3), hand.fingers[name].force


def test_at_100_hz_a_window_is_the_last_100_samples():
    rows, force = windows(tiny_recording(0))
    assert rows.dtype == np.float32
    assert np.isnan(rows[:99]).all()
    for k in (99, 100, 250, 399):
        assert rows[k] == pytest.approx(force[k - 99 : k + 1], rel=1e-6, abs=1e-3)


def test_at_another_rate_it_is_as_long():
    """A force that grows evenly is read off between samples: 2 a second, 0.02 a step."""
    module = tiny_module(0, n=400, rate=150.0)
    ramp = np.zeros_like(module.readings)
    ramp[:, 0, 2] = 2.0 * module.times
    given = type(module)(module.sensor, module.times, ramp, labels=module.labels)
    rows, _ = windows(Recording("ramp", {"index": given}))
    assert rows.shape == (400, 100, 3)
    first = int(np.flatnonzero(np.isfinite(rows).all(axis=(1, 2)))[0])
    assert module.times[first] == pytest.approx(0.99, abs=1 / 150)
    for k in (first + 1, 399):
        steps = 2.0 * (module.times[k] - 0.01 * np.arange(99, -1, -1))
        assert rows[k, :, 2] == pytest.approx(steps, abs=1e-5)
        assert (rows[k, :, :2] == 0).all()


@pytest.mark.parametrize("rate", [80.0, 100.0, 150.0])
def test_it_sees_nothing_that_is_to_come(rate):
    module = tiny_module(1, rate=rate)
    whole, _ = windows(Recording("whole", {"index": module}))
    for end in (10, 160, 301):
        part, _ = windows(Recording("part", {"index": module.slice(0, end)}))
        assert part == pytest.approx(whole[:end], rel=1e-6, nan_ok=True)


def test_what_it_is():
    method = METHODS["tcn"]
    assert (method.name, method.category, method.recipe.name) == ("tcn", "learning", "tcn")
    assert dict(method.reference) == {"n_epochs": 20, "learning_rate": 2e-3, "dropout": 0.2}
