"""Physics of a grasp, step by step: hand, object, contact, controller, operator; and its truth."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from holdfast.contact import Phase
from holdfast.recordings import Truth
from holdfast.sensors.types import Array
from holdfast.twin.contact import Contact, constants_of, new_contact
from holdfast.twin.control import STEPS_PER_CONTROL, Controller
from holdfast.twin.grasp import ClosingPath, object_pose
from holdfast.twin.hand import (
    FINGERS,
    GRAVITY,
    N_JOINTS,
    SUBSTEPS,
    TIMESTEP,
    HandModel,
)
from holdfast.twin.loads import LoadState
from holdfast.twin.mujoco_import import mujoco
from holdfast.twin.objects import GraspObject
from holdfast.twin.operator import NO_GUIDE
from holdfast.twin.physics import Action, Physics
from holdfast.twin.protocol import OPEN_GAP, Command, Plan
from holdfast.twin.skin import COUPLED, COUPLED_PITCH, Skin
from holdfast.twin.steps import (
    MU_KINETIC,
    MU_STATIC,
    TIP_SLIP,
    TIP_SLIPPING_SHARE,
    advance_sample,
    fill_bodies,
)
from holdfast.twin.surface import NODE_PITCH, Surface, curved_fingertip

MIN_HEIGHT = -0.3
"""Height below which a lost object is out of the picture and is kept in place [m]."""


def fingertip_of(coupled: bool) -> Surface:
    """Return the surface of a fingertip whose nodes are coupled, or not."""
    return curved_fingertip(COUPLED_PITCH if coupled else NODE_PITCH)


class ContactWorld:
    """Physical state of fingertips and the object between them.

    Args:
        hand: model of the fingertips and the object.
        item: the object.
        surface: surface of every fingertip.
        skin: material of the skin; by default `Skin()`.

    Attributes:
        hand: model of the fingertips and the object.
        item: the object.
        contact: state of the contact.
        constants: skin and object.
        bodies: (n_fingers + 1, 18) position, rotation, velocity and spin of the fingertip frames
            and of the object.
        outside: (6,) force [N] and torque [N m] of operator and loads on the object.
        set_point_error: largest error of a set-point, in a glitch, during the last sample.
    """

    def __init__(
        self, hand: HandModel, item: GraspObject, surface: Surface, skin: Skin | None = None
    ) -> None:
        self.hand, self.item = hand, item
        self.contact = new_contact(surface, len(hand.tips))
        self.constants = constants_of(surface, item, skin)
        self.bodies = np.zeros((len(hand.tips) + 1, 18))
        self.outside = np.zeros(6)
        self.set_point_error = 0.0
        self._frictions = self.constants.solid[MU_STATIC : MU_KINETIC + 1].copy()

    @property
    def loads(self) -> Array:
        """Load of each fingertip, (n_fingers,) [N]."""
        return self.contact.load

    @property
    def slip(self) -> float:
        """Largest slip speed of a fingertip in contact [m/s]."""
        tips = zip(self.loads.tolist(), self.contact.slip_speed.tolist(), strict=True)
        return max(speed if load > 0 else 0.0 for load, speed in tips)

    @property
    def object_pose(self) -> Array:
        """Position [m] and quaternion w, x, y, z of the object, (7,)."""
        return np.concatenate([self.bodies[-1, :3], self.hand.data.qpos[-4:]])

    def scale_friction(self, factor: float, steady: float = 0.0) -> None:
        """Set the friction of the object as a multiple of its own, until it is set again.

        Args:
            factor: factor of both coefficients.
            steady: how far the kinetic coefficient is raised to the static one, from 0 to 1.
        """
        raised = steady * (self._frictions[0] - self._frictions)
        self.constants.solid[MU_STATIC : MU_KINETIC + 1] = factor * (self._frictions + raised)


class World(ContactWorld):
    """Physical state of one grasp of one object.

    Args:
        hand: model of the hand and the object.
        item: the object.
        path: path on which the fingers close.
        controller: controller of the hand.
        tremors: (2, 3, n, 3) tremor of the hand that holds, and of the hand or finger that
            disturbs.
        start: (4,) offset of the object's position [m] and turn [rad] at the start.
        coupled: whether the nodes of the skin are coupled.
    """

    def __init__(
        self,
        hand: HandModel,
        item: GraspObject,
        path: ClosingPath,
        controller: Controller,
        tremors: Array,
        start: Array,
        coupled: bool = False,
    ) -> None:
        super().__init__(hand, item, fingertip_of(coupled), COUPLED if coupled else Skin())
        self.path, self.controller, self.tremors = path, controller, tremors
        self._physics = Physics(
            hand.arrays, self.contact, self.constants, controller, self.bodies, self.outside,
            np.zeros(6), SUBSTEPS, TIMESTEP, STEPS_PER_CONTROL,
        )  # fmt: skip
        self._half_steps = (
            partial(mujoco.mj_step1, hand.model, hand.data),
            partial(mujoco.mj_step2, hand.model, hand.data),
        )
        # What `set_load` sets; of the current disturbance its parameters, and the pose of the
        # object when it began, which C reads in place.
        self._pull, self._guide = np.zeros(6), NO_GUIDE
        self._parameters = np.zeros(9)
        self._origin = np.zeros(12)
        # Mass and inertia of the object alone, from which those with an added mass are computed.
        body = hand.object_body
        self._inertia = np.array([hand.model.body_mass[body], *hand.model.body_inertia[body]])
        first = hand.model.body_dofadr[body]
        self._freedom = slice(first, first + 6)
        self._constant_inertia = hand.model.dof_M0[self._freedom].copy()
        self._added_mass = 0.0
        self._disturbance = -1
        self._tick = 0
        # The hand is open, and the object where a person puts it.
        position, turn = object_pose(self.item)
        model, data = hand.model, hand.data
        mujoco.mj_resetData(model, data)
        data.qpos[:N_JOINTS] = path.targets(np.full(len(FINGERS), OPEN_GAP))
        data.qpos[N_JOINTS : N_JOINTS + 3] = position + start[:3]
        half = 0.5 * (turn + start[3])
        data.qpos[N_JOINTS + 3 :] = (np.cos(half), 0.0, 0.0, np.sin(half))
        mujoco.mj_forward(model, data)
        fill_bodies(hand.arrays, self.bodies)

    def set_load(self, load: LoadState) -> None:
        """Set all loads and the hand's acceleration until they are set again.

        The hand does not move in the world: its acceleration is a change of gravity.
        """
        self._pull[:3], self._pull[3:] = load.force, load.torque
        self._guide = load.guide
        self.hand.model.opt.gravity[:] = [0.0, 0.0, -GRAVITY] - load.acceleration
        self.scale_friction(load.friction, load.steady)
        if load.added_mass == self._added_mass:
            return
        # Mass and inertia grow alike, as if the added mass were spread over the object.
        self._added_mass = load.added_mass
        model, body = self.hand.model, self.hand.object_body
        factor = (self.item.mass + load.added_mass) / self.item.mass
        model.body_mass[body] = model.body_subtreemass[body] = factor * self._inertia[0]
        model.body_inertia[body] = factor * self._inertia[1:]
        model.dof_M0[self._freedom] = factor * self._constant_inertia  # of a body that is alone

    def advance(
        self, command: Command, plan: Plan, anchor: Array, displacement: Array | None = None
    ) -> None:
        """Advance by one sample, seven physics steps.

        Args:
            command: set-points of the fingers and action of the operator.
            plan: plan of the grasp.
            anchor: (12,) position and rotation at which the operator holds the object.
            displacement: (16,) of the set-points of the joints [rad]; None for none.
        """
        target = self.path.targets(command.depths)
        if displacement is not None:
            target = target + displacement
        if command.disturbance != self._disturbance:  # it is carried out from where the object is
            self._disturbance = command.disturbance
            self._origin[:] = self.bodies[-1, :12]
        style, duration = -1, 1.0
        if command.disturbance >= 0:
            disturbance = plan.disturbances[command.disturbance]
            style, duration = disturbance.style, disturbance.duration
            self._parameters[:] = disturbance.parameters
        action = Action(
            anchor, command.hold, GRAVITY * self.item.mass, self.tremors, plan.profile.tremor,
            self.hand.data.time, self._parameters, self._origin, style, duration,
            command.elapsed, self._pull, self._guide,
        )  # fmt: skip
        self.set_point_error = advance_sample(
            *self._half_steps, self._physics, self._tick, target, action
        )
        self._tick += SUBSTEPS
        if self.bodies[-1, 2] < MIN_HEIGHT:  # a fall without end would make the numbers useless
            self.hand.data.qvel[N_JOINTS:] = 0.0
            self.hand.data.qpos[N_JOINTS + 2] = MIN_HEIGHT - 0.1


class TruthLog:
    """Collector of the truth of all samples.

    Args:
        fingers: names of the fingertips.
    """

    def __init__(self, fingers: Sequence[str]) -> None:
        self._fingers = fingers
        self._phase: list[Phase] = []
        self._rows: dict[str, list[Array]] = {}
        self._tips: list[Array] = []

    def __len__(self) -> int:
        return len(self._phase)

    def add(self, phase: Phase, contact: Contact, **rows: Array | float | str) -> None:
        """Add the state after a sample: phase, contact and other rows of the truth by name."""
        self._phase.append(phase)
        self._tips.append(contact.tips.copy())
        for name, row in rows.items():
            self._rows.setdefault(name, []).append(np.array(row))

    def truth(self, times: Array) -> Truth:
        """Return the truth of all samples, whose times are (n,) [s]."""
        tips = np.array(self._tips)
        fingers = {
            finger: {
                "contact_force": -tips[:, index, :3],
                "slip_speed": tips[:, index, TIP_SLIP],
                "slipping_share": tips[:, index, TIP_SLIPPING_SHARE],
            }
            for index, finger in enumerate(self._fingers)
        }
        hand = {name: np.array(rows) for name, rows in self._rows.items()}
        return Truth(times, {"phase": np.array(self._phase, dtype=str), **hand}, fingers)
