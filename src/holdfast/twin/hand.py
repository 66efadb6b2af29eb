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
from holdfast.sensors.types import Array
from holdfast.twin.objects import Thing
from holdfast.twin.surface import AXIS

RATE = 150.0
"""Samples per second [Hz]."""
SUBSTEPS = 7
"""Steps of the physics a sample."""
TIMESTEP = 1 / (RATE * SUBSTEPS)

GRAVITY = 9.81
"""[m/s^2]"""
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
"""[kg] and [m]. The vendor's table puts the centre of mass outside of the palm's box: here it is
in its middle. All inertias are those of the boxes, for the vendor's are not physical."""
TIP_MASS = 0.0266
"""Of the skin [kg], by XELA; it takes the place of a rubber tip of 16.8 g."""
TIP_RADIUS, TIP_BEGIN, TIP_END = 0.0136, 0.006, 0.022
"""The capsule that shows the skin: radius, and its ends in the fingertip frame [m]."""
MIRRORED = np.array([-1.0, 1.0, 1.0, 1.0] * 3 + [1.0] * 4)
"""Turns joints of one hand into those of the other in the mirrored pose: the vendor's left hand
spreads its fingers about the same axis as the right one."""
HINGE = (0.0106, 0.0142)
"""Radius and half length of the motors that are drawn [m]."""
SHELL, FRAME, SKIN, THING = ".74 .75 .78 1", ".25 .27 .31 1", ".95 .55 .18 1", ".36 .62 .80 1"
"""Colours."""

Rows = list[dict[str, str]]


def hand_xml(side: str = "right", thing: Thing | None = None) -> str:
    """The hand on its side, palm fixed, as an MJCF; with an object where one is given.

    Palm and world share the x axis. The index finger is on top: the right hand's fingers point
    along the world's -y, those of the left, its mirror image, along y. They curl about a vertical
    axis, and gravity pulls along all pads.

    Args:
        side: "right", or "left", which is its mirror image.
        thing: that floats before the hand.

    Raises:
        ValueError: another side.
    """
    if side not in ("right", "left"):
        raise ValueError(f"side 'right' or 'left' expected, {side!r} given")
    rows = [_mirrored(row) if side == "left" else row for row in _table()]
    turn = np.pi / 2 if side == "right" else -np.pi / 2
    body = "" if thing is None else _object_xml(thing)
    return f"""<mujoco model="allegro {side}">
  <compiler angle="radian" eulerseq="XYZ"/>
  <option timestep="{TIMESTEP!r}" integrator="implicitfast" gravity="0 0 {-GRAVITY}"/>
  <visual>
    <global offwidth="1280" offheight="960"/><quality shadowsize="2048"/>
    <headlight ambient=".42 .42 .42" diffuse=".35 .35 .35" specular=".1 .1 .1"/>
  </visual>
  <default>
    <geom contype="0" conaffinity="0" rgba="{SHELL}"/>
    <joint armature="{ARMATURE}" damping="{DAMPING}" frictionloss="{FRICTION}" limited="true"/>
  </default>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1=".93 .95 .97" rgb2=".99 .99 .99" width="256"
      height="256"/>
  </asset>
  <worldbody>
    <light pos=".5 {-0.4 * np.sign(turn)} .9" dir="-.4 {0.35 * np.sign(turn)} -.9"
      diffuse=".55 .55 .55"/>
    <body name="palm" euler="{turn!r} 0 0">
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
    """The same link of the other hand: y to -y. Turns about x and z change their sense.

    But for `MIRRORED` joints, whose limits are symmetric: there the axis stays.
    """
    names = ["y", "roll", "yaw", "middle_y"]
    if MIRRORED[_number(row)] > 0:
        names += ["axis_x", "axis_z"]
    return row | {name: repr(-float(row[name])) for name in names}


def _number(row: dict[str, str]) -> int:
    return int(row["joint"].removeprefix("joint_").removesuffix(".0"))


def _link_xml(row: dict[str, str], rows: Rows) -> str:
    children = "".join(_link_xml(other, rows) for other in rows if other["parent"] == row["link"])
    number = _number(row)
    sides = tuple(float(row[f"side_{a}"]) for a in "xyz")
    middle = tuple(float(row[f"middle_{a}"]) for a in "xyz")
    tip = "" if children else _tip_xml(number)
    return f"""<body name="{row["link"]}" pos="{row["x"]} {row["y"]} {row["z"]}"
      euler="{row["roll"]} {row["pitch"]} {row["yaw"]}">
      <joint name="joint_{number}" axis="{row["axis_x"]} {row["axis_y"]} {row["axis_z"]}"
        range="{row["lower"]} {row["upper"]}"/>
      {_box_xml(sides, middle, float(row["mass"]))}{_hinge_xml(row)}{tip}{children}</body>"""


def _hinge_xml(row: dict[str, str]) -> str:
    """The motor of a joint, for the looks."""
    x, y, z = (HINGE[1] * float(row[f"axis_{a}"]) for a in "xyz")
    ends = f"{-x:.6g} {-y:.6g} {-z:.6g} {x:.6g} {y:.6g} {z:.6g}"
    return f'<geom type="cylinder" fromto="{ends}" size="{HINGE[0]}" mass="0" rgba="{FRAME}"/>'


def _tip_xml(number: int) -> str:
    """The skin: its mass, and a capsule much like its shape."""
    x, _, z = MOUNTS[0 if number >= JOINTS["thumb"] else 1]
    x += AXIS
    return (
        f'<geom type="capsule" fromto="{x:.6g} 0 {z + TIP_BEGIN:.6g} {x:.6g} 0 {z + TIP_END:.6g}" '
        f'size="{TIP_RADIUS}" mass="{TIP_MASS}" rgba="{SKIN}"/>'
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
    colour = f'rgba="{THING}"'
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
        return "".join(  # faces of equal height would flicker through one another
            f'<geom type="box" size="{size[0]} {width} {half - 1e-4 * k}" '
            f'euler="0 0 {k * np.pi / 3!r}" {colour} mass="0"/>'
            for k in range(3)
        )
    n_slices = 24 if thing.shape == "frustum" else 1
    foot, top = (size[0], size[1]) if thing.shape == "frustum" else (size[0], size[0])
    thick = half / n_slices
    return "".join(
        f'<geom type="cylinder" size="{foot + (top - foot) * (k + 0.5) / n_slices} {thick}" '
        f'pos="0 0 {middle - half + (2 * k + 1) * thick}" {colour} mass="0"/>'
        for k in range(n_slices)
    )
