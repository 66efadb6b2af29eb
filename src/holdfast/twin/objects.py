"""The objects that the twin grasps: a table, and the mass and inertia of what is in it."""

import math
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.sensors.types import Array, rebuilt
from holdfast.twin.shapes import (
    AMPLITUDE,
    AROUND_2,
    BOX,
    CAPSULE,
    CENTRE,
    CODE,
    HEXAGON,
    MU_KINETIC,
    MU_STATIC,
    N_SOLID,
    REVOLVED,
    ROUNDING,
    SIDE_LENGTH,
    SIDE_OUT,
    SIDE_UP,
    distances,
)

TABLE = Path(__file__).with_name("objects.toml")
"""The objects that are built in: what models are trained on."""
OTHER_OBJECTS = Path(__file__).with_name("other_objects.toml")
"""Other objects, for tests with what a model has never seen."""

SHAPES = {
    "sphere": ("radius",),
    "box": ("half width x", "half width y", "half height", "rounding"),
    "cylinder": ("radius", "half height", "rounding"),
    "capsule": ("radius", "half height"),
    "hexagon": ("radius", "half height", "rounding"),
    "frustum": ("radius at the foot", "radius at the top", "half height", "rounding"),
}
"""What the sizes of each shape are, in order [m]."""

LIMITS = {
    "size": (0.001, 0.2),
    "mass": (0.005, 2.0),
    "friction": (0.05, 2.0),
    "texture": (0.0, 0.02),
    "finger_height": (0.0, 0.06),
    "yaw": (-math.pi, math.pi),
}
"""Smallest and largest value of every column, in its unit."""

GRASP = (0.02, 0.045)
"""Half widths that fit the hand [m]; between thumb and fingers the path to them decides."""

N_GRID = 96
"""Points of the quadrature of mass along the longest side."""


