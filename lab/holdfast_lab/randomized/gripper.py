"""A hand of two to four soft pads on compliant drives, and the object between them.

Two opposite pads are a parallel gripper; with more, one pad (the thumb) faces the others. Every
pad closes along a straight line on a drive of finite stiffness, and yields sideways. MuJoCo
moves the bodies; skin and object meet in contact.c.
"""

from dataclasses import dataclass

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.hand import HandModel, object_xml
from holdfast.twin.mujoco_import import mujoco
from holdfast.twin.objects import GraspObject, reach_of
from holdfast.twin.protocol import OPEN_GAP
from holdfast.twin.skin import Skin
from holdfast.twin.steps import apply_forces, fill_bodies, on_object, touch
from holdfast.twin.surface import Surface
from holdfast.twin.world import ContactWorld
from holdfast_lab.randomized.palm import PalmMotion

STEP_RATE = 1500.0
"""Least rate of the physics [Hz]: stiff skins on light objects need more than soft fingertips."""
MAX_TURN_CHANGE = 0.3
"""Largest change of the object's angular velocity by the operator in a step [rad/s]."""
N_PAD_JOINTS = 3
"""Joints of a pad: along its closing line, and two across it."""


@dataclass(frozen=True)
class Drives:
    """Drives of the pads.

    Attributes:
        stiffness: of the closing drive [N/m].
        side_stiffness: of a pad across its closing line [N/m].
        damping_ratio: of both.
        mass: of a pad [kg].
        noise: of a drive's force, rms [N].
        glitch_rate: jumps of a set-point per second [1/s].
        glitch_size: standard deviation of a jump [m].
    """

    stiffness: float
    side_stiffness: float
    damping_ratio: float
    mass: float
    noise: float
    glitch_rate: float
    glitch_size: float

    @property
    def damping(self) -> float:
        """Of the closing drive [N s/m]."""
        return float(2 * self.damping_ratio * np.sqrt(self.stiffness * self.mass))


@dataclass(frozen=True)
class PadLayout:
    """Where the pads are around an object.

    Attributes:
        surface: the skin of a pad, in the fingertip frame.
        contact_point: (3,) the point of the skin that meets the object, in that frame [m].
        frames: (n, 3, 3) from the fingertip frames to the palm's, with the pads' normals towards
            the object.
        points: (n, 3) where each pad meets the object, in the palm frame [m].
        outward: (n, 3) from the object to each pad.
    """

    surface: Surface
    contact_point: Array
    frames: Array
    points: Array
    outward: Array

    @property
    def n_pads(self) -> int:
        """Number of pads."""
        return len(self.points)


def flat_patch(positions: Array, pitch: float) -> Surface:
    """Make the skin of a flat patch of taxels: a grid of nodes that goes half a pitch beyond.

    Args:
        positions: (n_taxels, 3) of the taxels, normal along z [m].
        pitch: between neighbouring taxels [m].
    """
    low, high = positions.min(axis=0)[:2] - pitch / 2, positions.max(axis=0)[:2] + pitch / 2
    counts = np.clip(np.rint((high - low) / 0.0028).astype(int), 5, 13)
    axes = [
        low[k] + (np.arange(counts[k]) + 0.5) * (high[k] - low[k]) / counts[k] for k in range(2)
    ]
    x, y = (grid.ravel() for grid in np.meshgrid(*axes, indexing="ij"))
    nodes = np.column_stack([x, y, np.zeros(len(x))])
    area = float(np.prod((high - low) / counts))
    normals = np.tile([0.0, 0.0, 1.0], (len(nodes), 1))
    return Surface(nodes, normals, np.full(len(nodes), area))


