"""Small recordings for the tests of labels."""

from itertools import pairwise

import numpy as np

from holdfast.contact import ContactState
from holdfast.recordings import Label, Recording, Tactile
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
"""Of the four quarters of a recording."""


def tiny_recording(seed, fingers=("thumb", "index"), *, states=STATES, rate=100.0, n=600):
    """No contact, held, shaken, held; labelled with those states, or not where one is None."""
    modules = {name: _module([seed, k], states, rate, n) for k, name in enumerate(fingers)}
    return Recording(f"grasp-{seed}", modules, {"object": f"object {seed % 3}"})


def _module(seed, states, rate, n):
    rng = np.random.default_rng(seed)
    times = np.arange(n) / rate
    quarter = np.minimum(np.arange(n) * 4 // n, 3)
    grip = np.array([0.0, 600.0, 600.0, 600.0])[quarter] * rng.uniform(0.7, 1.3)
    shake = 40.0 * np.sin(2 * np.pi * 11 * times) * (quarter == 2)
    readings = rng.normal(0, 4, size=(n, 1, 3))
    readings += np.stack([0 * grip, shake, grip + shake], axis=1)[:, None]
    bounds = np.append(times, n / rate)[[0, n // 4, n // 2, 3 * n // 4, n]].tolist()
    labels = tuple(
        Label(*span, state)
        for span, state in zip(pairwise(bounds), states, strict=True)
        if state is not None
    )
    return Tactile(TINY, times, readings, labels=labels)
