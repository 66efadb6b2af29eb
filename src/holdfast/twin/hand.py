"""Model of the Allegro hand v4 and the object for MuJoCo: boxes and capsules without contacts.

MuJoCo integrates the motion of the bodies. c/contact.c computes the forces between skin and object,
which hand.c applies as external forces.
"""

import csv
from dataclasses import dataclass, field
from functools import cached_property
from importlib import resources
from typing import NamedTuple

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.mujoco_import import mujoco
from holdfast.twin.objects import GraspObject
from holdfast.twin.surface import AXIS

RATE = 150.0
"""Samples per second [Hz]."""
SUBSTEPS = 7
"""Physics steps per sample."""
TIMESTEP = 1 / (RATE * SUBSTEPS)

GRAVITY = 9.81
"""Gravitational acceleration [m/s^2]."""
FINGERS = ("thumb", "index", "middle", "ring")
"""Order of the fingertips in all arrays of the twin."""
N_JOINTS = 16
"""Number of joints. The driver's order: index (0 to 3), middle, ring, thumb (12 to 15)."""
JOINTS = {"thumb": 12, "index": 0, "middle": 4, "ring": 8}
"""First joint of each finger."""
MOUNTS = np.array([[-0.013, 0.0, 0.0315], *[[-0.013, 0.0, 0.016]] * 3])
"""Origin of each fingertip frame in its last link, (4, 3) [m], as XELA mounts the tips."""

ARMATURE, DAMPING, FRICTION = 6e-4, 0.012, 0.012
"""Gear inertia [kg m^2], viscous damping [N m s/rad] and dry friction [N m] of a joint. Own
choices: small gear motors that can be turned back by hand."""
PALM_MASS, PALM_SIDES, PALM_MIDDLE = 0.4154, (0.0408, 0.113, 0.095), (-0.0093, 0.0, -0.0475)
"""Mass [kg], sides and middle [m] of the palm. The vendor's table has the centre of mass outside
the box of the palm; here it is in its middle. All inertias are computed from the boxes, because the
vendor's are not physical."""
TIP_MASS = 0.0266
"""Mass of the skin [kg], from XELA; it replaces a rubber tip of 16.8 g."""
TIP_RADIUS, TIP_BEGIN, TIP_END = 0.0136, 0.006, 0.022
"""Radius and ends, in the fingertip frame, of the capsule that has the mass of the skin [m]."""

Rows = list[dict[str, str]]


class HandArrays(NamedTuple):
    """Arrays of MuJoCo's state, which change in place, and what hand.c needs with them.

    Attributes:
        xpos, xmat, xipos, ximat, cvel, subtree_com: poses and motion of all bodies.
        qpos, qfrc_bias, qfrc_applied: joints, torques that balance gravity and motion, and
            torques of the motors.
        xfrc_applied: forces and torques on all bodies.
        roots: (n_bodies,) root of the tree of each body.
        tips: (4,) bodies of the last links.
        mounts: (4, 3) origin of each fingertip frame in its last link [m].
        object_body: body of the object.
    """

    xpos: Array
    xmat: Array
    xipos: Array
    ximat: Array
    cvel: Array
    subtree_com: Array
    qpos: Array
    qfrc_bias: Array
    qfrc_applied: Array
    xfrc_applied: Array
    roots: np.ndarray
    tips: np.ndarray
    mounts: Array
    object_body: int


