"""Objects that the twin grasps: tables of objects, their shape, mass and inertia."""

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.files import read_toml
from holdfast.sensors.types import Array, rebuilt
from holdfast.twin.steps import (
    AROUND_2,
    BOX,
    CAPSULE,
    CENTRE,
    CODE,
    EXTENSION,
    HEXAGON,
    MU_KINETIC,
    MU_STATIC,
    N_OBJECT_NUMBERS,
    REVOLVED,
    SIDE_LENGTH,
    SIDE_OUT,
    SIDE_UP,
    TEXTURE_AMPLITUDE,
    distances,
)

BUILT_IN_OBJECTS = Path(__file__).with_name("tables") / "objects.toml"
"""Table of the built-in objects, on which models are trained."""
OTHER_OBJECTS = Path(__file__).with_name("tables") / "other_objects.toml"
"""Table of other objects, for tests with objects that no model has seen."""


SHAPES = {
    "sphere": ("radius",),
    "box": ("half width x", "half width y", "half height", "rounding"),
    "cylinder": ("radius", "half height", "rounding"),
    "capsule": ("radius", "half height"),
    "hexagon": ("radius", "half height", "rounding"),
    "frustum": ("radius at the foot", "radius at the top", "half height", "rounding"),
}
"""Meaning of the sizes of each shape, in order [m]."""

COLUMN_LIMITS = {
    "size": (0.001, 0.2),
    "mass": (0.005, 2.0),
    "friction": (0.05, 2.0),
    "texture": (0.0, 0.02),
    "finger_height": (0.0, 0.06),
    "yaw": (-math.pi, math.pi),
}
"""Minimum and maximum of every column, in its unit."""

GRASPABLE_HALF_WIDTH = (0.02, 0.045)
"""Minimum and maximum half width of an object [m]. `closing_path` checks whether the pads reach."""

N_GRID = 96
"""Grid points along the longest side in the quadrature of the mass."""


@dataclass(frozen=True, eq=False)
class GraspObject:
    """Shape, mass and friction of an object. The origin of its frame is the centre of mass.

    Attributes:
        name: name of the object.
        shape: a key of `SHAPES`.
        size: its sizes, in the order of `SHAPES` [m].
        mass: its mass [kg].
        inertia: (3,) moments about the axes through the centre of mass [kg m^2].
        mu_static: coefficient of friction at rest.
        mu_kinetic: coefficient of friction while it slides.
        texture_amplitude: amplitude of the longest wave of its surface [m].
        texture_wavelength: length of that wave [m].
        finger_height: height of the index finger above its middle, and depth of the ring finger
            below it [m].
        yaw: turn about its z axis, so that flat faces meet the pads [rad].
        foot: (3,) middle of its bottom in its frame [m].
    """

    name: str
    shape: str
    size: tuple[float, ...]
    mass: float
    inertia: Array
    mu_static: float
    mu_kinetic: float
    texture_amplitude: float
    texture_wavelength: float
    finger_height: float
    yaw: float
    foot: Array

    def __post_init__(self) -> None:
        for array in (self.inertia, self.foot):
            array.flags.writeable = False

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)

    @property
    def radius(self) -> float:
        """Half width, of a frustum at half height [m]."""
        return sum(self.size[:2]) / 2 if self.shape == "frustum" else self.size[0]

    @property
    def half_height(self) -> float:
        """Half of the height along z [m]."""
        return self.size[_height(self.shape)]

    @property
    def middle(self) -> float:
        """Height of its middle above its centre of mass [m]."""
        return float(self.foot[2]) + self.half_height


@cache
def _built_in() -> dict[str, GraspObject]:
    return load_objects(BUILT_IN_OBJECTS)


def object_named(name: str, table: str | Path | None = None) -> GraspObject:
    """Return the object of that name from a table, by default the built-in one.

    Raises:
        ValueError: the table has no such object; the message lists its objects.
        OSError: the table cannot be read.

    Example:
        >>> object_named("can").mass
        0.24
    """
    objects = load_objects(table)
    if name not in objects:
        raise ValueError(f"no object {name!r}; there are {', '.join(objects)}")
    return objects[name]


def load_objects(path: str | Path | None = None) -> dict[str, GraspObject]:
    """Read a table of objects, by name, in the order of the file.

    Args:
        path: TOML file with one line per object, like `objects.toml`, which is the default.

    Raises:
        ValueError: the file is not such a table, for instance because of an unknown field or
            shape, or a number out of range.
        OSError: the file cannot be read.
    """
    if path is None:
        return dict(_built_in())
    try:
        table = read_toml(path)
    except ValueError as cause:
        raise ValueError(f"{path} is no TOML table of objects: {cause}") from cause
    if not table:
        raise ValueError(f"{path} has no objects")
    objects = {}
    for name, row in table.items():
        try:
            objects[name] = make_object(name, row)
        except ValueError as cause:
            raise ValueError(f"{path}: {name}: {cause}") from cause
    return objects


