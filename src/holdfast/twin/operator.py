"""The operator: holds the object until it is locked, disturbs it, and takes it back.

There are two kinds of disturbances. A hand grips the object and moves it to and fro without losing
contact, as in the paper. Or a finger approaches from outside, pushes and leaves. Hand and finger
have finite stiffness and tremor, because a pure force would make every object fall at once.
"""

import math
from typing import NamedTuple

import numpy as np

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.profile import Profile

HOLD_STIFFNESS, HOLD_DAMPING = 250.0, 10.0
"""Stiffness [N/m] and damping [N s/m] of the hand that holds the object: a relaxed human arm."""
HOLD_TURN_STIFFNESS, HOLD_TURN_DAMPING = 0.25, 0.01
"""Stiffness [N m/rad] and damping [N m s/rad] of that hand in rotation."""
PUSH_DAMPING = 8.0
"""Damping of the pushing finger [N s/m]."""
PUSH_LIMIT = 14.0
"""Maximum force of the pushing finger [N]."""
PUSH_GAP = 0.002
"""Distance from the object at which the pushing finger starts [m]."""
ARM_SPREAD = 0.006
"""Standard deviation of the place where the finger pushes, about the centre of mass [m]."""
TREMOR_BAND = (6.0, 11.0)
"""Frequencies of physiological tremor [Hz]."""
N_TREMORS = 8
"""Number of sinusoids in the tremor."""
MOVE_GRASP_TIME = 0.15
"""Time in which a hand that moves the object closes on it, and opens again [s]."""

GUIDE_STIFFNESS, N_GUIDE = 18, 23
"""Place of the stiffness among the numbers of a guiding hand, and their count."""
NO_GUIDE = np.zeros(N_GUIDE)
"""A guiding hand that does not touch the object."""

PUSH, JERK, SHAKE, MOVE = range(4)
"""Styles of a disturbance: a finger pushes, strikes or shakes; a hand grips the object and moves
it."""

DIRECTIONS = {
    "down": (0.0, 0.0, -1.0),
    "up": (0.0, 0.0, 1.0),
    "left": (0.0, -1.0, 0.0),
    "right": (0.0, 1.0, 0.0),
}
"""Directions with a name, in the world; the other disturbances have a random direction."""
PUSH_DIRECTIONS = (*DIRECTIONS, "random", "random")
"""Directions of the disturbances of a grasp, in turn."""


class Disturbance(NamedTuple):
    """One disturbance.

    Attributes:
        start: time after the object was locked [s].
        duration: duration [s].
        direction: "down", "up", "left", "right" or "random".
        style: PUSH, JERK, SHAKE or MOVE.
        parameters: (9,) unit vector of the direction, point of contact relative to the centre
            of mass [m], depth [m], stiffness [N/m], rate of shaking or moving [Hz].
    """

    start: float
    duration: float
    direction: str
    style: int
    parameters: Array


def draw_disturbances(
    generator: np.random.Generator, profile: Profile, scale: float = 1.0
) -> list[Disturbance]:
    """Draw disturbances that fill the hold: all named directions and two random ones, in turn.

    Args:
        generator: random number generator.
        profile: profile with the ranges of all values.
        scale: factor of the depths.
    """
    disturbances: list[Disturbance] = []
    start = float(generator.uniform(1.0, 1.5))
    while True:
        name = PUSH_DIRECTIONS[len(disturbances) % len(PUSH_DIRECTIONS)]
        push = draw_disturbance(generator, profile, start, name, scale)
        if push.start + push.duration + 1.0 > profile.hold:
            return disturbances
        disturbances.append(push)
        start = push.start + push.duration + float(generator.uniform(*profile.rest))


def draw_tremor(generator: np.random.Generator) -> Array:
    """Draw amplitudes, angular rates [rad/s] and phases of a tremor of rms 1, (3, N_TREMORS, 3)."""
    tremor = np.empty((3, N_TREMORS, 3))
    weights = generator.uniform(0.5, 1.0, size=(3, N_TREMORS))
    tremor[:, :, 0] = weights * np.sqrt(2.0 / (weights**2).sum(axis=1, keepdims=True))
    tremor[:, :, 1] = 2 * np.pi * generator.uniform(*TREMOR_BAND, size=(3, N_TREMORS))
    tremor[:, :, 2] = generator.uniform(0.0, 2 * np.pi, size=(3, N_TREMORS))
    return tremor


@compiled
def tremor_at(tremor: Array, time: float, axis: int) -> tuple[float, float]:
    """Return displacement and speed of a tremor of rms 1 along an axis."""
    place = speed = 0.0
    for k in range(tremor.shape[1]):
        amplitude, rate, phase = tremor[axis, k]
        place += amplitude * math.sin(rate * time + phase)
        speed += amplitude * rate * math.cos(rate * time + phase)
    return place, speed


