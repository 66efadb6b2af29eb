"""Built-in sensors and hands, made from the tables in the folder `tables`."""

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from importlib import resources

import numpy as np

from holdfast.sensors.types import Array, Hand, HandModule, Sensor, Unit

UINT16 = (0.0, 65535.0)
"""Smallest and largest reading of XELA's sensors [count]."""
INT8_UINT8 = (-128.0, 255.0)
"""Smallest and largest reading of a sensor with int8 along x and y and uint8 along z [count]."""

MODULE_TO_FINGERTIP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation from the frame of the uSCuAH module (x lateral, y distal, z palmar) to the Allegro
fingertip frame (x palmar, z distal). Every finger has this mount: rpy (90, 0, 90) degrees."""


def sensor(name: str) -> Sensor:
    """Return the built-in sensor of this name.

    Raises:
        ValueError: there is no built-in sensor of this name.

    Example:
        >>> sensor("uskin-curved").n_taxels
        30
    """
    if name not in SENSORS:
        raise ValueError(f"unknown sensor {name!r}; built in are {', '.join(SENSORS)}")
    return SENSORS[name]()


def as_sensor(value: Sensor | str) -> Sensor:
    """Return a sensor, given it or the name of a built-in one."""
    return sensor(value) if isinstance(value, str) else value


def hand(name: str) -> Hand:
    """Return the built-in hand of this name.

    Raises:
        ValueError: there is no built-in hand of this name.

    Example:
        >>> len(hand("allegro-uskin").modules)
        18
    """
    if name not in HANDS:
        raise ValueError(f"unknown hand {name!r}; built in are {', '.join(HANDS)}")
    return HANDS[name]()


def built_in_sensors() -> tuple[str, ...]:
    """Return the names of the built-in sensors."""
    return tuple(SENSORS)


def built_in_hands() -> tuple[str, ...]:
    """Return the names of the built-in hands."""
    return tuple(HANDS)


def flat_sensor(
    name: str,
    n_rows: int,
    n_columns: int,
    pitch: float,
    rate: float = 100.0,
    unit: Unit = "count",
) -> Sensor:
    """Return a flat grid of taxels, row by row from the top left, with z as the normal.

    Args:
        name: name of the sensor.
        n_rows: number of rows.
        n_columns: number of taxels in a row.
        pitch: distance between neighbouring taxels [m].
        rate: nominal sample rate [Hz].
        unit: unit of the readings.

    Raises:
        ValueError: a number or the unit is not valid.

    Example:
        >>> flat_sensor("mine", 3, 3, 0.0047).positions[0].tolist()
        [-0.0047, 0.0047, 0.0]
    """
    grid = _grid(name, (n_rows, n_columns), (pitch, pitch), rate, unit=unit)
    # Multiples of a decimal pitch differ from decimal numbers in their last digits.
    return replace(grid, positions=np.round(grid.positions, 9))


@cache
def _grid(
    name: str,
    shape: tuple[int, int],
    pitches: tuple[float, float],
    rate: float,
    ends: tuple[float, float] | None = None,
    unit: Unit = "count",
) -> Sensor:
    """Return a flat grid around its centre, row by row from the top left; pitches in x and y."""
    (n_rows, n_columns), (pitch_x, pitch_y) = shape, pitches
    x = (np.arange(n_columns) - (n_columns - 1) / 2) * pitch_x
    y = ((n_rows - 1) / 2 - np.arange(n_rows)) * pitch_y
    positions = np.array([[column, row, 0.0] for row in y for column in x])
    rotations = np.tile(np.eye(3), (len(positions), 1, 1))
    return Sensor(name, positions, rotations, np.array([0.0, 0.0, 1.0]), rate, unit, ends)


@cache
def uskin_curved() -> Sensor:
    """Return the uSCuAH fingertip: 30 taxels on a shell, in the frame of the Allegro fingertip."""
    positions, rotations = _poses(_table("uskin_curved.csv"))
    return Sensor(
        "uskin-curved",
        positions @ MODULE_TO_FINGERTIP.T,
        MODULE_TO_FINGERTIP @ rotations,
        np.array([1.0, 0.0, 0.0]),
        rate=150.0,
        range=UINT16,
    )


@cache
def anyskin() -> Sensor:
    """Return 5 magnetometers: centre, left, right, up, down; rotated in plane, nominal pitch."""
    pitch = 7e-3
    positions = pitch * np.array([[0, 0, 0], [-1, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0]])
    # Each chip is rotated in the plane by an angle of its own.
    angles = np.array([-np.pi / 2, -np.pi / 2, np.pi, np.pi / 2, 0.0])
    rotations = np.zeros((5, 3, 3))
    rotations[:, 0, 0] = rotations[:, 1, 1] = np.cos(angles)
    rotations[:, 1, 0] = np.sin(angles)
    rotations[:, 0, 1] = -np.sin(angles)
    rotations[:, 2, 2] = 1.0
    return Sensor("anyskin", positions, rotations, np.array([0.0, 0.0, 1.0]), rate=100.0)


@cache
def _orca(name: str) -> Sensor:
    """Return an ORCA Touch fingertip. Forces of all taxels have the axes of the module."""
    rows = [row for row in _table("orca.csv") if row["sensor"] == name]
    positions = np.array([[float(row[axis]) for axis in "xyz"] for row in rows])
    return Sensor(
        name,
        positions,
        np.tile(np.eye(3), (len(rows), 1, 1)),
        np.array([0.0, 0.0, 1.0]),
        rate=100.0,
        unit="N",
        range=(0.1 * INT8_UINT8[0], 0.1 * INT8_UINT8[1]),
        step=0.1,
        rests_at_zero=True,
    )


@cache
def allegro_uskin() -> Hand:
    """Return the Allegro hand with 18 uSkin modules, which report in one packet of 368 taxels."""
    # In the packet, modules interleave as the hand reads them out: only the table says which.
    by_module: dict[str, list[dict[str, str]]] = {}
    for row in _table("allegro_uskin.csv"):
        by_module.setdefault(row["module"], []).append(row)

    def order(name: str) -> tuple[bool, int, str]:
        # Fingertips first, then pads and palm, from the thumb on.
        parts = ("thumb", "index", "middle", "ring", "palm")
        return "/" in name, parts.index(name.split("/", maxsplit=1)[0]), name

    modules = {}
    for name in sorted(by_module, key=order):
        rows = sorted(by_module[name], key=lambda row: int(row["taxel"]))
        positions, rotations = _poses(rows)
        modules[name] = HandModule(
            sensor=sensor(rows[0]["sensor"]),
            flat_indices=np.array([int(row["flat_index"]) for row in rows]),
            link=rows[0]["link"],
            positions=positions,
            rotations=rotations,
            grid=np.array([(int(row["row"]), int(row["column"])) for row in rows]),
        )
    return Hand("allegro-uskin", modules)


SENSORS_BY_MAKER: dict[str, dict[str, Callable[[], Sensor]]] = {
    "XELA": {
        "uskin-curved": uskin_curved,
        # Pitches of XELA's URDF files of the uSPa44 and the uSPa46.
        "uskin-4x4": partial(_grid, "uskin-4x4", (4, 4), (4.667e-3, 4.667e-3), 100.0, UINT16),
        "uskin-4x6": partial(_grid, "uskin-4x6", (4, 6), (7.24e-3, 7.17e-3), 100.0, UINT16),
    },
    # 15 sections of fingers with a reading each; nominal positions, 3 a finger.
    "GTac": {"gtac": partial(_grid, "gtac", (3, 5), (25e-3, 25e-3), 150.0)},
    "AnySkin": {"anyskin": anyskin},
    "Contactile": {
        # 3 x 3 pillars, which send newtons; nominal pitch.
        "papillarray": partial(_grid, "papillarray", (3, 3), (7e-3, 7e-3), 1000.0, unit="N"),
        "force-button": partial(_grid, "force-button", (1, 1), (1.0, 1.0), 100.0, unit="N"),
    },
    "ORCA": {name: partial(_orca, name) for name in ("orca-finger", "orca-thumb", "orca-pinky")},
    # 10 lines of 12 points towards the tip; nominal pitch.
    "PaXini": {"paxini-120": partial(_grid, "paxini-120", (10, 12), (2e-3,) * 2, 60.0, INT8_UINT8)},
    "Robotera": {"xhand": partial(_grid, "xhand", (10, 12), (2e-3,) * 2, 60.0)},
}
"""Functions that make the built-in sensors, by maker and name."""
SENSORS = {name: make for makers in SENSORS_BY_MAKER.values() for name, make in makers.items()}
"""The same by name."""
HANDS = {"allegro-uskin": allegro_uskin}
"""Functions that make the built-in hands, by name."""


def _table(name: str) -> list[dict[str, str]]:
    text = resources.files("holdfast.sensors").joinpath("tables", name).read_text("utf-8")
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


def _poses(rows: list[dict[str, str]]) -> tuple[Array, Array]:
    axes = "123"
    positions = np.array([[float(row[axis]) for axis in "xyz"] for row in rows])
    rotations = np.array([[[float(row[f"r{i}{j}"]) for j in axes] for i in axes] for row in rows])
    return positions, rotations
