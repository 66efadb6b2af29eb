"""What `steps.advance_sample` needs for a sample of physics, in c/physics.c."""

from typing import NamedTuple

from holdfast.sensors.types import Array
from holdfast.twin.contact import Constants, Contact
from holdfast.twin.control import Controller
from holdfast.twin.hand import HandArrays


class Action(NamedTuple):
    """Action of the operator during a sample, and the loads on the object.

    Attributes:
        anchor: (12,) position and rotation at which the operator holds the object.
        hold: grip of the operator, from 0 (released) to 1.
        weight: weight of the object, which the operator carries [N].
        tremors: (2, 3, n, 3) tremor of the hand that holds, and of the hand or finger that
            disturbs.
        rms: rms of both tremors [m].
        time: time at the beginning of the sample [s].
        parameters: (9,) parameters of the `Disturbance`.
        origin: (12,) position and rotation of the object when the disturbance began.
        style: style of the disturbance; -1 for none.
        duration: duration of the disturbance [s].
        elapsed: time since it began [s].
        pull: (6,) force [N] and torque [N m] of the loads on the object.
        guide: (N_GUIDE,) hand that guides the object, see `guide_wrench`.
    """

    anchor: Array
    hold: float
    weight: float
    tremors: Array
    rms: float
    time: float
    parameters: Array
    origin: Array
    style: int
    duration: float
    elapsed: float
    pull: Array
    guide: Array


class Physics(NamedTuple):
    """State of hand, object and contact, which a step writes in place, and what it needs.

    Attributes:
        arrays: arrays of MuJoCo's state.
        contact: state of the contact.
        constants: skin and object.
        controller: controller of the hand.
        bodies: (5, 18) fingertip frames and object.
        outside: (6,) force [N] and torque about the centre of mass [N m] of operator and loads on
            the object, in the world frame.
        total: (6,) the same of operator, loads and fingers.
        n_steps: steps of a sample.
        period: duration of a step [s], that of the model.
        per_control: steps in a step of the controller.
    """

    arrays: HandArrays
    contact: Contact
    constants: Constants
    controller: Controller
    bodies: Array
    outside: Array
    total: Array
    n_steps: int
    period: float
    per_control: int
