"""The Allegro hand v4 and the object it holds, for MuJoCo: boxes and capsules, no contacts.

MuJoCo does the dynamics of the bodies. What happens between skin and object is
`holdfast.twin.contact`, whose forces are applied from outside.
"""

import csv
from dataclasses import dataclass
from importlib import resources

import mujoco
import numpy as np

from holdfast.compiled import compiled
from holdfast.sensors.values import Array
from holdfast.twin.contact import N_BODY
from holdfast.twin.objects import Thing

RATE = 150.0
"""Samples per second [Hz]."""
SUBSTEPS = 7
"""Steps of the physics a sample."""
TIMESTEP = 1 / (RATE * SUBSTEPS)

FINGERS = ("thumb", "index", "middle", "ring")
"""The order of fingertips in all arrays of the twin."""
N_JOINTS = 16
"""Joints 0 to 3 index, 4 to 7 middle, 8 to 11 ring, 12 to 15 thumb, as the driver orders them."""
JOINTS = {"thumb": 12, "index": 0, "middle": 4, "ring": 8}
"""First joint of each finger."""
MOUNTS = np.array([[-0.013, 0.0, 0.0315], *[[-0.013, 0.0, 0.016]] * 3])
"""(4, 3) origin of each fingertip frame in its last link [m], as XELA mounts the tips."""

ARMATURE, DAMPING, FRICTION = 6e-4, 0.012, 0.012
"""Of a joint: inertia of the gear [kg m^2], viscous [N m s/rad] and dry friction [N m]. Own
choices: small gear motors that can be pushed back by hand."""
PALM_MASS, PALM_SIDES, PALM_MIDDLE = 0.4154, (0.0408, 0.113, 0.095), (-0.0093, 0.0, -0.0475)
TIP_MASS, TIP_REACH = 0.0168, {"thumb": 0.0423}
"""Of the rubber tip that the skin replaces [kg], and how far it sits out on its link [m]."""
TIP_REACH_FINGER = 0.0267

Rows = list[dict[str, str]]


def hand_xml(side: str = "right", thing: Thing | None = None) -> str:
    """The hand on its side, palm fixed, as an MJCF; with an object where one is given.

    The palm's x looks along the world's x, its y up, its z along the world's -y: fingers curl
    about a vertical axis, and gravity pulls along all pads.

    Args:
        side: "right", or "left", which is its mirror image.
        thing: that floats before the hand.

    Raises:
        ValueError: another side.
    """
    if side not in ("right", "left"):
        raise ValueError(f"side 'right' or 'left' expected, {side!r} given")
    rows = [_mirrored(row) if side == "left" else row for row in _table()]
    body = "" if thing is None else _object_xml(thing)
    return f"""<mujoco model="allegro {side}">
  <compiler angle="radian" eulerseq="XYZ"/>
  <option timestep="{TIMESTEP!r}" integrator="implicitfast" gravity="0 0 -9.81"/>
  <visual><global offwidth="1280" offheight="960"/><headlight ambient=".45 .45 .45"/></visual>
  <default>
    <geom contype="0" conaffinity="0" rgba=".32 .34 .38 1"/>
    <joint armature="{ARMATURE}" damping="{DAMPING}" frictionloss="{FRICTION}" limited="true"/>
  </default>
  <asset><texture name="sky" type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8"
    height="8"/></asset>
  <worldbody>
    <light pos=".4 -.6 1" dir="-.3 .5 -1" diffuse=".6 .6 .6"/>
    <body name="palm" euler="{np.pi / 2!r} 0 0">
      {_box_xml(PALM_SIDES, PALM_MIDDLE, PALM_MASS)}
      {"".join(_link_xml(row, rows) for row in rows if row["parent"] == "palm_link")}
    </body>
    {body}
  </worldbody>
</mujoco>"""


