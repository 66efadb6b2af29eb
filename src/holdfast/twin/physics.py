"""One sample of physics: seven steps of MuJoCo, contact, operator and controller, in physics.c.

MuJoCo's half steps are called from C by their addresses, because a call from Python with its
arrays costs as much as the half step. The addresses are private parts of its package:
where they do not work, the same steps are called from Python, with the same result.
"""

import ctypes
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from holdfast.sensors.types import Array
from holdfast.twin.contact import Constants, Contact
from holdfast.twin.control import Controller
from holdfast.twin.hand import HandArrays, HandModel
from holdfast.twin.mujoco_import import mujoco
from holdfast.twin.steps import advance_sample, apply_all

FALLING_BODY = """<mujoco><worldbody>
  <body><freejoint/><geom size=".01"/></body>
</worldbody></mujoco>"""
"""Model with which the addresses are checked."""


class HalfSteps(NamedTuple):
    """Addresses of MuJoCo's half steps, of a model and of its state.

    Attributes:
        first_half: address of `mj_step1`.
        second_half: address of `mj_step2`.
        model: address of the model.
        data: address of the state; the model and the state must live as long as this.
    """

    first_half: int
    second_half: int
    model: int
    data: int


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


class Wrenches(NamedTuple):
    """Force [N] and torque about the centre of mass [N m] on the object, in the world frame.

    Attributes:
        outside: (6,) of operator and loads.
        total: (6,) of operator, loads and fingers.
    """

    outside: Array
    total: Array


class Steps(NamedTuple):
    """Steps of a sample.

    Attributes:
        n: number of steps.
        period: duration of a step [s], that of the model.
        per_control: steps in a step of the controller.
    """

    n: int
    period: float
    per_control: int


class Physics(NamedTuple):
    """State of hand, object and contact, which a step writes in place, and what it needs.

    Attributes:
        steps: of a sample.
        arrays: arrays of MuJoCo's state.
        contact: state of the contact.
        constants: skin and object.
        controller: controller of the hand.
        bodies: (5, 18) fingertip frames and object.
        wrenches: force and torque on the object.
    """

    steps: Steps
    arrays: HandArrays
    contact: Contact
    constants: Constants
    controller: Controller
    bodies: Array
    wrenches: Wrenches


def advance_of(hand: HandModel) -> Callable[..., float]:
    """Return `advance_sample` of a hand; without its addresses `advance_sample_by_calls`.

    All arguments but the first remain.
    """
    if addresses_work():
        return partial(advance_sample, engine_of(hand.model, hand.data))
    return partial(advance_sample_by_calls, hand)


def engine_of(model: mujoco.MjModel, data: mujoco.MjData) -> HalfSteps:
    """Return the addresses with which physics.c steps a model."""
    library = _library()
    return HalfSteps(
        _address(library.mj_step1), _address(library.mj_step2), model._address, data._address
    )


@cache
def addresses_work() -> bool:
    """Return whether MuJoCo's half steps by their addresses do what its public functions do.

    The library's version and the first number of the model are compared before anything is
    called, and then a body that falls.
    """
    model = mujoco.MjModel.from_xml_string(FALLING_BODY)
    by_address, by_call = mujoco.MjData(model), mujoco.MjData(model)
    try:
        engine = engine_of(model, by_address)
        same_version = _library().mj_version() == mujoco.mj_version()
    except (AttributeError, OSError, TypeError):
        return False
    if not same_version or ctypes.c_int32.from_address(engine.model).value != model.nq:
        return False
    pointers = ctypes.c_void_p(engine.model), ctypes.c_void_p(engine.data)
    for _ in range(3):
        _library().mj_step1(*pointers)
        _library().mj_step2(*pointers)
        mujoco.mj_step1(model, by_call)
        mujoco.mj_step2(model, by_call)
    same_time = by_address.time == by_call.time > 0
    return bool(same_time and (by_address.qpos == by_call.qpos).all())


@cache
def _library() -> ctypes.CDLL:
    # The extension module finds the library that it was linked to, except on Windows.
    windows = Path(mujoco.__file__).with_name("mujoco.dll")
    return ctypes.CDLL(str(windows) if sys.platform == "win32" else mujoco._functions.__file__)


def _address(function: Any) -> int:  # noqa: ANN401 (a function of a library)
    # Not by `ctypes.cast`: an interrupt within it becomes an error of its argument.
    return ctypes.c_size_t.from_address(ctypes.addressof(function)).value


def advance_sample_by_calls(
    hand: HandModel, physics: Physics, tick: int, target: Array, action: Action
) -> float:
    """Advance the physics by one sample, as `advance_sample`, by MuJoCo's public functions."""
    worst, time = 0.0, action.time
    for k in range(physics.steps.n):
        mujoco.mj_step1(hand.model, hand.data)
        worst = max(worst, apply_all(physics, tick, k, target, action, time))
        mujoco.mj_step2(hand.model, hand.data)
        time += physics.steps.period  # as MuJoCo adds it
    return worst
