"""Layouts of XELA's sensors, by the model names that its servers send."""

from dataclasses import replace
from typing import Any

import numpy.typing as npt

from holdfast.sensors import Hand, Sensor, flat_sensor, hand, sensor
from holdfast.sensors.built_in import UINT16

XELA_HANDS = {"xr23ahlcpp": "allegro-uskin", "xr23ahrcpp": "allegro-uskin"}
"""Built-in hand of each model that is a whole hand; names in lower case."""
XELA_SENSORS = {
    "uscuah": "uskin-curved",
    "uscualha": "uskin-curved",
    "usftah": "uskin-4x4",
    "uspa44": "uskin-4x4",
    "xr1844": "uskin-4x4",
    "xr1944": "uskin-4x4",
    "uspa46": "uskin-4x6",
    "xr1946": "uskin-4x6",
}
"""Built-in sensor of each other model; names in lower case."""
SENSOR_BY_N_TAXELS = {16: "uskin-4x4", 24: "uskin-4x6", 30: "uskin-curved"}
"""Built-in sensor of a device that sends no model, as old servers do."""
DEFAULT_PITCH = 4.7e-3
"""Distance between the taxels of an unknown model [m]; nominal."""
NEWTONS_PER_SHEAR_COUNT, NEWTONS_PER_NORMAL_COUNT = 0.000628, 0.000729
"""Resolution of the tangential axes and of the normal of a uSkin taxel, by the data sheet of the
uSPa46 [N/count]."""
UNKNOWN_MODEL_RATE = 100.0
"""Rate of an unknown model [Hz]; nominal."""


def module_sensors(model: str, n_taxels: int) -> dict[str, Sensor]:
    """Return the sensors of a device by module; a single sensor has the name ''.

    Importers and live sources both use this function, so that a device is the same sensor in
    both. A device without a model is the built-in XELA sensor with that number of taxels. Any
    other unknown device is a flat grid (see `flat_grid`) with the name of its model: its
    fingertip force is right if all of its taxels have the same orientation.

    Args:
        model: name that the server sends, in upper or lower case; may be empty.
        n_taxels: number of taxels that the device sends.

    Raises:
        ValueError: there are no taxels, or the model has another number of them.

    Example:
        >>> [len(module_sensors("XR23AHRCPP", 368)), module_sensors("uSPa46", 24)[""].name]
        [18, 'uskin-4x6']
        >>> [module_sensors("", 16)[""].name, module_sensors("uSPa35", 15)[""].name]
        ['uskin-4x4', 'uspa35']
    """
    if n_taxels < 1:
        raise ValueError(f"{model or 'a sensor'} with {n_taxels} taxels given; at least 1 expected")
    # A whole hand first: its model has no sensor of its own.
    skin: Hand | Sensor | None = whole_hand(model)
    if skin is None and model.lower() in XELA_SENSORS:
        skin = sensor(XELA_SENSORS[model.lower()])
    if skin is None:
        if not model and n_taxels in SENSOR_BY_N_TAXELS:
            return {"": sensor(SENSOR_BY_N_TAXELS[n_taxels])}
        return {"": flat_grid(model.lower() or "unknown", n_taxels)}
    if n_taxels != skin.n_taxels:
        raise ValueError(
            f"{n_taxels} taxels given, {skin.n_taxels} expected ({model}: {skin.name})"
        )
    if isinstance(skin, Sensor):
        return {"": skin}
    return {name: module.sensor for name, module in skin.modules.items()}


def is_known(model: str) -> bool:
    """Return whether the model is in the table of hands and sensors."""
    return model.lower() in XELA_HANDS or model.lower() in XELA_SENSORS


def whole_hand(model: str) -> Hand | None:
    """Return the hand that reports in one packet under this model name, or None."""
    name = XELA_HANDS.get(model.lower())
    return None if name is None else hand(name)


def split(model: str, flat: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
    """Split (..., n_taxels, 3) readings of a device into modules, as in `module_sensors`."""
    hand_of_model = whole_hand(model)
    return {"": flat} if hand_of_model is None else hand_of_model.split(flat)


def flat_grid(name: str, n_taxels: int) -> Sensor:
    """Return a flat sensor with a complete grid of taxels, as near to a square as possible.

    Example:
        >>> float(flat_grid("uspa35", 15).positions[:, 1].max())
        0.0047
    """
    # Complete rows: the layout is unknown, and a row with gaps would invent more of it.
    n_rows = max(k for k in range(1, int(n_taxels**0.5) + 1) if n_taxels % k == 0)
    grid = flat_sensor(name, n_rows, n_taxels // n_rows, DEFAULT_PITCH, UNKNOWN_MODEL_RATE)
    return replace(grid, range=UINT16)