@compiled
def hold_wrench(
    body: Array, anchor: Array, gain: float, weight: float, tremor: Array, rms: float, time: float
) -> tuple[float, float, float, float, float, float]:
    """Compute force and torque of the hand that holds the object.

    Args:
        body: (18,) position, rotation, velocity and spin of the object in the world.
        anchor: (12,) position and rotation to which the hand pulls the object.
        gain: from 0 (released) to 1.
        weight: weight of the object, which the hand carries [N].
        tremor: tremor of the hand.
        rms: rms of the tremor [m].
        time: time [s].

    Returns:
        Force [N] and torque about the centre of mass [N m] in the world.
    """
    force = np.zeros(3)
    for axis in range(3):
        place, speed = tremor_at(tremor, time, axis)
        stretch = anchor[axis] + rms * place - body[axis]
        force[axis] = HOLD_STIFFNESS * stretch + HOLD_DAMPING * (rms * speed - body[12 + axis])
    turn = _turn_to(body, anchor)
    torque = HOLD_TURN_STIFFNESS * turn - HOLD_TURN_DAMPING * body[15:18]
    return (
        gain * force[0],
        gain * force[1],
        gain * (force[2] + weight),
        gain * torque[0],
        gain * torque[1],
        gain * torque[2],
    )


@compiled
def disturb_wrench(
    body: Array,
    origin: Array,
    parameters: Array,
    style: int,
    duration: float,
    tremor: Array,
    rms: float,
    elapsed: float,
) -> tuple[float, float, float, float, float, float]:
    """Compute force and torque of a disturbance of any style, see `push_wrench`."""
    if style == MOVE:
        return move_wrench(body, origin, parameters, duration, tremor, rms, elapsed)
    return push_wrench(body, origin, parameters, style, duration, tremor, rms, elapsed)


@compiled
def guide_wrench(
    body: Array, guide: Array, ahead: float, tremor: Array, time: float
) -> tuple[float, float, float, float, float, float]:
    """Compute force and torque of a steady hand that takes the object along.

    The hand is a damped spring to a pose that moves with a constant velocity and spin.

    Args:
        body: (18,) position, rotation, velocity and spin of the object in the world.
        guide: (N_GUIDE,) pose [m], its velocity [m/s] and spin [rad/s], stiffness [N/m] and
            damping [N s/m], both in rotation [N m/rad, N m s/rad], rms of the tremor [m].
        ahead: time since the pose was set [s].
        tremor: tremor of the hand.
        time: time [s].

    Returns:
        Force [N] and torque about the centre of mass [N m] in the world.
    """
    stiffness, damping, turn_stiffness, turn_damping, rms = guide[GUIDE_STIFFNESS:]
    force = np.zeros(3)
    for axis in range(3):
        place, speed = tremor_at(tremor, time, axis)
        velocity = guide[12 + axis]
        stretch = guide[axis] + velocity * ahead + rms * place - body[axis]
        force[axis] = stiffness * stretch + damping * (velocity + rms * speed - body[12 + axis])
    spin = guide[15:18]
    turn = _turn_to(body, guide) + ahead * spin
    torque = turn_stiffness * turn + turn_damping * (spin - body[15:18])
    return force[0], force[1], force[2], torque[0], torque[1], torque[2]


@compiled
def _turn_to(body: Array, anchor: Array) -> Array:
    """Return the rotation to an anchor, small angles: half the sum of r x r_anchor [rad]."""
    turn = np.zeros(3)
    for column in range(3):
        x, y, z = body[3 + column], body[6 + column], body[9 + column]
        u, v, w = anchor[3 + column], anchor[6 + column], anchor[9 + column]
        turn[0] += 0.5 * (y * w - z * v)
        turn[1] += 0.5 * (z * u - x * w)
        turn[2] += 0.5 * (x * v - y * u)
    return turn


@compiled
def push_wrench(
    body: Array,
    origin: Array,
    parameters: Array,
    style: int,
    duration: float,
    tremor: Array,
    rms: float,
    elapsed: float,
) -> tuple[float, float, float, float, float, float]:
    """Compute force and torque of the pushing finger, which never pulls.

    Args:
        body: (18,) position, rotation, velocity and spin of the object in the world.
        origin: (3,) position of the centre of mass when the push began [m].
        parameters: parameters of the `Disturbance`.
        style: PUSH, JERK or SHAKE.
        duration: duration of the push [s].
        tremor: tremor of the finger.
        rms: rms of the tremor [m].
        elapsed: time since the push began [s].

    Returns:
        Force [N] and torque about the centre of mass [N m] in the world.
    """
    ux, uy, uz, ax, ay, az, depth, stiffness, rate = parameters
    aim, aim_speed = _aim(style, depth, rate, elapsed, duration)
    place, speed = tremor_at(tremor, elapsed, 0)
    aim += rms * place - PUSH_GAP
    aim_speed += rms * speed
    along = ux * (body[0] - origin[0]) + uy * (body[1] - origin[1]) + uz * (body[2] - origin[2])
    vx = body[12] + body[16] * az - body[17] * ay
    vy = body[13] + body[17] * ax - body[15] * az
    vz = body[14] + body[15] * ay - body[16] * ax
    pace = ux * vx + uy * vy + uz * vz
    force = stiffness * (aim - along) + PUSH_DAMPING * (aim_speed - pace)
    if aim <= along:
        force = 0.0
    force = min(max(force, 0.0), PUSH_LIMIT)
    fx, fy, fz = force * ux, force * uy, force * uz
    return fx, fy, fz, ay * fz - az * fy, az * fx - ax * fz, ax * fy - ay * fx


