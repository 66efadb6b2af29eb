"""Small recordings for the tests of training."""

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.detection import Model
from holdfast.recordings import Label, Recording, Tactile, Truth
from holdfast.sensors import Sensor, flat_sensor

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


PAD = flat_sensor("pad", 3, 3, 0.005, 100.0, "N")
"""A sensor in newtons, whose readings have no least step."""


def handling_module(
    seed, held=8.0, *, sensor=PAD, rate=100.0, slip=0.0, sway=0.1, force=4.0, open_for=1.0
):
    """Open, closed, held and carried with swaying force, open again.

    Args:
        seed: of all random numbers.
        held: time between closing and opening [s].
        sensor: with any number of taxels.
        rate: [Hz].
        slip: share of the held time in which single taxels tremble as over a sliding object.
        sway: change of the force while it is carried, as a share of it.
        force: of a taxel; 0 for a hand that stays open.
        open_for: time before and after [s].
    """
    rng = np.random.default_rng(seed)
    closed, opened = open_for + 0.3, open_for + 0.3 + held
    times = np.arange(0, opened + 0.3 + open_for, 1 / rate)
    grip = np.interp(times, [0, open_for, closed, opened, opened + 0.3], [0, 0, 1, 1, 0])
    phase = rng.uniform(0, 2 * np.pi, size=3)
    swaying = sway * np.sin(2 * np.pi * np.array([[0.5], [0.9], [1.3]]) * times + phase[:, None])
    pulls = np.stack([swaying[0], swaying[1], 1 + swaying[2]], axis=1) * grip[:, None]
    share = 1 + 0.5 * np.cos(np.arange(sensor.n_taxels))
    readings = force * pulls[:, None] * share[:, None]
    sliding = (times > closed + 0.5) & (times < closed + 0.5 + slip * held)
    readings += force * 0.4 * rng.normal(size=readings.shape) * sliding[:, None, None]
    readings += 0.004 * rng.normal(size=readings.shape)
    return Tactile(sensor, times, readings)


def handling_recording(seed, fingers=("thumb", "index"), name=None, **options):
    modules = {finger: handling_module([seed, k], **options) for k, finger in enumerate(fingers)}
    return Recording(name or f"handling-{seed}", modules)


def normalised_model():
    """Return `builtin:any`, whose features are normalised, with a threshold that is too high."""
    model = Model.load("builtin:any")
    return model.changed(lambda part: part.with_heads(part.stable.at(0.95)))
