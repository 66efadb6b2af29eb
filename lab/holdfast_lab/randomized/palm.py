"""Motion of the palm that carries a held object, and what the object feels of it.

Everything is simulated in the frame of the palm. A palm that accelerates changes the apparent
gravity there; a palm that turns also turns the object against its own inertia. What carries a
hand all the time is an arm as of the boxes, or a person.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from holdfast.sensors.types import Array
from holdfast.twin.hand import GRAVITY
from holdfast.twin.profile import Span

GRID_RATE = 1000.0
"""Rate at which a motion is tabulated [Hz]."""
N_VIBRATIONS = 12
"""Sinusoids that make up the vibration of the arm."""
VIBRATION_FADE = 0.1
"""Time in which the vibration of a moving arm rises and fades [s]."""
PALM_KINDS = ("carry", "swing", "brake", "turn")
"""Motions of an arm: to another position, to and fro, a sudden stop, a turn against gravity."""


class PalmMotion(NamedTuple):
    """The motion of the palm from the lock on, in steps of 1 / GRID_RATE.

    Attributes:
        gravity: (n, 3) apparent gravity in the palm frame [m/s^2].
        spin: (n, 3) angular velocity in the palm frame [rad/s].
        turn: (n, 3) angular acceleration in the palm frame [rad/s^2].
    """

    gravity: Array
    spin: Array
    turn: Array

    def at(self, time: float) -> int:
        """Return the row of a time since the lock [s]; the first before, the last after."""
        return min(max(int(time * GRID_RATE), 0), len(self.gravity) - 1)


class Segment(NamedTuple):
    """One motion of the arm.

    Attributes:
        kind: one of `PALM_KINDS`.
        start: since the lock [s].
        duration: [s].
        direction: (3,) unit vector of the motion, or axis of the turn, in the palm frame.
        size: distance [m], amplitude [m], speed before the stop [m/s], or angle [rad].
        rate: of a swing [Hz]; share of a brake's duration that the stop takes.
    """

    kind: str
    start: float
    duration: float
    direction: Array
    size: float
    rate: float


def uniform(generator: np.random.Generator, span: Span) -> float:
    """Draw between the ends of a range."""
    return float(generator.uniform(*span))


def log_uniform(generator: np.random.Generator, span: Span) -> float:
    """Draw between the ends of a range, evenly on a logarithmic scale."""
    return float(math.exp(generator.uniform(math.log(span[0]), math.log(span[1]))))


def draw_segment(
    generator: np.random.Generator, ranges: Mapping[str, Span], kind: str, start: float
) -> Segment:
    """Draw a motion of a kind that begins at a time since the lock [s].

    Args:
        generator: of all that is drawn.
        ranges: `{kind}_size`, `{kind}_duration` and, where it has one, `{kind}_rate`.
        kind: one of `PALM_KINDS`.
        start: since the lock [s].
    """
    direction = generator.standard_normal(3)
    direction /= np.linalg.norm(direction)
    rate = uniform(generator, ranges.get(f"{kind}_rate", (0.0, 0.0)))
    return Segment(
        kind,
        start,
        uniform(generator, ranges[f"{kind}_duration"]),
        direction,
        uniform(generator, ranges[f"{kind}_size"]),
        rate,
    )


def palm_motion(
    generator: np.random.Generator,
    segments: list[Segment],
    orientation: Array,
    vibration: float,
    duration: float,
    moving_factor: float = 1.0,
    carrier: Array | float = 0.0,
) -> PalmMotion:
    """Tabulate the motion of the palm.

    Args:
        generator: of the phases of the vibration.
        segments: motions in order of time, which do not overlap where they turn.
        orientation: (3, 3) rotation from the palm frame to the world at the lock.
        vibration: of the arm, rms of the acceleration [m/s^2].
        duration: of the table [s].
        moving_factor: on the vibration while the palm moves.
        carrier: (n, 3) acceleration of what carries the hand, added to all else [m/s^2].
    """
    times = np.arange(int(duration * GRID_RATE) + 1) / GRID_RATE
    # (n, 3) acceleration of an arm that is never quite still, between 3 and 40 Hz.
    rates = np.exp(generator.uniform(math.log(3.0), math.log(40.0), size=(N_VIBRATIONS, 3)))
    phases = generator.uniform(0, 2 * math.pi, size=(N_VIBRATIONS, 3))
    waves = np.sin(2 * math.pi * rates * times[:, None, None] + phases)
    acceleration = np.asarray(vibration * math.sqrt(2.0 / N_VIBRATIONS) * waves.sum(axis=1))
    # An arm vibrates more while it moves. Faded at the ends, because a step would be a jerk.
    factor = np.ones(len(times))
    for segment in segments:
        elapsed = times - segment.start
        edge = np.minimum(elapsed, segment.duration - elapsed) / VIBRATION_FADE
        factor = np.maximum(factor, 1.0 + (moving_factor - 1.0) * np.clip(edge, 0.0, 1.0))
    acceleration *= factor[:, None]
    spin, turn = np.zeros((2, len(times), 3))
    for segment in segments:
        rows = (times >= segment.start) & (times < segment.start + segment.duration)
        elapsed = times[rows] - segment.start
        if segment.kind == "turn":
            speed, rise = _min_jerk_rates(elapsed / segment.duration)
            spin[rows] = segment.direction * (segment.size / segment.duration * speed)[:, None]
            turn[rows] = segment.direction * (segment.size / segment.duration**2 * rise)[:, None]
        else:
            along = _acceleration(segment, elapsed)
            acceleration[rows] += segment.direction * along[:, None]
    gravity = _down(orientation, spin) * GRAVITY - (acceleration + carrier)
    return PalmMotion(gravity, spin, turn)


def _min_jerk_rates(s: Array) -> tuple[Array, Array]:
    """First and second derivative of the minimum-jerk course 10 s^3 - 15 s^4 + 6 s^5."""
    return 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)


def _acceleration(segment: Segment, elapsed: Array) -> Array:
    """Compute the acceleration of a straight motion along its direction [m/s^2]."""
    if segment.kind == "carry":
        return segment.size / segment.duration**2 * _min_jerk_rates(elapsed / segment.duration)[1]
    if segment.kind == "swing":
        turning = 2 * math.pi * segment.rate
        fade = np.clip(np.minimum(elapsed, segment.duration - elapsed) / 0.3, 0.0, 1.0)
        return -segment.size * turning**2 * np.sin(turning * elapsed) * fade
    # A brake: two half sines of equal area, one to speed up and a shorter one to stop.
    stop = segment.rate * segment.duration
    start = segment.duration - stop
    rising = elapsed < start
    pace = np.where(rising, elapsed / start, (elapsed - start) / stop)
    length = np.where(rising, start, -stop)
    return segment.size * math.pi / (2 * length) * np.sin(math.pi * pace)


def _down(orientation: Array, spin: Array) -> Array:
    """(n, 3) the direction of gravity in the palm frame, as the palm turns."""
    down = np.empty_like(spin)
    down[:] = orientation.T @ [0.0, 0.0, -1.0]
    moving = np.flatnonzero(spin.any(axis=1))
    if not len(moving):
        return down
    # Only the rows that turn are multiplied; the rows between two of them repeat the last.
    steps = Rotation.from_rotvec(-spin[moving] / GRID_RATE).as_matrix()
    now = down[0].copy()
    start = 0
    for row, step in zip(moving.tolist(), steps, strict=True):
        down[start:row] = now
        now = step @ now
        start = row
    down[start:] = now
    return down


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
    draw = generator.random()
    if draw < ranges["carry"]["share"]:
        return "carry"
    return "person" if draw > 1 - ranges["person"]["share"] else None


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
