"""Motion of the palm that carries a held object, and what the object feels of it.

Everything is simulated in the frame of the palm. A palm that accelerates changes the apparent
gravity there; a palm that turns also turns the object against its own inertia.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

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
"""Motions of an arm: to another place, to and fro, a sudden stop, a turn against gravity."""


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
    # The vibration grows while the arm moves; it fades in and out at the ends of a segment.
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
    place = 0
    for row, step in zip(moving.tolist(), steps, strict=True):
        down[place:row] = now
        now = step @ now
        place = row
    down[place:] = now
    return down
