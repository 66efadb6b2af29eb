"""The layouts that holdfast knows, built from the tables beside this file."""

import csv
from functools import cache
from importlib import resources

import numpy as np

from holdfast.sensors.types import Array, Hand, HandModule, Sensor

UINT16 = (0.0, 65535.0)

MODULE_TO_FINGERTIP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Turns the uSCuAH module (x lateral, y distal, z palmar) into the Allegro fingertip frame
(x palmar, z distal): the mount of every finger, rpy (90, 0, 90) degrees."""


def sensor(name: str) -> Sensor:
    """The built-in sensor of that name.

    Raises:
        ValueError: there is none.

    Example:
        >>> sensor("uskin-curved").n_taxels
        30
    """
    if name not in _SENSORS:
        raise ValueError(f"unknown sensor {name!r}; built in are {', '.join(_SENSORS)}")
    return _SENSORS[name]()


def hand(name: str) -> Hand:
    """The built-in hand of that name.

    Raises:
        ValueError: there is none.

    Example:
        >>> len(hand("allegro-uskin").modules)
        18
    """
    if name not in _HANDS:
        raise ValueError(f"unknown hand {name!r}; built in are {', '.join(_HANDS)}")
    return _HANDS[name]()


def built_in_sensors() -> tuple[str, ...]:
    """Names of the built-in sensors."""
    return tuple(_SENSORS)


def built_in_hands() -> tuple[str, ...]:
    """Names of the built-in hands."""
    return tuple(_HANDS)


@cache
def _uskin_curved() -> Sensor:
    rows = _table("uskin_curved.csv")
    positions, rotations = _poses(rows)
    return Sensor(
        "uskin-curved",
        positions @ MODULE_TO_FINGERTIP.T,
        MODULE_TO_FINGERTIP @ rotations,
        np.array([1.0, 0.0, 0.0]),
        rate=150.0,
        limits=UINT16,
    )


@cache
def _uskin_4x4() -> Sensor:
    return _flat("uskin-4x4", _grid(4, 4, 4.667e-3, 4.667e-3), 100.0, limits=UINT16)


@cache
def _uskin_4x6() -> Sensor:
    return _flat("uskin-4x6", _grid(4, 6, 7.24e-3, 7.17e-3), 100.0, limits=UINT16)


@cache
def _gtac() -> Sensor:
    """Fifteen finger sections, one 3-axis reading each; places nominal (three a finger)."""
    return _flat("gtac", _grid(3, 5, 25e-3, 25e-3), 150.0)


@cache
def _anyskin() -> Sensor:
    """Five magnetometers: centre, left, right, up, down, turned in their plane; nominal pitch."""
    pitch = 7e-3
    places = pitch * np.array([[0, 0, 0], [-1, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0]])
    angles = np.array([-np.pi / 2, -np.pi / 2, np.pi, np.pi / 2, 0.0])
    turns = np.zeros((5, 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0] = np.sin(angles)
    turns[:, 0, 1] = -np.sin(angles)
    turns[:, 2, 2] = 1.0
    return Sensor("anyskin", places, turns, np.array([0.0, 0.0, 1.0]), rate=100.0)


@cache
def _papillarray() -> Sensor:
    """Nine pillars, three by three, in newtons; nominal pitch."""
    grid = _grid(3, 3, 7e-3, 7e-3)
    turns = np.tile(np.eye(3), (9, 1, 1))
    return Sensor("papillarray", grid, turns, np.array([0.0, 0.0, 1.0]), rate=1000.0, unit="N")


@cache
def _allegro_uskin() -> Hand:
    by_module: dict[str, list[dict[str, str]]] = {}
    for row in _table("allegro_uskin.csv"):
        by_module.setdefault(row["module"], []).append(row)
    modules = {name: _hand_module(by_module[name]) for name in sorted(by_module, key=_place)}
    return Hand("allegro-uskin", modules)


_MODELS = {"uSCuAH": _uskin_curved, "uSPa44": _uskin_4x4, "uSPa46": _uskin_4x6}

_SENSORS = {
    "uskin-curved": _uskin_curved,
    "uskin-4x4": _uskin_4x4,
    "uskin-4x6": _uskin_4x6,
    "gtac": _gtac,
    "anyskin": _anyskin,
    "papillarray": _papillarray,
}
_HANDS = {"allegro-uskin": _allegro_uskin}


def _place(name: str) -> tuple[bool, int, str]:
    """Fingertips first, then pads and palm, from the thumb on."""
    parts = ("thumb", "index", "middle", "ring", "palm")
    return "/" in name, parts.index(name.split("/", maxsplit=1)[0]), name


def _hand_module(rows: list[dict[str, str]]) -> HandModule:
    rows = sorted(rows, key=lambda row: int(row["taxel"]))
    positions, rotations = _poses(rows)
    return HandModule(
        sensor=_MODELS[rows[0]["model"]](),
        flat_indices=np.array([int(row["flat_index"]) for row in rows]),
        link=rows[0]["link"],
        positions=positions,
        rotations=rotations,
        grid=np.array([(int(row["row"]), int(row["column"])) for row in rows]),
    )


def _table(name: str) -> list[dict[str, str]]:
    text = resources.files("holdfast.sensors").joinpath("tables", name).read_text("utf-8")
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


def _poses(rows: list[dict[str, str]]) -> tuple[Array, Array]:
    axes = "123"
    positions = np.array([[float(row[axis]) for axis in "xyz"] for row in rows])
    rotations = np.array([[[float(row[f"r{i}{j}"]) for j in axes] for i in axes] for row in rows])
    return positions, rotations


def _grid(n_rows: int, n_columns: int, pitch_x: float, pitch_y: float) -> Array:
    """Taxels of a flat patch about its middle, from the top left, line by line [m]."""
    x = (np.arange(n_columns) - (n_columns - 1) / 2) * pitch_x
    y = ((n_rows - 1) / 2 - np.arange(n_rows)) * pitch_y
    return np.array([[across, up, 0.0] for up in y for across in x])


def _flat(
    name: str, positions: Array, rate: float, limits: tuple[float, float] | None = None
) -> Sensor:
    turns = np.tile(np.eye(3), (len(positions), 1, 1))
    return Sensor(name, positions, turns, np.array([0.0, 0.0, 1.0]), rate, limits=limits)