@dataclass(frozen=True, eq=False)
class Thing:
    """An object: what it is shaped like, weighs and feels like. Its frame is that of its mass.

    Attributes:
        name: what it is called.
        shape: a key of `SHAPES`.
        size: its sizes, as `SHAPES` orders them [m].
        mass: [kg].
        inertia: (3,) about the axes through the centre of mass [kg m^2].
        mu_static: coefficient of friction at rest.
        mu_kinetic: coefficient of friction while it slides.
        texture_amplitude: of the longest wave of its surface [m].
        texture_wavelength: of that wave [m].
        finger_height: index and ring finger grasp it so far above and below its middle [m].
        yaw: about its z axis, so that flat faces meet the pads [rad].
        foot: (3,) where its bottom is in its frame [m].
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
        """Its half width, at its middle where it tapers [m]."""
        return sum(self.size[:2]) / 2 if self.shape == "frustum" else self.size[0]

    @property
    def half_height(self) -> float:
        """Half of its height along z [m]."""
        return self.size[_height(self.shape)]


@cache
def _built_in() -> dict[str, Thing]:
    return load_things(TABLE)


def thing(name: str, table: str | Path | None = None) -> Thing:
    """The object of that name from a table, by default the built-in one.

    Raises:
        ValueError: there is none; the message lists what there is.

    Example:
        >>> thing("can").mass
        0.24
    """
    things = load_things(table)
    if name not in things:
        raise ValueError(f"no object {name!r}; there are {', '.join(things)}")
    return things[name]


def load_things(path: str | Path | None = None) -> dict[str, Thing]:
    """The objects of a table, by name, in its order.

    Args:
        path: a TOML file with a line per object, like `objects.toml`; by default that one.

    Raises:
        ValueError: it is no such table: an unknown field or shape, a number out of range.
        OSError: it cannot be read.
    """
    if path is None:
        return dict(_built_in())
    try:
        table = tomllib.loads(Path(path).read_text("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as cause:
        raise ValueError(f"{path} is no TOML table of objects: {cause}") from cause
    if not table:
        raise ValueError(f"{path} has no objects")
    things = {}
    for name, row in table.items():
        try:
            things[name] = _thing(name, row)
        except ValueError as cause:
            raise ValueError(f"{path}: {name}: {cause}") from cause
    return things


def _thing(name: str, row: object) -> Thing:
    shape, numbers = _read(row)
    size, friction, texture = (numbers[key] for key in ("size", "friction", "texture"))
    _check(shape, size, friction, texture)
    volume, centre, moments = _mass_of(_core(shape, size))
    (mass,) = numbers["mass"]
    return Thing(
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
        foot=np.array([0.0, 0.0, -size[_height(shape)] - centre]),
    )


def _read(row: object) -> tuple[str, dict[str, tuple[float, ...]]]:
    """Shape and numbers of a line of the table, by column."""
    columns = ("shape", *LIMITS)
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
    return shape, {key: _numbers(row, key, names.get(key, ("",))) for key in LIMITS}


def _numbers(row: dict[str, Any], key: str, names: tuple[str, ...]) -> tuple[float, ...]:
    given = row[key] if isinstance(row[key], list) else [row[key]]
    low, high = LIMITS[key]
    if len(given) != len(names):
        wanted = ", ".join(names) or "one number"
        raise ValueError(f"{key}: {wanted} expected, {len(given)} numbers given")
    for value in given:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and low <= value <= high):
            raise ValueError(f"{key}: numbers from {low:g} to {high:g} expected, {value!r} given")
    return tuple(float(value) for value in given)


def _check(
    shape: str, size: tuple[float, ...], friction: tuple[float, ...], texture: tuple[float, ...]
) -> None:
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
    for width in size[: max(height, 1)]:
        if not GRASP[0] <= width <= GRASP[1]:
            raise ValueError(
                f"size: it cannot be grasped: half widths from {GRASP[0]:g} to {GRASP[1]:g} m "
                f"fit the hand, {width:g} given"
            )


def _height(shape: str) -> int:
    return {"sphere": 0, "capsule": 1, "cylinder": 1, "hexagon": 1}.get(shape, 2)


def shape_code(shape: str) -> int:
    """The core of a shape: REVOLVED, BOX, HEXAGON or CAPSULE."""
    codes = {"box": BOX, "hexagon": HEXAGON, "sphere": CAPSULE, "capsule": CAPSULE}
    return codes.get(shape, REVOLVED)


def _core(shape: str, size: tuple[float, ...]) -> Array:
    """(N_SOLID,) the smooth shape as numbers: its centre of mass at the middle, no texture."""
    core = np.zeros(N_SOLID)
    core[CODE] = shape_code(shape)
    if shape in ("sphere", "capsule"):
        core[1], core[ROUNDING] = size[_height(shape)] - size[0], size[0]
        return core
    core[ROUNDING] = size[-1]
    inner = [value - size[-1] for value in size[:-1]]
    if shape == "cylinder":
        _revolve(core, size[0], size[0], *size[1:])
    elif shape == "frustum":
        _revolve(core, *size)
    else:
        core[1 : 1 + len(inner)] = inner
    return core


def _revolve(core: Array, foot: float, top: float, half_height: float, rounding: float) -> None:
    """The core's side runs parallel to the frustum's, one rounding inside."""
    slope = (top - foot) / (2 * half_height)
    steep = math.hypot(1.0, slope)
    height = half_height - rounding
    middle = (foot + top) / 2 - rounding * steep
    core[1:4] = middle - slope * height, middle + slope * height, height
    core[SIDE_OUT], core[SIDE_UP] = 1 / steep, -slope / steep
    core[SIDE_LENGTH] = 2 * height * steep


def solid(thing: Thing) -> Array:
    """The object's shape and surface as numbers, for compiled code.

    Returns:
        (N_SOLID,) code, core, texture, static and kinetic friction.
    """
    packed = _core(thing.shape, thing.size)
    packed[CENTRE] = -thing.half_height - thing.foot[2]
    packed[AMPLITUDE : AROUND_2 + 1] = _texture(thing)
    packed[MU_STATIC], packed[MU_KINETIC] = thing.mu_static, thing.mu_kinetic
    return packed


def _texture(thing: Thing) -> list[float]:
    """Waves about the axis are whole, so that the texture has no seam."""
    wave = 2 * math.pi / thing.texture_wavelength
    short = wave / 0.37
    around = [round(wave * thing.radius), round(short * thing.radius)]
    return [thing.texture_amplitude, wave, 0.6 * short, *around]


def distance_to(thing: Thing, points: npt.ArrayLike) -> Array:
    """How far points are from the object's textured surface, negative inside.

    Args:
        thing: the object.
        points: (..., 3) in its frame [m].

    Returns:
        (...) [m].

    Example:
        >>> round(float(distance_to(thing("ball"), [0.0, 0.0, 0.043])), 3)
        0.01
    """
    given = np.asarray(points, dtype=np.float64)
    flat = np.ascontiguousarray(given.reshape(-1, 3))
    far: Array = distances(solid(thing), flat)
    return far.reshape(given.shape[:-1])


def _mass_of(core: Array) -> tuple[float, float, Array]:
    """Volume [m^3], height of the centre [m], second moments (3,) [m^5] about it.

    A grid over a quarter of the body (all shapes are mirrored in x and y); a cell on its
    surface counts by the part of it that lies inside.
    """
    wide, tall = _extent(core)
    step = max(wide, 2 * tall) / N_GRID
    across = (np.arange(math.ceil(wide / step)) + 0.5) * step
    up = (np.arange(2 * math.ceil(tall / step)) + 0.5) * step - math.ceil(tall / step) * step
    x, y, z = (part.ravel() for part in np.meshgrid(across, across, up, indexing="ij"))
    depth = -distances(core, np.stack([x, y, z], axis=1))
    cell = 4 * step**3 * np.clip(0.5 + depth / step, 0.0, 1.0)
    volume = float(cell.sum())
    centre = float((cell * z).sum()) / volume
    xx, yy, zz = ((cell * c * c).sum() for c in (x, y, z - centre))
    return volume, centre, np.array([yy + zz, xx + zz, xx + yy])


def _extent(core: Array) -> tuple[float, float]:
    """Half width and half height of the box that holds a core and its rounding [m]."""
    code, rounding = int(core[CODE]), float(core[ROUNDING])
    if code == CAPSULE:
        return rounding, float(core[1]) + rounding
    if code == HEXAGON:
        return float(core[1]) * 2 / math.sqrt(3) + rounding, float(core[2]) + rounding
    return float(max(core[1], core[2])) + rounding, float(core[3]) + rounding