@dataclass(frozen=True)
class HandModel:
    """A compiled hand and object, and where their parts are in MuJoCo's arrays.

    Attributes:
        model: of MuJoCo.
        data: of MuJoCo; changes as time goes on.
        tips: (4,) bodies of the last links, in the order of `FINGERS`.
        thing: body of the object.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    tips: np.ndarray
    thing: int

    @classmethod
    def build(cls, thing: Thing, side: str = "right") -> "HandModel":
        """The hand before that object."""
        model = mujoco.MjModel.from_xml_string(hand_xml(side, thing))
        last = [model.body(f"link_{JOINTS[f] + 3}.0").id for f in FINGERS]
        return cls(model, mujoco.MjData(model), np.array(last), model.body("object").id)

    def limits(self) -> Array:
        """(16, 2) of the joints [rad]."""
        return np.array(self.model.jnt_range[:N_JOINTS])

    def bodies(self, out: Array) -> None:
        """Fills (5, 18) with the fingertip frames and the object: pose and motion in the world."""
        data = self.data
        _bodies(
            data.xpos, data.xmat, data.xipos, data.ximat, data.cvel, data.subtree_com,
            self.tips, self.thing, self.model.body_rootid, MOUNTS, out,
        )  # fmt: skip

    def apply(self, tips: Array, thing: Array, bodies: Array) -> None:
        """Puts force and torque on fingertips (about their frames) and object into MuJoCo.

        Args:
            tips: (4, 6 or more) force [N] and torque [N m] on the fingertips, world.
            thing: (6,) force and torque about its centre of mass on the object, world.
            bodies: as `bodies` fills them.
        """
        _apply(tips, thing, bodies, self.data.xipos, self.tips, self.thing, self.data.xfrc_applied)


@compiled
def _bodies(
    xpos: Array,
    xmat: Array,
    xipos: Array,
    ximat: Array,
    cvel: Array,
    subtree_com: Array,
    tips: Array,
    thing: int,
    roots: Array,
    mounts: Array,
    out: Array,
) -> None:
    for i in range(len(tips)):
        b = tips[i]
        for r in range(3):
            place = xpos[b, r]
            for c in range(3):
                place += xmat[b, 3 * r + c] * mounts[i, c]
                out[i, 3 + 3 * r + c] = xmat[b, 3 * r + c]
            out[i, r] = place
        _move(cvel[b], subtree_com[roots[b]], out[i])
    last = len(tips)
    for r in range(3):
        out[last, r] = xipos[thing, r]
        for c in range(3):
            out[last, 3 + 3 * r + c] = ximat[thing, 3 * r + c]
    _move(cvel[thing], subtree_com[roots[thing]], out[last])


@compiled
def _move(cvel: Array, com: Array, row: Array) -> None:
    """Velocity of a point from MuJoCo's, which is that of the body at its tree's centre of mass."""
    wx, wy, wz = cvel[0], cvel[1], cvel[2]
    x, y, z = row[0] - com[0], row[1] - com[1], row[2] - com[2]
    row[12] = cvel[3] + wy * z - wz * y
    row[13] = cvel[4] + wz * x - wx * z
    row[14] = cvel[5] + wx * y - wy * x
    row[15], row[16], row[17] = wx, wy, wz


@compiled
def _apply(
    tips: Array, thing: Array, bodies: Array, xipos: Array, ids: Array, thing_id: int, out: Array
) -> None:
    for i in range(len(ids)):
        b = ids[i]
        x = bodies[i, 0] - xipos[b, 0]
        y = bodies[i, 1] - xipos[b, 1]
        z = bodies[i, 2] - xipos[b, 2]
        fx, fy, fz = tips[i, 0], tips[i, 1], tips[i, 2]
        out[b, 0], out[b, 1], out[b, 2] = fx, fy, fz
        out[b, 3] = tips[i, 3] + y * fz - z * fy
        out[b, 4] = tips[i, 4] + z * fx - x * fz
        out[b, 5] = tips[i, 5] + x * fy - y * fx
    for k in range(6):
        out[thing_id, k] = thing[k]


def _table() -> Rows:
    path = resources.files("holdfast.twin").joinpath("tables", "allegro_right.csv")
    lines = path.read_text("utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def _mirrored(row: dict[str, str]) -> dict[str, str]:
    """The same link of the other hand: y to -y. Turns about x and z change their sense."""
    swapped = dict(row)
    for name in ("y", "roll", "yaw", "middle_y"):
        swapped[name] = repr(-float(row[name]))
    for name in ("axis_x", "axis_z"):
        swapped[name] = repr(-float(row[name]))
    return swapped


def _link_xml(row: dict[str, str], rows: Rows) -> str:
    children = "".join(_link_xml(other, rows) for other in rows if other["parent"] == row["link"])
    number = int(row["joint"].removeprefix("joint_").removesuffix(".0"))
    sides = tuple(float(row[f"side_{a}"]) for a in "xyz")
    middle = tuple(float(row[f"middle_{a}"]) for a in "xyz")
    tip = "" if children else _tip_xml(number)
    return f"""<body name="{row["link"]}" pos="{row["x"]} {row["y"]} {row["z"]}"
      euler="{row["roll"]} {row["pitch"]} {row["yaw"]}">
      <joint name="joint_{number}" axis="{row["axis_x"]} {row["axis_y"]} {row["axis_z"]}"
        range="{row["lower"]} {row["upper"]}"/>
      {_box_xml(sides, middle, float(row["mass"]))}{tip}{children}</body>"""


def _tip_xml(number: int) -> str:
    """The skin: its mass, and a capsule of its shape for the looks."""
    reach = 0.0423 if number > N_JOINTS - 5 else TIP_REACH_FINGER
    return (
        f'<geom type="capsule" fromto="-.001 0 {reach - 0.019} -.001 0 {reach}" size="0.0138" '
        f'mass="{TIP_MASS}" rgba=".93 .55 .2 1"/>'
    )


def _box_xml(sides: tuple[float, ...], middle: tuple[float, ...], mass: float) -> str:
    half = " ".join(f"{side / 2:.6g}" for side in sides)
    place = " ".join(f"{value:.6g}" for value in middle)
    return f'<geom type="box" size="{half}" pos="{place}" mass="{mass}"/>'


def _object_xml(thing: Thing) -> str:
    inertia = " ".join(f"{value:.9g}" for value in thing.inertia)
    return f"""<body name="object"><freejoint/>
      <inertial pos="0 0 0" mass="{thing.mass}" diaginertia="{inertia}"/>
      {_looks_xml(thing)}</body>"""


def _looks_xml(thing: Thing) -> str:
    colour = 'rgba=".36 .62 .78 1"'
    half, size = thing.half_height, thing.size
    middle = float(thing.foot[2]) + half
    if thing.shape == "sphere":
        return f'<geom type="sphere" size="{size[0]}" {colour} mass="0"/>'
    if thing.shape == "box":
        return f'<geom type="box" size="{size[0]} {size[1]} {size[2]}" {colour} mass="0"/>'
    if thing.shape == "capsule":
        return f'<geom type="capsule" size="{size[0]} {half - size[0]}" {colour} mass="0"/>'
    if thing.shape == "hexagon":
        width = size[0] / np.sqrt(3)
        return "".join(
            f'<geom type="box" size="{size[0]} {width} {half}" euler="0 0 {turn!r}" {colour} '
            'mass="0"/>'
            for turn in (0.0, np.pi / 3, 2 * np.pi / 3)
        )
    n_slices = 24
    foot, top = (size[0], size[1]) if thing.shape == "frustum" else (size[0], size[0])
    thick = half / n_slices
    return "".join(
        f'<geom type="cylinder" size="{foot + (top - foot) * (k + 0.5) / n_slices} {thick}" '
        f'pos="0 0 {middle - half + (2 * k + 1) * thick}" {colour} mass="0"/>'
        for k in range(n_slices)
    )


__all__ = ["FINGERS", "N_BODY", "HandModel", "hand_xml"]