def hand_xml(item: GraspObject | None = None) -> str:
    """Return the MJCF of the right hand, on its side with the palm fixed, and of the object.

    Palm and world share the x axis. The index finger is on top. The fingers point along the
    world's -y. They curl about a vertical axis, and gravity acts along all pads.

    Args:
        item: object that floats before the hand; None for none.
    """
    path = resources.files("holdfast.twin").joinpath("tables", "allegro_right.csv")
    lines = path.read_text("utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    body = "" if item is None else object_xml(item)
    return f"""<mujoco model="allegro right">
  <compiler angle="radian" eulerseq="XYZ"/>
  <option timestep="{TIMESTEP!r}" integrator="implicitfast" gravity="0 0 {-GRAVITY}">
    <flag contact="disable"/>
  </option>
  <default>
    <geom contype="0" conaffinity="0"/>
    <joint armature="{ARMATURE}" damping="{DAMPING}" frictionloss="{FRICTION}"
      limited="true"/>
  </default>
  <worldbody>
    <body name="palm" euler="{np.pi / 2!r} 0 0">
      {_box_xml(PALM_SIDES, PALM_MIDDLE, PALM_MASS)}
      {"".join(_link_xml(row, rows) for row in rows if row["parent"] == "palm_link")}
    </body>
    {body}
  </worldbody>
</mujoco>"""


@dataclass(frozen=True)
class HandModel:
    """MuJoCo model of hand and object, with the indices of their bodies.

    Attributes:
        model: MuJoCo's model.
        data: MuJoCo's state, which changes with time.
        tips: (4,) bodies of the last links, in the order of `FINGERS`.
        object_body: body of the object.
        mounts: (4, 3) origin of each fingertip frame in its last link [m].
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    tips: np.ndarray
    object_body: int
    mounts: Array = field(default_factory=lambda: MOUNTS)

    @classmethod
    def build(cls, item: GraspObject, joint_friction: float = FRICTION) -> "HandModel":
        """Build the model of the hand before an object, with this dry friction [N m]."""
        model = mujoco.MjModel.from_xml_string(hand_xml(item))
        model.dof_frictionloss[:N_JOINTS] = joint_friction
        last = [model.body(f"link_{JOINTS[f] + 3}.0").id for f in FINGERS]
        return cls(model, mujoco.MjData(model), np.array(last, np.intc), model.body("object").id)

    def limits(self) -> Array:
        """Return the limits of the joints, (16, 2) [rad]."""
        return np.array(self.model.jnt_range[:N_JOINTS])

    @cached_property
    def arrays(self) -> HandArrays:
        """Arrays of the state, which change with it."""
        data = self.data
        return HandArrays(
            data.xpos, data.xmat, data.xipos, data.ximat, data.cvel, data.subtree_com,
            data.qpos, data.qfrc_bias, data.qfrc_applied, data.xfrc_applied,
            self.model.body_rootid, self.tips, self.mounts, self.object_body,
        )  # fmt: skip


def _link_xml(row: dict[str, str], rows: Rows) -> str:
    children = "".join(_link_xml(other, rows) for other in rows if other["parent"] == row["link"])
    number = int(row["joint"].removeprefix("joint_").removesuffix(".0"))
    sides = tuple(float(row[f"side_{a}"]) for a in "xyz")
    middle = tuple(float(row[f"middle_{a}"]) for a in "xyz")
    tip = ""
    if not children:  # the skin: its mass, and a capsule of about its shape
        x, _, z = MOUNTS[0 if number >= JOINTS["thumb"] else 1]
        x += AXIS
        tip = (
            f'<geom type="capsule" fromto="{x:.6g} 0 {z + TIP_BEGIN:.6g} {x:.6g} 0 '
            f'{z + TIP_END:.6g}" size="{TIP_RADIUS}" mass="{TIP_MASS}"/>'
        )
    return f"""<body name="{row["link"]}" pos="{row["x"]} {row["y"]} {row["z"]}"
      euler="{row["roll"]} {row["pitch"]} {row["yaw"]}">
      <joint name="joint_{number}" axis="{row["axis_x"]} {row["axis_y"]} {row["axis_z"]}"
        range="{row["lower"]} {row["upper"]}"/>
      {_box_xml(sides, middle, float(row["mass"]))}{tip}{children}</body>"""


def _box_xml(sides: tuple[float, ...], middle: tuple[float, ...], mass: float) -> str:
    half = " ".join(f"{side / 2:.6g}" for side in sides)
    position = " ".join(f"{value:.6g}" for value in middle)
    return f'<geom type="box" size="{half}" pos="{position}" mass="{mass}"/>'


def object_xml(item: GraspObject) -> str:
    """Return the MJCF of a free object."""
    inertia = " ".join(f"{value:.9g}" for value in item.inertia)
    return f"""<body name="object"><freejoint/>
      <inertial pos="0 0 0" mass="{item.mass}" diaginertia="{inertia}"/></body>"""