def pad_layout(
    surface: Surface,
    normal: Array,
    contact_point: Array,
    n_pads: int,
    item: GraspObject,
    height: float,
) -> PadLayout:
    """Place pads around an object whose middle axis is z: a thumb at +x, the others at -x.

    Args:
        surface: the skin of a pad.
        normal: (3,) of the skin, in the fingertip frame.
        contact_point: (3,) the point of the skin that meets the object, in that frame [m].
        n_pads: two to four.
        item: the object.
        height: of the grip over the centre of mass [m].

    Raises:
        ValueError: a pad does not reach the object there.
    """
    spread = {2: [0.0], 3: [0.013, -0.013], 4: [0.024, 0.0, -0.024]}[n_pads]
    sides = np.array([1.0, *[-1.0] * len(spread)])
    heights = height + np.array([0.0, *spread])
    outward = sides[:, None] * [1.0, 0.0, 0.0]
    reach = np.array([reach_of(item, *pair) for pair in zip(outward, heights, strict=True)])
    for height_of_pad in heights[np.isnan(reach)]:
        raise ValueError(
            f"the pad at {1e3 * height_of_pad:.0f} mm does not reach the object {item.name!r}"
        )
    points = outward * reach[:, None] + heights[:, None] * [0.0, 0.0, 1.0]
    frames = np.array([_frame(normal, -out) for out in outward])
    return PadLayout(surface, contact_point, frames, points, outward)


def _frame(normal: Array, inward: Array) -> Array:
    """Rotation that turns the skin's normal inward, and the finger's long axis up or level."""
    across = np.array([0.0, 1.0, 0.0])
    if normal[2] > 0.5:  # a flat patch: normal along z
        return np.column_stack([across, np.cross(inward, across), inward])
    return np.column_stack([inward, np.cross(across, inward), across])  # curved: normal along x


def gripper_model(
    layout: PadLayout, item: GraspObject, drives: Drives, timestep: float
) -> HandModel:
    """Build the pads and the object for MuJoCo, in the palm frame."""
    # Without gravity and without MuJoCo's own contacts: `advance` sets the apparent gravity of the
    # palm, and skin and object meet in contact.c.
    bodies = "".join(_pad_xml(layout, i, drives) for i in range(layout.n_pads))
    model = mujoco.MjModel.from_xml_string(f"""<mujoco model="gripper">
  <compiler angle="radian"/>
  <option timestep="{timestep!r}" integrator="implicitfast" gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>{bodies}{object_xml(item)}</worldbody>
</mujoco>""")
    tips = np.array([model.body(f"pad{i}").id for i in range(layout.n_pads)], np.intc)
    mounts = np.zeros((layout.n_pads, 3))
    return HandModel(model, mujoco.MjData(model), tips, model.body("object").id, mounts)


def _pad_xml(layout: PadLayout, i: int, drives: Drives) -> str:
    frame = layout.frames[i]
    position = layout.points[i] + OPEN_GAP * layout.outward[i] - frame @ layout.contact_point
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(frame).ravel())
    # A pad slides along its closing line and, on side springs, along two axes across it.
    axes = [frame.T @ -layout.outward[i]]
    axes.append(np.roll(axes[0], 1) if abs(axes[0]).max() > 0.99 else np.eye(3)[0])
    axes.append(np.cross(axes[0], axes[1]))
    damping = 2 * drives.damping_ratio * np.sqrt(drives.side_stiffness * drives.mass)
    sides = "".join(
        f'<joint type="slide" axis="{_text(axis)}" stiffness="{drives.side_stiffness:.9g}" '
        f'damping="{damping:.9g}"/>'
        for axis in axes[1:]
    )
    return (
        f'<body name="pad{i}" pos="{_text(position)}" quat="{_text(quaternion)}">'
        f'<joint type="slide" axis="{_text(axes[0])}"/>{sides}'
        f'<geom type="box" size=".012 .012 .004" mass="{drives.mass:.9g}"/></body>'
    )


def _text(values: Array) -> str:
    return " ".join(f"{value:.12g}" for value in values)


