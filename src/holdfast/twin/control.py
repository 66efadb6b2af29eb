"""Position controller of the hand: PD control with the imperfections of a real controller.

Encoders and torques are quantised, torques have noise and limits, and gravity is compensated
only in part. Now and then a set-point jumps for a moment: the glitches that the paper reports.
"""

from typing import NamedTuple

import numpy as np

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.hand import JOINTS, N_JOINTS

STEPS_PER_CONTROL = 3
"""Physics steps per control step, which gives 350 Hz; the real controller runs at 333 Hz."""
PROPORTIONAL = np.tile([2.2, 2.6, 2.0, 1.5], 4)
"""Gain of each joint [N m/rad], between the gains of the vendor's two drivers."""
DERIVATIVE = 0.03
"""Gain of each joint [N m s/rad]; the hand rings a little at 6 to 8 Hz, like the real one."""
ENCODER_STEP = 333.3 / 65536 * np.pi / 180
"""Resolution of the joint angles [rad], from the hand's protocol."""
TORQUE_STEP, TORQUE_NOISE, TORQUE_LIMIT = 1e-3, 1.5e-3, 0.7
"""Step of the PWM, noise (own choice) and nominal limit of the hand [N m]. With the limits of the
vendor's ROS driver (0.225 N m at the end of the thumb) it could press with at most 2 N."""
COMPENSATION = (0.90, 1.05)
"""Range of the compensated share of gravity, drawn once for each joint."""
ANGLE_MEMORY, ANGLE_PART = 0.6, 0.198
"""Filter of the vendor's driver for the angles that it publishes:
y = 0.6 y + 0.198 (x_last + x)."""
GLITCH_ERROR, GLITCH_TICKS = 0.08, (2, 8)
"""Standard deviation of the set-point's error in a glitch [rad], and its duration in control steps.
Own choices, after the spikes in the paper's figures. The profile has the rate of glitches."""


class Controller(NamedTuple):
    """Random numbers of the controller for one grasp, and its state.

    Attributes:
        compensation: (16,) compensated share of gravity.
        noise: (n, 16) noise of the torques [N m], used in turn.
        errors: (n_ticks, 16) errors of the set-points in glitches, 0 otherwise [rad].
        last: (16,) joint angles at the previous step [rad].
        published: (16,) joint angles that the driver publishes, filtered [rad].
        geared: (16,) angles of the encoders, which follow the joints with backlash [rad].
        backlash: width of the play between encoder and joint [rad].
    """

    compensation: Array
    noise: Array
    errors: Array
    last: Array
    published: Array
    geared: Array
    backlash: float


def draw_controller(
    generator: np.random.Generator,
    duration: float,
    period: float,
    glitch_rate: float,
    *,
    glitch_error: float = GLITCH_ERROR,
    backlash: float = 0.0,
) -> Controller:
    """Draw the random numbers of a controller.

    Args:
        generator: random number generator.
        duration: time for which the controller is needed [s].
        period: period of its steps [s].
        glitch_rate: glitches per second [1/s].
        glitch_error: standard deviation of the set-points' errors in a glitch [rad].
        backlash: width of the play between encoder and joint [rad].
    """
    n_ticks = int(duration / period) + 1
    errors = np.zeros((n_ticks, N_JOINTS))
    for _ in range(generator.poisson(glitch_rate * duration)):
        tick = int(generator.integers(n_ticks))
        ticks = int(generator.integers(*GLITCH_TICKS))
        first = list(JOINTS.values())[int(generator.integers(len(JOINTS)))]
        errors[tick : tick + ticks, first : first + 4] = generator.normal(0.0, glitch_error, 4)
    return Controller(
        compensation=generator.uniform(*COMPENSATION, size=N_JOINTS),
        noise=TORQUE_NOISE * generator.standard_normal((4096, N_JOINTS)),
        errors=errors,
        last=np.full(N_JOINTS, np.nan),
        published=np.full(N_JOINTS, np.nan),
        geared=np.full(N_JOINTS, np.nan),
        backlash=backlash,
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
    """Compute one step: tau = k_p e - k_d dq/dt + gravity, quantised, with noise and limits.

    Args:
        controller: the controller; its angles are written.
        tick: number of the step.
        joints: (16 or more,) joint angles [rad].
        bias: (16 or more,) torques that balance gravity and motion [N m].
        target: (16,) set-points [rad].
        period: period of the steps [s].
        torques: (16 or more,) the first 16 are written [N m].
    """
    row = min(tick, len(controller.errors) - 1)
    noise_row = tick % len(controller.noise)
    for j in range(N_JOINTS):
        if np.isnan(controller.geared[j]):
            controller.geared[j] = joints[j]
        # A play of width b lets the encoder rest until the joint takes it along.
        half = 0.5 * controller.backlash
        geared = min(max(controller.geared[j], joints[j] - half), joints[j] + half)
        controller.geared[j] = geared
        angle = ENCODER_STEP * np.rint(geared / ENCODER_STEP)
        speed = (angle - controller.last[j]) / period
        if np.isnan(speed):
            speed = 0.0
            controller.last[j] = controller.published[j] = angle
        controller.published[j] *= ANGLE_MEMORY
        controller.published[j] += ANGLE_PART * (controller.last[j] + angle)
        controller.last[j] = angle
        error = target[j] + controller.errors[row, j] - angle
        torque = PROPORTIONAL[j] * error - DERIVATIVE * speed
        torque += controller.compensation[j] * bias[j]
        torque = TORQUE_STEP * np.rint(torque / TORQUE_STEP) + controller.noise[noise_row, j]
        torques[j] = min(max(torque, -TORQUE_LIMIT), TORQUE_LIMIT)
