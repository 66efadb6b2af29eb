"""Everything physical at once: hand, object, contact, controller and operator, step by step."""

import mujoco
import numpy as np

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.contact import LOAD, SLIP, constants_of, new_contact, touch
from holdfast.twin.control import EVERY, Controller, control
from holdfast.twin.grasp import ClosingPath, object_pose
from holdfast.twin.hand import FINGERS, GRAVITY, N_JOINTS, SUBSTEPS, TIMESTEP, HandModel
from holdfast.twin.objects import Thing
from holdfast.twin.operator import MOVE, hold_wrench, move_wrench, push_wrench
from holdfast.twin.protocol import OPEN, Command, Plan
from holdfast.twin.surface import curved_fingertip

GONE = -0.3
"""Height under which a lost object is out of the picture and stays where it is [m]."""


class World:
    """One grasp of one object.

    Args:
        hand: with the object.
        thing: the object.
        path: on which the fingers close.
        controller: of the hand.
        tremors: (2, 3, n, 3) of the hand that holds and the finger that pushes.
        start: (3,) offset of the object's place [m] and (1,) of its turn [rad] at the start.
    """

    def __init__(
        self,
        hand: HandModel,
        thing: Thing,
        path: ClosingPath,
        controller: Controller,
        tremors: Array,
        start: Array,
        side: str = "right",
    ) -> None:
        surface = curved_fingertip()
        self.hand, self.thing, self.path = hand, thing, path
        self.controller, self.tremors = controller, tremors
        self.contact = new_contact(surface, len(FINGERS))
        self.constants = constants_of(surface, thing)
        self.bodies = np.zeros((len(FINGERS) + 1, 18))
        self.outside = np.zeros(6)
        self.set_point_error = 0.0
        self._wrench = np.zeros(6)
        self._numbers = np.zeros(9)
        self._origin = np.zeros(12)
        self._push = -1
        self._tick = 0
        self._place(start, side)

    @property
    def loads(self) -> Array:
        """(4,) pressing force of each fingertip [N]."""
        return self.contact.tips[:, LOAD]

    @property
    def slip(self) -> float:
        """Largest slip speed of a fingertip that presses [m/s]."""
        return float(np.where(self.loads > 0, self.contact.tips[:, SLIP], 0.0).max())

    def advance(self, command: Command, plan: Plan, anchor: Array) -> None:
        """One sample on: seven steps of the physics under that command."""
        data = self.hand.data
        target = self.path.targets(command.depths)
        self.set_point_error = 0.0
        if command.push != self._push:
            self._push = command.push
            self._origin[:] = self.bodies[-1, :12]
        push = plan.pushes[command.push] if command.push >= 0 else None
        if push is not None:
            self._numbers[:] = push.numbers
        for k in range(SUBSTEPS):
            mujoco.mj_step1(self.hand.model, data)
            self.hand.bodies(self.bodies)
            touch(self.contact, self.constants, self.bodies, TIMESTEP)
            _operate(
                self.bodies[-1], anchor, command.hold, GRAVITY * self.thing.mass, self.tremors,
                plan.profile.tremor, data.time, self._numbers, self._origin,
                -1 if push is None else push.style, 1.0 if push is None else push.duration,
                command.elapsed + k * TIMESTEP, self.contact.wrench, self.outside, self._wrench,
            )  # fmt: skip
            self.hand.apply(self.contact.tips, self._wrench, self.bodies)
            if self._tick % EVERY == 0:
                self._note_glitch(self._tick // EVERY)
                control(
                    self.controller, self._tick // EVERY, data.qpos, data.qfrc_bias, target,
                    EVERY * TIMESTEP, data.qfrc_applied,
                )  # fmt: skip
            self._tick += 1
            mujoco.mj_step2(self.hand.model, data)
        if self.bodies[-1, 2] < GONE:
            self._freeze()

    def _note_glitch(self, tick: int) -> None:
        errors = self.controller.errors
        error = float(np.abs(errors[min(tick, len(errors) - 1)]).max())
        self.set_point_error = max(self.set_point_error, error)

    def _place(self, start: Array, side: str) -> None:
        place, turn = object_pose(self.thing, side)
        model, data = self.hand.model, self.hand.data
        mujoco.mj_resetData(model, data)
        data.qpos[:N_JOINTS] = self.path.targets(np.full(len(FINGERS), OPEN))
        data.qpos[N_JOINTS : N_JOINTS + 3] = place + start[:3]
        half = 0.5 * (turn + start[3])
        data.qpos[N_JOINTS + 3 :] = (np.cos(half), 0.0, 0.0, np.sin(half))
        mujoco.mj_forward(model, data)
        self.hand.bodies(self.bodies)

    def _freeze(self) -> None:
        self.hand.data.qvel[N_JOINTS:] = 0.0
        self.hand.data.qpos[N_JOINTS + 2] = GONE - 0.1


@compiled
def _operate(
    body: Array,
    anchor: Array,
    hold: float,
    weight: float,
    tremors: Array,
    rms: float,
    time: float,
    numbers: Array,
    origin: Array,
    style: int,
    duration: float,
    elapsed: float,
    fingers: Array,
    outside: Array,
    wrench: Array,
) -> None:
    """The operator's force and torque on the object, alone and with the fingers'."""
    outside[:] = 0.0
    if hold > 0.0:
        held = hold_wrench(body, anchor, hold, weight, tremors[0], rms, time)
        for k in range(6):
            outside[k] += held[k]
    if style == MOVE:
        moved = move_wrench(body, origin, numbers, duration, tremors[1], rms, elapsed)
        for k in range(6):
            outside[k] += moved[k]
    elif style >= 0:
        pushed = push_wrench(body, origin, numbers, style, duration, tremors[1], rms, elapsed)
        for k in range(6):
            outside[k] += pushed[k]
    for k in range(6):
        wrench[k] = outside[k] + fingers[k]
