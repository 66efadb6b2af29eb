"""Random numbers of the hand's position controller, whose steps are in control.c.

Torques have noise, and gravity is compensated only in part. Now and then a set-point
jumps for a moment: the glitches that the paper reports.
"""

from typing import NamedTuple

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.hand import JOINTS, N_JOINTS

STEPS_PER_CONTROL = 3
"""Physics steps per control step, which gives 350 Hz; the real controller runs at 333 Hz."""
PROPORTIONAL = np.tile([2.2, 2.6, 2.0, 1.5], 4)
"""Gain of each joint [N m/rad], between the gains of the vendor's two drivers."""
TORQUE_NOISE = 1.5e-3
"""Noise of a torque [N m] (own choice); control.c has its step and its limit."""
COMPENSATION = (0.90, 1.05)
"""Range of the compensated share of gravity, drawn once for each joint."""
GLITCH_ERROR, GLITCH_TICKS = 0.08, (2, 8)
"""Standard deviation of the set-point's error in a glitch [rad], and its duration in control steps.
Own choices, after the spikes in the paper's figures. The profile has the rate of glitches."""


class Controller(NamedTuple):
    """Random numbers of the controller for one grasp, and its state.

    Attributes:
        gains: (16,) gain of each joint [N m/rad].
        compensation: (16,) compensated share of gravity.
        noise: (n, 16) noise of the torques [N m], used in turn.
        errors: (n_ticks, 16) errors of the set-points in glitches, 0 otherwise [rad].
        last: (16,) joint angles at the previous step [rad].
        published: (16,) joint angles that the driver publishes, filtered [rad].
        geared: (16,) angles of the encoders, which follow the joints with backlash [rad].
        backlash: width of the play between encoder and joint [rad].
    """

    gains: Array
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
        gains=PROPORTIONAL,
        compensation=generator.uniform(*COMPENSATION, size=N_JOINTS),
        noise=TORQUE_NOISE * generator.standard_normal((4096, N_JOINTS)),
        errors=errors,
        last=np.full(N_JOINTS, np.nan),
        published=np.full(N_JOINTS, np.nan),
        geared=np.full(N_JOINTS, np.nan),
        backlash=backlash,
    )
