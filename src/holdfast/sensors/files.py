"""Sensors by name or file, what is printed of them, and the file of a sensor of one's own."""

import json
import math
from pathlib import Path

from holdfast.sensors.built_in import (
    built_in_hands,
    flat_sensor,
    hand,
    sensor,
)
from holdfast.sensors.taxel_numbers import taxel_number
from holdfast.sensors.types import Hand, Sensor


def find_sensor(name: str) -> Sensor:
    """Return a built-in sensor by its name, or the sensor in a JSON file.

    Raises:
        ValueError: the name is unknown, or the file is not valid.
        OSError: the file cannot be read.
    """
    if Path(name).suffix.lower() == ".json":
        return Sensor.from_json(name)
    try:
        return sensor(name)
    except ValueError as cause:
        hint = "or give a .json file (`holdfast sensors --template 3x3 > sensor.json` makes one)"
        raise ValueError(f"{cause}; hands: {', '.join(built_in_hands())}; {hint}") from cause


def find_layout(name: str, base: str | None) -> Sensor | Hand:
    """Return a built-in sensor or hand by its name, or the sensor in a JSON or URDF file.

    Args:
        name: name, or path of the file.
        base: link of the URDF file that is the fingertip frame; None for all others.

    Raises:
        ValueError: the name is unknown, the file is not valid, or `base` is missing or too much.
        OSError: the file cannot be read.
    """
    suffix = Path(name).suffix.lower()
    if suffix == ".urdf":
        if base is None:
            raise ValueError(f"{name} needs --base LINK: the link that is the fingertip frame")
        return Sensor.from_urdf(name, base)
    if base is not None:
        raise ValueError(f"--base belongs to a .urdf file; {name!r} given")
    return hand(name) if name in built_in_hands() else find_sensor(name)


def grid_sensor(grid: str, pitch: float = 5.0, rate: float = 100.0, unit: str = "count") -> Sensor:
    """Return a flat grid of taxels; arguments and errors as of `grid_file`."""
    rows, _, columns = grid.lower().partition("x")
    if not (rows.isdecimal() and columns.isdecimal() and int(rows) * int(columns)):
        raise ValueError(f"--template: ROWSxCOLUMNS such as 3x3 expected, {grid!r} given")
    name, kept = f"grid-{grid.lower()}", "N" if unit == "N" else "count"
    return flat_sensor(name, int(rows), int(columns), 1e-3 * pitch, rate=rate, unit=kept)  # type: ignore[arg-type]


def grid_file(grid: str, pitch: float, rate: float, unit: str) -> str:
    """Return the JSON file of a flat grid, one line for each taxel.

    Args:
        grid: ROWSxCOLUMNS.
        pitch: distance between neighbouring taxels [mm].
        rate: nominal sample rate [Hz].
        unit: of the readings, `count` or `N`.

    Raises:
        ValueError: one of them is not valid.
    """
    if not 0 < pitch < math.inf:
        raise ValueError(f"--pitch: a distance above 0 mm expected, {pitch:g} given")
    if unit not in ("count", "N"):
        raise ValueError(f"--unit: count or N expected, {unit!r} given")
    made = grid_sensor(grid, pitch, rate, unit)
    fields = []
    for key, value in made.to_dict().items():
        text = json.dumps(value)
        # A position and a rotation of a taxel are edited together: one line holds each.
        if isinstance(value, list) and isinstance(value[0], list):
            text = "[\n    " + ",\n    ".join(map(json.dumps, value)) + "\n  ]"
        fields.append(f"{json.dumps(key)}: {text}")
    return "{\n  " + ",\n  ".join(fields) + "\n}"


def sensor_rows(skin: Sensor) -> list[tuple[str, object]]:
    """Return the facts of a sensor as rows of a table."""
    ends = "unknown" if skin.range is None else "{:g} to {:g}".format(*skin.range)
    normal = ", ".join(f"{value:.3g}" for value in skin.normal)
    return [
        ("taxels", skin.n_taxels),
        ("unit", skin.unit),
        ("rate", f"{skin.rate:g} Hz"),
        ("range", ends),
        *([] if skin.step is None else [("step", f"{skin.step:g} {skin.unit}")]),
        *([("at rest", "exactly zero")] if skin.rests_at_zero else []),
        ("normal", f"({normal}) in the fingertip frame"),
    ]


def pose_rows(skin: Sensor) -> list[tuple[object, ...]]:
    """Return number, position [mm] and normal of each taxel as rows of a table."""
    return [
        (
            taxel_number(k),
            *(f"{1e3 * p:.1f}" for p in position),
            *(f"{z:.2f}" for z in rotation[:, 2]),
        )
        for k, (position, rotation) in enumerate(zip(skin.positions, skin.rotations, strict=True))
    ]