class GripperWorld(ContactWorld):
    """One object between the pads, stepped sample by sample.

    Args:
        layout: of the pads.
        item: the object.
        drives: of the pads.
        skin: of the pads.
        generator: of noise and glitches.
        rate: samples per second [Hz].

    Attributes:
        layout: of the pads.
        drives: of the pads.
        time: since the start [s].
    """

    def __init__(
        self,
        layout: PadLayout,
        item: GraspObject,
        drives: Drives,
        skin: Skin,
        generator: np.random.Generator,
        rate: float,
    ) -> None:
        self.layout, self.drives = layout, drives
        # As many steps as the stiffest contact on the lightest body needs: all pads press on the
        # object with their skin, or with 2 cm^2 of it where it is larger.
        area = min(float(layout.surface.areas.sum()), 2e-4)
        stiffness = layout.n_pads * skin.stiffness * area
        fastest = np.sqrt(stiffness / min(item.mass, drives.mass))  # [rad/s]
        self.n_substeps = max(1, int(np.ceil(max(STEP_RATE, 1.2 * fastest) / rate)))
        self.timestep = 1 / (rate * self.n_substeps)
        super().__init__(
            gripper_model(layout, item, drives, self.timestep), item, layout.surface, skin
        )
        self._generator = generator
        self._wrench = np.zeros(6)
        self._jump = np.zeros(layout.n_pads)
        self._jump_until = -1.0
        self.time = 0.0
        mujoco.mj_forward(self.hand.model, self.hand.data)
        fill_bodies(self.hand.arrays, self.bodies)

    @property
    def unstable(self) -> bool:
        """Whether the physics diverged."""
        kinds = mujoco.mjtWarning
        diverged = (kinds.mjWARN_BADQACC, kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL)
        return any(self.hand.data.warning[kind].number > 0 for kind in diverged)

    def advance(
        self, travels: Array, operator: "OperatorForce", palm: PalmMotion, row: float
    ) -> None:
        """Step the physics by one sample.

        Args:
            travels: (n_pads,) set-points of the closing drives [m].
            operator: fills the force of the operator on the object.
            palm: motion of the palm.
            row: time since the lock [s]; negative before.
        """
        model, data = self.hand.model, self.hand.data
        # A glitch: the set-point of one pad jumps and comes back within 20 ms.
        if self.time >= self._jump_until:
            self._jump[:] = 0.0
        period = self.n_substeps * self.timestep
        if self._generator.random() < self.drives.glitch_rate * period:
            pad = int(self._generator.integers(self.layout.n_pads))
            self._jump[pad] = self._generator.normal(0.0, self.drives.glitch_size)
            self._jump_until = self.time + self._generator.uniform(0.006, 0.020)
        noise = self.drives.noise * self._generator.standard_normal(self.layout.n_pads)
        self.set_point_error = float(np.abs(self._jump).max())
        drives, damping = slice(0, N_PAD_JOINTS * len(noise), N_PAD_JOINTS), self.drives.damping
        for k in range(self.n_substeps):
            at = palm.at(row + k * self.timestep)
            model.opt.gravity[:] = palm.gravity[at]
            mujoco.mj_step1(model, data)
            fill_bodies(self.hand.arrays, self.bodies)
            touch(self.contact, self.constants, self.bodies, self.timestep)
            operator.fill(self.bodies[-1], self.outside, k * self.timestep)
            # The damping of a person's hand is stiff beside the inertia of a small object: its
            # torque stays below what would turn the object too fast for a step.
            spin = float(np.linalg.norm(self.bodies[-1, 15:18]))
            largest = (
                float(self.item.inertia.min()) * (MAX_TURN_CHANGE + 0.5 * spin) / self.timestep
            )
            torque = float(np.linalg.norm(self.outside[3:]))
            if torque > largest:
                self.outside[3:] *= largest / torque
            self._wrench[:] = on_object(
                self.contact.wrench, self.outside, self.bodies[-1], self.item.inertia,
                self.item.mass, palm.spin[at], palm.turn[at],
            )  # fmt: skip
            apply_forces(self.hand.arrays, self.contact.tips, self._wrench, self.bodies)
            data.qfrc_applied[drives] = (
                self.drives.stiffness * (travels + self._jump - data.qpos[drives])
                - damping * data.qvel[drives]
                + noise
            )
            mujoco.mj_step2(model, data)
        self.time += self.n_substeps * self.timestep


class OperatorForce:
    """Force and torque of the operator on the object; none, in this base."""

    def fill(self, body: Array, out: Array, ahead: float) -> None:
        """Fill (6,) force and torque about the centre of mass, in the palm frame.

        Args:
            body: (18,) the object.
            out: (6,) is filled.
            ahead: time since the sample began [s].
        """
        out[:] = 0.0