def make_object(name: str, row: object) -> GraspObject:
    """Return the object that the fields of a line of the table describe.

    Raises:
        ValueError: a field is unknown or missing, or a number is out of range.
    """
    shape, numbers = _read(row)
    size, friction, texture = (numbers[key] for key in ("size", "friction", "texture"))
    # Each number is in its range; here those are compared that limit one another.
    if friction[1] > friction[0]:
        raise ValueError(f"friction: kinetic {friction[1]:g} is more than static {friction[0]:g}")
    if texture[1] < 0.0005 or texture[0] > texture[1] / 10:
        raise ValueError(
            "texture: a wavelength of at least 0.0005 and 10 amplitudes expected, "
            f"{texture[1]:g} given for an amplitude of {texture[0]:g}"
        )
    height = _height(shape)
    rounding = size[-1] if shape in ("box", "cylinder", "hexagon", "frustum") else 0.0
    if rounding >= min(size[: height + 1]):
        raise ValueError(f"size: a rounding below the other sizes expected, {rounding:g} given")
    if shape == "capsule" and size[1] < size[0]:
        raise ValueError(f"size: half height {size[1]:g} is less than the radius {size[0]:g}")
    low, high = GRASPABLE_HALF_WIDTH
    for width in size[: max(height, 1)]:
        if not low <= width <= high:
            raise ValueError(
                f"size: it cannot be grasped: half widths from {low:g} to {high:g} m fit the hand, "
                f"{width:g} given"
            )
    volume, centre, moments = _mass_of(_core(shape, size))
    (mass,) = numbers["mass"]
    return GraspObject(
        name=name,
        shape=shape,
        size=size,
        mass=mass,
        inertia=moments * (mass / volume),
        mu_static=friction[0],
        mu_kinetic=friction[1],
        texture_amplitude=texture[0],
        texture_wavelength=texture[1],
        finger_height=numbers["finger_height"][0],
        yaw=numbers["yaw"][0],
        foot=np.array([0.0, 0.0, -size[height] - centre]),
    )


def _read(row: object) -> tuple[str, dict[str, tuple[float, ...]]]:
    """Return shape and numbers of a line of the table, by column."""
    columns = ("shape", *COLUMN_LIMITS)
    if not isinstance(row, dict):
        raise ValueError(f"a line of fields expected ({', '.join(columns)})")
    if unknown := sorted(set(row) - set(columns)):
        raise ValueError(f"unknown field {unknown[0]!r}; there are {', '.join(columns)}")
    if missing := [column for column in columns if column not in row]:
        raise ValueError(f"{missing[0]!r} is missing")
    shape = row["shape"]
    if not isinstance(shape, str) or shape not in SHAPES:
        raise ValueError(f"no shape {shape!r}; there are {', '.join(SHAPES)}")
    names = {
        "size": SHAPES[shape],
        "friction": ("static", "kinetic"),
        "texture": ("amplitude", "wavelength"),
    }
    numbers = {}
    for key, (low, high) in COLUMN_LIMITS.items():
        values = row[key] if isinstance(row[key], list) else [row[key]]
        expected = names.get(key, ("",))
        if len(values) != len(expected):
            what = ", ".join(expected) or "one number"
            raise ValueError(f"{key}: {what} expected, {len(values)} numbers given")
        for value in values:  # in Python, True is a number
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and low <= value <= high):
                raise ValueError(
                    f"{key}: numbers from {low:g} to {high:g} expected, {value!r} given"
                )
        numbers[key] = tuple(map(float, values))
    return shape, numbers


def _height(shape: str) -> int:
    """Return the index of the half height in the sizes of a shape."""
    return {"sphere": 0, "capsule": 1, "cylinder": 1, "hexagon": 1}.get(shape, 2)


