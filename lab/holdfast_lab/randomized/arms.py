"""What carries a randomized hand all the time: an arm as of the boxes, or a person."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from holdfast.sensors.types import Array
from holdfast_lab.randomized.palm import GRID_RATE, Segment, log_uniform, uniform

CARRIERS = ("carry", "person")
"""Mechanisms of what carries a hand; a hand has one of them at most."""
N_TREMOR_WAVES = 8
"""Sinusoids that make up the tremor of a person's hand."""
BOUT_FADE = 0.5
"""Time in which a person begins and stops walking, and in which the tremor begins [s]."""


def draw_carrier(
    generator: np.random.Generator, ranges: Mapping[str, Mapping[str, Any]]
) -> str | None:
    """Draw one of `CARRIERS`, or None for a hand that only moves in events."""
    place = generator.random()
    if place < ranges["carry"]["share"]:
        return "carry"
    return "person" if place > 1 - ranges["person"]["share"] else None


def carrying_legs(
    generator: np.random.Generator, ranges: Mapping[str, Any], orientation: Array, duration: float
) -> list[Segment]:
    """Draw straight level motions to and fro, with rests between them.

    Args:
        generator: of all that is drawn.
        ranges: `way`, `duration` and `rest`.
        orientation: (3, 3) rotation from the palm frame to the world.
        duration: that they fill [s].
    """
    angle = generator.uniform(0, 2 * math.pi)
    direction = orientation.T @ [math.cos(angle), math.sin(angle), 0.0]
    way = uniform(generator, ranges["way"])
    legs: list[Segment] = []
    start = uniform(generator, ranges["rest"])
    while start < duration:
        side = 1.0 if len(legs) % 2 == 0 else -1.0
        time = uniform(generator, ranges["duration"])
        legs.append(Segment("carry", start, time, side * direction, way, 0.0))
        start += time + uniform(generator, ranges["rest"])
    return legs


def person_acceleration(
    generator: np.random.Generator, ranges: Mapping[str, Any], orientation: Array, duration: float
) -> Array:
    """Compute the acceleration of a person's hand that carries something, in the palm frame.

    It trembles all the time, and walks in bouts: up and down with each step, half as far to the
    fore, and half as far to the side with every second step. Both begin within half a second.

    Args:
        generator: of all that is drawn.
        ranges: of `person` in `measured.toml`.
        orientation: (3, 3) rotation from the palm frame to the world.
        duration: [s].

    Returns:
        (n, 3) at steps of 1 / GRID_RATE [m/s^2].
    """
    times = np.arange(int(duration * GRID_RATE) + 1) / GRID_RATE
    tremor = log_uniform(generator, ranges["tremor"])
    low, high = ranges["tremor_rate"]
    rates = 2 * math.pi * generator.uniform(low, high, size=(N_TREMOR_WAVES, 3))
    phases = generator.uniform(0, 2 * math.pi, size=(N_TREMOR_WAVES, 3))
    waves = np.sin(rates * times[:, None, None] + phases).sum(axis=1)
    trembling = tremor * math.sqrt(2 / N_TREMOR_WAVES) * waves
    begun = np.minimum(times / BOUT_FADE, 1.0)[:, None]
    return np.asarray(begun * (trembling + _walking(generator, ranges, times) @ orientation))


def _walking(generator: np.random.Generator, ranges: Mapping[str, Any], times: Array) -> Array:
    """(n, 3) acceleration in the world [m/s^2]."""
    rise = log_uniform(generator, ranges["rise"])
    rate = 2 * math.pi * uniform(generator, ranges["step_rate"])
    heading = generator.uniform(0, 2 * math.pi)
    phase, beat = generator.uniform(0, 2 * math.pi, size=2)
    fore = np.array([math.cos(heading), math.sin(heading), 0.0])
    side = np.array([-fore[1], fore[0], 0.0])
    accelerations = (
        (np.array([0.0, 0.0, 1.0]), rise * rate**2, rate, 0.0),
        (fore, rise / 2 * rate**2, rate, phase),
        (side, rise / 2 * (rate / 2) ** 2, rate / 2, beat),
    )
    waves = sum(
        direction * (size * np.sin(speed * times + shift))[:, None]
        for direction, size, speed, shift in accelerations
    )
    # Walking and standing take turns; the first is drawn. The mean over a moving window of the
    # fade makes each begin and end slowly.
    edges, walks = [0.0], generator.random() < 0.5
    while edges[-1] < times[-1]:
        edges.append(edges[-1] + uniform(generator, ranges["bout"]))
    states = (np.arange(len(edges)) + walks) % 2
    now = states[np.searchsorted(edges, times, side="right") - 1].astype(np.float64)
    n_fade = int(BOUT_FADE * GRID_RATE)
    padded = np.concatenate([np.full(n_fade, now[0]), now])
    bouts = np.convolve(padded, np.ones(n_fade) / n_fade)[n_fade : n_fade + len(now)]
    return np.asarray(bouts[:, None] * waves)
