"""Plants: named sets of the imperfections of a hand between a command and its fingers.

`mild` is the hand of all recordings of the twin: a command acts with the next sample. `hard` is
nearer to a real hand. Its numbers were chosen before any law ran on it, on these grounds:

- Latency: a sample of uSkin passes its own bus (CAN, all fingertips in turn), XELA's server and a
  socket; joint angles pass the bus of the hand. 13 to 33 ms together, 2 to 5 samples, drawn once
  for each trial.
- Motor: a force follows its command with a lag of the first order. 25 ms is a bandwidth of 6.4 Hz;
  the position loop of the twin, with stiffnesses of the vendor's drivers, rings at 6 to 8 Hz.
- Joint friction: 0.03 N m, 2.5 times the mild one, is 0.3 N at a fingertip 0.1 m from the joint,
  as of gears that are hard to turn back by hand. The vendor has no figure: own choice.
- Backlash: 0.01 rad (0.6 degrees) between the encoder and the joint, that of a good small gear
  train; the vendor has no figure: own choice. At 0.1 m it is 1 mm at the fingertip.
- Jerks: the driver exchanges 8 frames of CAN each 3 ms, 2,670 a second, and writes torques only
  when those of all fingers have arrived. If one frame of 10,000 is lost, delayed or wrong, a
  finger jerks 0.27 times a second, 16 times a minute. The driver clamps the torque of a joint to
  0.225 to 0.56 N m, so a jerk cannot be any size: a set-point that is off by 0.12 rad (standard
  deviation) asks the mean joint for 0.25 N m, and the largest torque of the twin limits the rest.
"""

import msgspec

from holdfast.twin.control import GLITCH_ERROR
from holdfast.twin.hand import FRICTION


class Plant(msgspec.Struct, frozen=True, kw_only=True):
    """Imperfections of a hand.

    Attributes:
        name: name of the plant.
        latency: least and largest latency of sensor and bus [samples].
        motor_time: time constant with which a force follows its command [s].
        joint_friction: dry friction of a joint [N m].
        backlash: width of the play between encoder and joint [rad].
        jerk_rate: jerks of the hand's controller [1/s]; None for that of the profile.
        jerk_size: standard deviation of the error of a set-point in a jerk [rad].
    """

    name: str
    latency: tuple[int, int] = (0, 0)
    motor_time: float = 0.0
    joint_friction: float = FRICTION
    backlash: float = 0.0
    jerk_rate: float | None = None
    jerk_size: float = GLITCH_ERROR


MILD = "mild"
PLANTS = {
    plant.name: plant
    for plant in (
        Plant(name=MILD),
        Plant(
            name="hard",
            latency=(2, 5),
            motor_time=0.025,
            joint_friction=0.03,
            backlash=0.01,
            jerk_rate=0.27,
            jerk_size=0.12,
        ),
    )
}
"""Plants by name."""


def plant_named(name: str) -> Plant:
    """Return the plant of that name.

    Raises:
        ValueError: there is no such plant; the message lists the names.

    Example:
        >>> plant_named("hard").latency
        (2, 5)
    """
    if name not in PLANTS:
        raise ValueError(f"unknown plant {name!r}; there are {', '.join(PLANTS)}")
    return PLANTS[name]
