"""Synthetic recordings from an analytic signal, for examples and tests. There is no physics.

A fingertip of 30 taxels is pressed by a smooth grip that closes, holds, is shaken, holds again
and opens. The pressure is bell-shaped over the taxels. The shaking is a sum of sinusoids. Labels
follow from the schedule, so they are exact.
"""

from collections.abc import Sequence

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.recordings import Label, Recording, Tactile
from holdfast.sensors import sensor
from holdfast.sensors.types import Array

SYNTHETIC_RATE = 150.0
READING_NOISE = 0.9
"""Standard deviation of a reading, from the data sheet of the uSkin [count]."""
READING_BASELINE = (32768.0, 32768.0, 36000.0)
"""Readings without contact [count]."""

FREE_TIME, CLOSING_TIME, HELD_TIME, SHAKEN_TIME, RELEASED_TIME = 1.5, 0.8, 3.0, 1.2, 0.5
"""Duration of each part of the schedule [s]."""


_STATES = (
    (ContactState.NO_CONTACT, None),
    (ContactState.UNSTABLE, Cause.CLOSING),
    (ContactState.STABLE, None),
    (ContactState.UNSTABLE, Cause.DISTURBANCE),
    (ContactState.STABLE, None),
    (ContactState.UNSTABLE, Cause.RELEASED),
    (ContactState.NO_CONTACT, None),
)
"""State and cause of each part of the schedule."""


def synthetic_recording(
    name: str, seed: int, fingers: Sequence[str] = ("thumb", "index", "middle")
) -> Recording:
    """Return a recording of one grasp: free, closing, held, shaken, held, released, free.

    Args:
        name: of the recording.
        seed: of grip, shaking and noise. The same seed gives the same bytes.
        fingers: names of the fingers.

    Returns:
        Readings of curved uSkin fingertips at 150 Hz [count], with labels.

    Example:
        >>> recording = synthetic_recording("made", seed=0, fingers=("thumb",))
        >>> recording.modules["thumb"].readings.shape, round(recording.rate)
        ((1725, 30, 3), 150)
    """
    generator = np.random.default_rng(seed)
    grip = generator.uniform(400.0, 1200.0)
    modules = {finger: _finger(generator, grip) for finger in fingers}
    metadata = {"source": "synthetic", "seed": seed, "object": f"object {seed % 3}"}
    return Recording(name, modules, metadata)


def _finger(generator: np.random.Generator, grip: float) -> Tactile:
    tip = sensor("uskin-curved")
    ends = np.cumsum(
        [FREE_TIME, CLOSING_TIME, HELD_TIME, SHAKEN_TIME, HELD_TIME, RELEASED_TIME, FREE_TIME]
    )
    times = np.arange(round(ends[-1] * SYNTHETIC_RATE)) / SYNTHETIC_RATE
    force = _force(generator, times, ends, grip * generator.uniform(0.7, 1.3))
    # A bell of pressure over the middle taxels, with a standard deviation of 6 mm; noise on top.
    middle = tip.positions[np.abs(tip.positions @ [0.0, 1.0, 0.0]).argmin()]
    distance = np.linalg.norm(tip.positions - middle, axis=1)
    share = np.exp(-0.5 * (distance / 6e-3) ** 2)
    share /= share.sum()
    in_taxels = np.einsum("tji,nj->nti", tip.rotations, force) * share[:, None]
    rest = np.array(READING_BASELINE) + generator.normal(0.0, 200.0, size=(tip.n_taxels, 3))
    noise = generator.normal(0.0, READING_NOISE, size=in_taxels.shape)
    readings = np.clip(np.rint(rest + in_taxels + noise), 0, 65535).astype(np.uint16)
    starts = [0.0, *ends[:-1].tolist()]
    labels = [
        Label(start, float(end), state, cause, evidence="schedule", author="synthetic")
        for start, end, (state, cause) in zip(starts, ends, _STATES, strict=True)
    ]
    return Tactile(tip, times, readings, labels=tuple(labels))


def _force(generator: np.random.Generator, times: Array, ends: Array, grip: float) -> Array:
    """Return (n, 3) force on the fingertip [count]: grip, constant shear and shaking."""
    closing = _ramp((times - ends[0]) / CLOSING_TIME)
    release = _ramp((times - ends[4]) / RELEASED_TIME)
    level = grip * (closing - release)
    shaken = (times >= ends[2]) & (times < ends[3])
    frequencies = generator.uniform(4.0, 30.0, size=(6, 1))
    phases = generator.uniform(0.0, 2 * np.pi, size=(6, 3))
    angle = 2 * np.pi * frequencies * times[:, None, None] + phases
    shaking = 0.05 * np.sin(angle).sum(axis=1) * shaken[:, None]
    direction = np.array([1.0, *generator.normal(0.0, 0.2, size=2)])
    return np.asarray(level[:, None] * (direction + shaking))


def _ramp(x: Array) -> Array:
    """Return a smooth step from 0 to 1."""
    inside: Array = np.clip(x, 0.0, 1.0)
    return inside * inside * (3 - 2 * inside)
