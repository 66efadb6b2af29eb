"""The position controller of the hand: a plain PD with what a real one adds to it.

Encoders and torques have steps, torques have noise and limits, gravity is compensated almost,
and now and then a set-point jumps for a moment, the glitches that the paper reports.
"""

from typing import NamedTuple

import numpy as np

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.hand import JOINTS, N_JOINTS

EVERY = 3
"""Steps of the physics between two of the controller: 350 Hz; the real one runs at 333 Hz."""
PROPORTIONAL = np.tile([2.2, 2.6, 2.0, 1.5], 4)
"""By joint of a finger [N m/rad]; between the gains that the vendor's two drivers ship."""
DERIVATIVE = 0.03
"""[N m s/rad]: rings a little at 6 to 8 Hz, as the real hand does."""
ENCODER_STEP = 333.3 / 65536 * np.pi / 180
"""Of the joint angles [rad], by the hand's protocol."""
TORQUE_STEP, TORQUE_NOISE, TORQUE_LIMIT = 1e-3, 1.5e-3, 0.7
"""[N m]: step of the PWM, own choice of its noise, and the hand's nominal limit. The clamps of the
vendor's ROS driver (0.225 N m at the end of the thumb) would let it press with 2 N at most."""
COMPENSATION = (0.90, 1.05)
"""Share of gravity that is compensated; drawn once for each joint."""
GLITCH_ERROR, GLITCH_TICKS = 0.08, (2, 8)
"""Of a glitch: standard deviation of the set-point's error [rad], and control steps that it lasts.
Own choices, after the spikes in the paper's figures. How often they come is in the profile."""


class Controller(NamedTuple):
    """What was drawn for a grasp, and what the controller remembers.

    Attributes:
        compensation: (16,) share of gravity.
        noise: (n, 16) of the torques [N m], used in turn.
        errors: (n_ticks, 16) of the set-points [rad]: the glitches.
        last: (16,) joint angles at the step before [rad].
    """

    compensation: Array
    noise: Array
    errors: Array
    last: Array


def draw_controller(
    generator: np.random.Generator, duration: float, period: float, glitch_rate: float
) -> Controller:
    """Draw what is random of a controller.

    Args:
        generator: of all that is drawn.
        duration: for which it is needed [s].
        period: of its steps [s].
        glitch_rate: glitches per second [1/s].
    """
    n_ticks = int(duration / period) + 1
    errors = np.zeros((n_ticks, N_JOINTS))
    for _ in range(generator.poisson(glitch_rate * duration)):
        tick = int(generator.integers(n_ticks))
        ticks = int(generator.integers(*GLITCH_TICKS))
        first = list(JOINTS.values())[int(generator.integers(len(JOINTS)))]
        errors[tick : tick + ticks, first : first + 4] = generator.normal(0.0, GLITCH_ERROR, 4)
    return Controller(
        compensation=generator.uniform(*COMPENSATION, size=N_JOINTS),
        noise=TORQUE_NOISE * generator.standard_normal((4096, N_JOINTS)),
        errors=errors,
        last=np.full(N_JOINTS, np.nan),
    )


@compiled
def control(
    controller: Controller,
    tick: int,
    joints: Array,
    bias: Array,
    target: Array,
    period: float,
    torques: Array,
) -> None:
    """One step: tau = k_p e - k_d dq/dt + gravity, in steps, with noise, within limits.

    Args:
        controller: its last angles are written.
        tick: number of the step.
        joints: (16 or more,) angles [rad].
        bias: (16 or more,) what gravity and motion need [N m].
        target: (16,) set-points [rad].
        period: of the steps [s].
        torques: (16 or more,) first 16 are filled [N m].
    """
    late = min(tick, len(controller.errors) - 1)
    turn = tick % len(controller.noise)
    for j in range(N_JOINTS):
        angle = ENCODER_STEP * np.rint(joints[j] / ENCODER_STEP)
        speed = (angle - controller.last[j]) / period
        if np.isnan(speed):
            speed = 0.0
        controller.last[j] = angle
        error = target[j] + controller.errors[late, j] - angle
        torque = PROPORTIONAL[j] * error - DERIVATIVE * speed
        torque += controller.compensation[j] * bias[j]
        torque = TORQUE_STEP * np.rint(torque / TORQUE_STEP) + controller.noise[turn, j]
        torques[j] = min(max(torque, -TORQUE_LIMIT), TORQUE_LIMIT)