def _core(shape: str, size: tuple[float, ...]) -> Array:
    """Pack the smooth shape, (N_OBJECT_NUMBERS,), with its centre of mass at the middle."""
    core = np.zeros(N_OBJECT_NUMBERS)
    # A shape that is neither box nor hexagon is turned about its axis: a side, or a capsule's core.
    codes = {"box": BOX, "hexagon": HEXAGON, "sphere": CAPSULE, "capsule": CAPSULE}
    core[CODE] = codes.get(shape, REVOLVED)
    if shape in ("sphere", "capsule"):
        core[1], core[EXTENSION] = size[_height(shape)] - size[0], size[0]
        return core
    core[EXTENSION] = size[-1]
    if shape not in ("cylinder", "frustum"):
        core[1 : len(size)] = [value - size[-1] for value in size[:-1]]
        return core
    # A side parallel to the side of the shape, one rounding inside. A cylinder is a frustum
    # with one radius.
    foot, top, half_height, rounding = size if shape == "frustum" else (size[0], *size)
    slope = (top - foot) / (2 * half_height)
    steep = math.hypot(1.0, slope)
    height = half_height - rounding
    middle = (foot + top) / 2 - rounding * steep
    core[1:4] = middle - slope * height, middle + slope * height, height
    core[SIDE_OUT], core[SIDE_UP] = 1 / steep, -slope / steep
    core[SIDE_LENGTH] = 2 * height * steep
    return core


def solid(item: GraspObject) -> Array:
    """Pack shape and surface of an object as numbers for shapes.c.

    Returns:
        (N_OBJECT_NUMBERS,) array: code, core, texture, static and kinetic friction.
    """
    packed = _core(item.shape, item.size)
    packed[CENTRE] = -item.middle
    # Two waves, the second 0.37 times as long; about the axis a whole number of each, so that the
    # surface has no seam.
    wave = 2 * math.pi / item.texture_wavelength
    short = wave / 0.37
    around = [round(wave * item.radius), round(short * item.radius)]
    packed[TEXTURE_AMPLITUDE : AROUND_2 + 1] = [item.texture_amplitude, wave, 0.6 * short, *around]
    packed[MU_STATIC], packed[MU_KINETIC] = item.mu_static, item.mu_kinetic
    return packed


def distance_to(item: GraspObject, points: npt.ArrayLike) -> Array:
    """Compute distances of points from the object's textured surface, negative inside.

    Args:
        item: the object.
        points: (..., 3) points in the object's frame [m].

    Returns:
        (...) signed distances [m].

    Example:
        >>> round(float(distance_to(object_named("ball"), [0.0, 0.0, 0.043])), 3)
        0.01
    """
    positions = np.asarray(points, dtype=np.float64)
    flat = np.ascontiguousarray(positions.reshape(-1, 3))
    signed = _distances(solid(item), flat)
    return signed.reshape(positions.shape[:-1])


def _distances(packed: Array, points: Array) -> Array:
    signed = np.empty(len(points))
    distances(packed, points, signed)
    return signed


def reach_of(item: GraspObject, direction: Array, height: float) -> float:
    """Return the distance from the object's axis to its surface in a direction [m].

    Args:
        item: the object.
        direction: (3,) horizontal unit vector in the object's frame.
        height: height over the centre of mass [m].

    Returns:
        The distance of the last point inside, of points 0.1 mm apart; NaN without any.
    """
    reach = np.linspace(0.0, 0.09, 901)
    points = reach[:, None] * direction + [0.0, 0.0, height]
    inside = np.flatnonzero(distance_to(item, points) < 0)
    return float(reach[inside[-1]]) if len(inside) else math.nan


def _mass_of(core: Array) -> tuple[float, float, Array]:
    """Compute volume [m^3], height of the centre [m] and second moments (3,) [m^5] about it.

    The grid covers a quarter of the body, because all shapes are symmetric in x and y. A cell on
    the surface counts by the part of it that is inside.
    """
    code, rounding = int(core[CODE]), float(core[EXTENSION])
    # Half width and half height of the box around the core and its rounding [m].
    if code == CAPSULE:
        wide, tall = rounding, float(core[1]) + rounding
    elif code == HEXAGON:
        wide, tall = float(core[1]) * 2 / math.sqrt(3) + rounding, float(core[2]) + rounding
    else:
        wide, tall = float(max(core[1], core[2])) + rounding, float(core[3]) + rounding
    step = max(wide, 2 * tall) / N_GRID
    across = (np.arange(math.ceil(wide / step)) + 0.5) * step
    up = (np.arange(2 * math.ceil(tall / step)) + 0.5) * step - math.ceil(tall / step) * step
    x, y, z = (part.ravel() for part in np.meshgrid(across, across, up, indexing="ij"))
    depth = -_distances(core, np.stack([x, y, z], axis=1))
    cell = 4 * step**3 * np.clip(0.5 + depth / step, 0.0, 1.0)
    volume = float(cell.sum())
    centre = float((cell * z).sum()) / volume
    xx, yy, zz = ((cell * c * c).sum() for c in (x, y, z - centre))
    return volume, centre, np.array([yy + zz, xx + zz, xx + yy])