@compiled
def move_wrench(
    body: Array,
    origin: Array,
    parameters: Array,
    duration: float,
    tremor: Array,
    rms: float,
    elapsed: float,
) -> tuple[float, float, float, float, float, float]:
    """Compute force and torque of a hand that grips the object and moves it to and fro.

    The hand is a damped spring to the pose in which it gripped the object, displaced along the
    direction by depth * sin(2 pi n t / T), n whole cycles in the duration T. It does not carry
    the weight of the object.

    Args:
        body: (18,) position, rotation, velocity and spin of the object in the world.
        origin: (12,) position and rotation of the object when the hand gripped it.
        parameters: parameters of the `Disturbance`; the point of contact is not used.
        duration: duration of the disturbance [s].
        tremor: tremor of the hand.
        rms: rms of the tremor [m].
        elapsed: time since the disturbance began [s].

    Returns:
        Force [N] and torque about the centre of mass [N m] in the world.
    """
    depth, stiffness, rate = parameters[6], parameters[7], parameters[8]
    turning = 2 * math.pi * max(1.0, np.rint(rate * duration)) / duration
    way = depth * math.sin(turning * elapsed)
    speed = depth * turning * math.cos(turning * elapsed)
    closed = min(elapsed, duration - elapsed) / MOVE_GRASP_TIME
    gain = min(max(closed, 0.0), 1.0) * stiffness / HOLD_STIFFNESS
    anchor = origin.copy()
    for axis in range(3):
        anchor[axis] += parameters[axis] * way
    fx, fy, fz, tx, ty, tz = hold_wrench(body, anchor, gain, 0.0, tremor, rms, elapsed)
    drag = gain * HOLD_DAMPING * speed
    return (
        fx + drag * parameters[0],
        fy + drag * parameters[1],
        fz + drag * parameters[2],
        tx,
        ty,
        tz,
    )


@compiled
def _aim(
    style: int, depth: float, rate: float, elapsed: float, duration: float
) -> tuple[float, float]:
    """Return the set-point of the pushing finger along its direction [m] and its speed [m/s]."""
    pulse = math.pi / duration
    if style == PUSH:  # a raised cosine, there and back
        return (
            0.5 * (depth + PUSH_GAP) * (1 - math.cos(2 * pulse * elapsed)),
            (depth + PUSH_GAP) * pulse * math.sin(2 * pulse * elapsed),
        )
    if style == JERK:  # a sharper blow: the fourth power of a half sine
        wave = math.sin(pulse * elapsed)
        return (
            (depth + PUSH_GAP) * wave**4,
            4 * (depth + PUSH_GAP) * wave**3 * math.cos(pulse * elapsed) * pulse,
        )
    turning = 2 * math.pi * rate
    rise = math.sin(pulse * elapsed)  # shaking swells and fades
    return (
        (depth + PUSH_GAP) * rise * (0.5 - 0.5 * math.cos(turning * elapsed)),
        (depth + PUSH_GAP)
        * (
            pulse * math.cos(pulse * elapsed) * (0.5 - 0.5 * math.cos(turning * elapsed))
            + rise * 0.5 * turning * math.sin(turning * elapsed)
        ),
    )


def draw_disturbance(
    generator: np.random.Generator, profile: Profile, start: float, name: str, scale: float
) -> Disturbance:
    """Draw one disturbance.

    Args:
        generator: random number generator.
        profile: profile with the ranges of all values.
        start: time after the lock [s].
        name: direction, see `Disturbance`.
        scale: factor of the depth.
    """
    drawn = generator.normal(size=3)
    direction = np.array(DIRECTIONS.get(name, tuple(drawn / np.linalg.norm(drawn))))
    arm = generator.normal(0.0, ARM_SPREAD, size=3)
    arm -= direction * (arm @ direction)
    depth = scale * generator.uniform(*profile.push_depth)
    stiffness = generator.uniform(*profile.push_stiffness)
    rate = generator.uniform(*profile.shake_rate)
    duration = float(generator.uniform(*profile.push_duration))
    style = int(generator.integers(3))
    if profile.move_share > 0 and generator.random() < profile.move_share:
        style = MOVE
        depth = scale * generator.uniform(*profile.move_depth)
        stiffness = generator.uniform(*profile.move_stiffness)
        rate = generator.uniform(*profile.move_rate)
        duration = float(generator.uniform(*profile.move_duration))
    parameters = np.array([*direction, *arm, depth, stiffness, rate])
    return Disturbance(start, duration, name, style, parameters)
