"""Small recordings for the tests of training."""

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.recordings import Label, Recording, Tactile, Truth
from holdfast.sensors import Sensor

TINY = Sensor(
    name="tiny",
    positions=np.zeros((1, 3)),
    rotations=np.eye(3)[None],
    normal=np.array([0.0, 0.0, 1.0]),
    rate=100.0,
)
"""A sensor of one taxel: small enough that a test may have many recordings."""

STATES = (ContactState.NO_CONTACT, ContactState.STABLE, ContactState.UNSTABLE, ContactState.STABLE)


def tiny_module(seed, *, n=400, sensor=TINY, rate=100.0, states=STATES, **kwargs):
    """No contact, held, shaken, held; a quarter of the time each."""
    rng = np.random.default_rng(seed)
    times = np.arange(n) / rate
    quarter = np.minimum(np.arange(n) * 4 // n, 3)
    grip = np.array([0.0, 600.0, 600.0, 600.0])[quarter] * rng.uniform(0.7, 1.3)
    shake = 40.0 * np.sin(2 * np.pi * 11 * times) * (quarter == 2)
    readings = rng.normal(0, 4, size=(n, sensor.n_taxels, 3))
    readings += np.stack([0 * grip, shake, grip + shake], axis=1)[:, None]
    bounds = np.append(times, n / rate)[[0, n // 4, n // 2, 3 * n // 4, n]]
    labels = tuple(
        Label(start, end, state)
        for start, end, state in zip(bounds[:-1], bounds[1:], states, strict=True)
        if state is not None
    )
    return Tactile(sensor, times, readings, labels=labels, **kwargs)


def tiny_recording(seed, fingers=("thumb", "index"), *, metadata=None, **kwargs):
    modules = {name: tiny_module([seed, k], **kwargs) for k, name in enumerate(fingers)}
    return Recording(f"grasp-{seed}", modules, {"object": f"object {seed % 3}"} | (metadata or {}))


def sliding_module(seed, slips, *, n=1500, jolt=25.0):
    """No contact for 2 s, then held; the shear force is rough while the finger slides."""
    rng = np.random.default_rng(seed)
    times = np.arange(n) / TINY.rate
    sliding = np.zeros(n, dtype=bool)
    for start in slips:
        sliding[start : start + 40] = True
    readings = rng.normal(0, 4, size=(n, 1, 3))
    readings[:, 0, 2] += np.where(times < 2, 0.0, 600.0)
    readings[:, 0, 0] += np.where(sliding, rng.normal(0, jolt, size=n), 0.0)
    labels = (Label(0.0, 2.0, ContactState.NO_CONTACT),)
    bounds = [2.0, *(k / TINY.rate for start in slips for k in (start, start + 40)), n / TINY.rate]
    states = [(ContactState.STABLE, None), (ContactState.UNSTABLE, Cause.SLIP)] * len(bounds)
    labels += tuple(
        Label(start, end, state, cause)
        for start, end, (state, cause) in zip(bounds[:-1], bounds[1:], states, strict=False)
    )
    arrays = {
        "contact_force": np.where(times < 2, 0.0, 1.0)[:, None] * [1.0, 0.0, 0.0],
        "slip_speed": np.where(sliding, 0.01, 0.0),
        "slipping_share": np.where(sliding, 1.0, 0.0),
    }
    return Tactile(TINY, times, readings, labels=labels), arrays


def sliding_recording(seed, fingers=("thumb", "index"), *, slips=(400, 700, 1000, 1300), **kwargs):
    """Return a recording with a truth, in which each finger slides four times for 0.4 s."""
    made = {name: sliding_module([seed, k], slips, **kwargs) for k, name in enumerate(fingers)}
    modules = {name: module for name, (module, _) in made.items()}
    times = next(iter(modules.values())).times
    truth = Truth(
        times,
        {"phase": np.where(times < 2, "free", "locked")},
        {name: arrays for name, (_, arrays) in made.items()},
    )
    return Recording(f"slips-{seed}", modules, {"object": f"object {seed % 3}"}, truth)
