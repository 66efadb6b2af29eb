"""A sample of physics: MuJoCo's steps, and the forces on hand and object between their halves."""

from typing import NamedTuple

from holdfast.sensors.types import Array
from holdfast.twin.contact import Constants, Contact
from holdfast.twin.control import Controller
from holdfast.twin.hand import SUBSTEPS, HandArrays, HandModel
from holdfast.twin.mujoco_import import mujoco
from holdfast.twin.steps import apply_all


class Action(NamedTuple):
    """What the operator does during a sample, and the loads on the object.

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
    period: float
    per_control: int


def advance_sample(
    hand: HandModel, physics: Physics, tick: int, target: Array, action: Action
) -> float:
    """Advance the physics by a sample; return the largest error of a set-point [rad].

    Args:
        hand: model and state of MuJoCo.
        physics: everything else; it is written.
        tick: number of the first step.
        target: (16,) set-points of the joints [rad].
        action: what the operator does.
    """
    worst = 0.0
    for k in range(SUBSTEPS):
        mujoco.mj_step1(hand.model, hand.data)
        worst = max(worst, apply_all(physics, tick, k, target, action, hand.data.time))
        mujoco.mj_step2(hand.model, hand.data)
    return worst
